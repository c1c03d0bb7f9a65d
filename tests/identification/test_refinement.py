"""Maximum likelihood after any method: one and the same maximum, on the bound, and said when it cannot be had."""

from dataclasses import replace

import numpy as np
import pytest

from identification.errors import RecordingError
from identification.identify import identify
from identification.information import cramer_rao_bound
from identification.recording import Record
from tests.ambient import ambient
from tests.systems import chain3, paper_chain3, recorded, with_noise


def shaken(*, n=1200, level=0.05, seed=0, initial=None):
    rng = np.random.default_rng(seed)
    system = paper_chain3("coupled")
    start = None if initial is None else [np.asarray(initial)]
    return with_noise(recorded(system, [rng.standard_normal((2, n))], initial=start), level, rng)


TRUTH = chain3("coupled")
MATRICES = ("mass", "damping", "stiffness")


def test_the_same_maximum_is_reached_from_methods_that_have_little_in_common():
    recording = shaken()
    found = [identify(recording, method, dofs=TRUTH.dofs, refine=True) for method in ("okid_era", "plscf")]
    for each in found:
        assert each.refinement.estimate.converged
        assert "maximum of the output-error likelihood" in each.explanation
        assert len(each.modes) == len(each.stable) == 3
    # The search ends within 1e-4 standard deviations of the maximum.
    np.testing.assert_allclose(
        *(each.modes.frequency_hz for each in found), atol=1e-3 * np.min(found[0].modes.frequency_std)
    )
    for name in MATRICES:
        a, b = (getattr(each.second_order, name) for each in found)
        np.testing.assert_array_less(np.abs(a - b), 1e-3 * getattr(found[0].second_order, f"{name}_std"))


def test_its_error_bars_are_the_bound_and_hold_the_truth():
    recording = shaken(seed=1)
    found = identify(recording, dofs=TRUTH.dofs, refine=True).second_order
    clean = recorded(paper_chain3("coupled"), [recording.records[0].inputs])
    std = 0.05 * np.sqrt(np.mean(np.square(clean.records[0].outputs), axis=1))
    bound = cramer_rao_bound(TRUTH, clean, noise_std=std[None]).second_order
    upper = np.triu_indices(3)
    for name in MATRICES:
        own, least = (getattr(each, f"{name}_std")[upper] for each in (found, bound))
        # The noise is known to 1/√(2 · 1200) and the bound moves with the estimate by some per cent.
        np.testing.assert_allclose(own, least, rtol=0.15)
        error = (getattr(found, name) - getattr(TRUTH, name))[upper]
        # Eighteen entries: one in 15 000 such tests has an error beyond four and a half.
        assert np.all(np.abs(error) < 4.5 * own)


def test_a_record_that_begins_in_motion_is_noticed():
    moving = identify(shaken(n=600, initial=np.ones(6)), order=6, dofs=TRUTH.dofs, refine=True)
    (initial,) = moving.refinement.estimate.initial_states
    assert initial.size == 6
    assert "free initial states" in moving.explanation
    resting = identify(shaken(n=600), order=6, dofs=TRUTH.dofs, refine=True)
    assert resting.refinement.estimate.initial_states == ()
    error = np.abs(moving.second_order.mass - TRUTH.mass)
    assert np.all(error < 5 * moving.second_order.mass_std)


def test_modes_alone_are_refined_where_the_layout_gives_no_matrices():
    recording = shaken()
    outputs = tuple(replace(channel, dof="") for channel in recording.outputs)
    found = identify(replace(recording, outputs=outputs), refine=True)
    assert found.second_order is None
    assert found.refinement is not None
    error = np.abs(found.modes.frequency_hz - TRUTH.modes().frequency_hz)
    assert np.all(error < 4.5 * found.modes.frequency_std)


def test_forces_that_were_not_measured_are_asked_for_in_one_line():
    with pytest.raises(RecordingError, match="no measured inputs; maximum likelihood needs them"):
        identify(ambient(3000, 0), refine=True)


def test_missing_samples_are_refused_in_one_line():
    recording = shaken(n=300)
    y = np.array(recording.records[0].outputs)
    y[0, 7] = np.nan
    broken = replace(recording, records=(Record("random", recording.records[0].inputs, y),))
    with pytest.raises(RecordingError, match=r"acceleration_x2.*t = 0\.35 s"):
        identify(broken, refine=True)
