"""How large a change must be to be named: diagnoses of larger and smaller ones agree."""

import numpy as np
import pytest

from lab.diagnosis.calibrate import parameters_of
from lab.diagnosis.spectral.diagnose import diagnose_spectra, evidence_threshold
from lab.diagnosis.spectral.fit import fit
from lab.diagnosis.spectral.recorded import Recorded
from lab.diagnosis.spectral.responses import Responses
from lab.diagnosis.spectral.smallest import Smallest, in_words, smallest_changes, smallest_drifts
from lab.effects import EFFECTS
from lab.rig import Rig
from lab.twin import twin
from tests.lab.diagnosis.test_spectral_diagnose import CHAIN, measured, responses


@pytest.fixture(scope="module")
def rig():
    return Rig.load("models/chain7.xml").connected(inputs=["force2"], outputs=["acc2.x", "acc5.x", "acc7.x"])


def calibrated(likelihood):
    return fit(likelihood, np.zeros(likelihood.parameters.n), (), likelihood.nuisance_mean)


@pytest.fixture(scope="module")
def sizes(rig):
    experiment = Responses.of(responses(rig, 0.01, 1, 0.0), band=None)
    likelihood = experiment.likelihood(twin(rig), parameters_of(twin(rig)), rig)
    return smallest_changes(likelihood, calibrated(likelihood), evidence_threshold(150))


def named(rig, cause, location, size):
    changed = EFFECTS[cause](location, **size).apply(rig)
    found = diagnose_spectra(responses(changed, 0.01, 2, 0.0), rig)
    return [(f.effect.cause, f.effect.location) for f in found.findings]


def test_every_parameter_has_a_size_and_the_smallest_comes_first(rig, sizes):
    assert set(sizes) == {"mass_change", "stiffness_change", "damping_change"}
    for each in sizes.values():
        assert len({s.location for s in each}) == 7
        assert [s.size for s in each] == sorted(s.size for s in each)


@pytest.mark.slow
@pytest.mark.parametrize(("share", "expected"), [(1.6, True), (0.6, False)])
def test_larger_changes_are_named_and_smaller_ones_are_not(rig, sizes, share, expected):
    (at,) = [s for s in sizes["mass_change"] if s.location == "mass5"]
    # Noise moves the root of the evidence by one, which is a sixth of what a name needs.
    found = named(rig, "mass_change", "mass5", {"delta_mass": float(np.expm1(share * at.size))})
    assert (("mass_change", "mass5") in found) == expected


@pytest.mark.slow
def test_a_drift_needs_less_in_a_longer_record():
    seven = Rig.load("models/chain7.xml").connected(inputs=[], outputs=CHAIN)
    model, needed = twin(seven), evidence_threshold(100)
    least = []
    for n in (1000, 4000):
        experiment = Recorded.of(measured(seven, 50.0, n, 4), seven, model, band=None)
        likelihood = experiment.likelihood(model, parameters_of(model), seven)
        found = calibrated(likelihood)
        parts = experiment.in_parts(likelihood)
        least.append(smallest_drifts(parts, found, EFFECTS["stiffness_drift"], needed)[0].size)
    # Information grows with the length: a quarter of the variance, and more as lower resonances are resolved.
    assert 1.5 < least[0] / least[1] < 4.0


def test_sizes_are_told_as_shares_factors_or_never():
    changes = {
        "mass_change": [Smallest("mass1", np.log(1.05)), Smallest("mass2", np.log(3.0))],
        "damping_change": [Smallest("spring1", np.inf)],
    }
    mass, damping, drift = in_words(changes, [Smallest("spring1", 0.1), Smallest("spring2", np.inf)])
    assert "a mass change alone is named from 5 % (mass1) to a factor of 3 (mass2) on" in mass
    assert "no size at spring1" in damping
    assert "from 10 % (spring1) to all (spring2)" in drift
    assert "too short to tell a spring that drifts" in in_words({}, None)[0]
    assert in_words({}, []) == ()
