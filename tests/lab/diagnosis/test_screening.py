"""Screening ranks causes, also where calibration has gone far to make up for one."""

from dataclasses import replace

import numpy as np
import pytest

from identification.recording import Record, Recording
from lab.diagnosis.calibrate import parameters_of
from lab.diagnosis.misfit import Misfit
from lab.diagnosis.parameters import Parameters
from lab.diagnosis.screening import SCREEN_SAMPLES, Screened, Screening, coarsely, enough_samples
from lab.forces import CUBIC
from lab.rig import Rig
from lab.twin import twin

XML = "models/chain3_coupled.xml"


@pytest.fixture
def misfit():
    rig = Rig.load(XML).connected(inputs=["force1"], outputs=["acc1.x"])
    u, y = np.zeros((1, 21)), np.zeros((1, 21))
    records = (Record("random", u, y), Record("free_decay", u[:, :10], y[:, :10]))
    known = Recording(records, rig.inputs, rig.outputs, 5.0)
    model = twin(rig)
    return Misfit.of(known, model, parameters_of(model), share=1.0)


def test_substeps_are_few_where_no_law_is_present(misfit):
    theta = np.zeros(misfit.parameters.n)
    assert coarsely(misfit, theta, ()).substeps < misfit.substeps
    plant = misfit.twin.plant.with_law(CUBIC, np.eye(3)[0], 1.0, 0.0)
    bent = replace(misfit, twin=replace(misfit.twin, plant=plant))
    assert coarsely(bent, theta, ()).substeps == misfit.substeps


def test_samples_are_few_unless_the_head_of_a_record_is_quiet(misfit):
    n = 2 * SCREEN_SAMPLES
    even = np.random.default_rng(0).standard_normal((1, n))
    late = even * (np.arange(n) > SCREEN_SAMPLES + 100)
    quiet = even * np.where(np.arange(n) > SCREEN_SAMPLES, 1.0, 0.1)
    gaps = np.where(np.arange(n) % 3, even, np.nan)
    signals = (even, late, quiet, gaps, even[:, :10])
    records = tuple((np.zeros((1, y.shape[1])), y) for y in signals)
    several = replace(misfit, records=records, n_train=tuple(y.shape[1] for y in signals))
    assert enough_samples(several) == (SCREEN_SAMPLES, n, n, SCREEN_SAMPLES, 10)
    assert enough_samples(several, 0.5) == (SCREEN_SAMPLES // 2, n, n, SCREEN_SAMPLES // 2, 10)


def row(score):
    return Screened(None, np.zeros(1), score)


def test_scores_of_two_starts_are_counted_from_one_base():
    far = Screening([row(5.0), row(-1.0)], np.array([2.0]), base=100.0)
    # From a start that is worse by 900, a gain of 1000 ends 100 lower than the other start.
    nominal = Screening([row(1000.0), row(800.0)], np.array([9.0]), base=1000.0)
    both = far.beside(nominal)
    assert [each.score for each in both.rows] == pytest.approx([100.0, 5.0, -1.0, -100.0], abs=1e-12)
    assert (both.base, both.lucky[0]) == (100.0, 2.0)


def test_nominal_keeps_what_has_no_prior():
    parameters = Parameters(("mass a", "mass b", "mass c"), np.full(3, 0.01), 3, 0, np.eye(3))
    theta = np.array([3.0, -2.0, 7.0])
    assert parameters.nominal(theta) == pytest.approx([0, 0, 0], abs=1e-12)
    one = parameters.lifted(np.array([0.0, 0.0, 1.0]))
    assert one.nominal(theta) == pytest.approx([0, 0, 7], abs=1e-12)
    together = parameters.lifted(np.array([1.0, 1.0, 0.0]))
    assert together.nominal(theta) == pytest.approx([0.5, 0.5, 0], abs=1e-12)
    assert replace(parameters, precision=1e-6 * np.eye(3)).nominal(theta) == pytest.approx(theta, rel=1e-12)
