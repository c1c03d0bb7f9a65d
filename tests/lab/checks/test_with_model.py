"""Channels out of place, found with a model whose masses and stiffnesses are 5 % off."""

import importlib
import itertools

import numpy as np
import pytest

import lab
from identification.recording import Channel, Record, Recording
from lab.checks.arrangement import balanced, best_arrangement, mean_mac
from lab.errors import UnknownNameError
from tests.lab.checks.rigs import changed, measured, mistakes


def told(recording, rig):
    return {(remark.check, remark.channel) for remark in lab.check(recording, rig)}


@pytest.mark.parametrize("kind", ["random", "ambient", "pulse", "free_decay"])
@pytest.mark.parametrize("seed", [0, pytest.param(3, marks=pytest.mark.slow)])
def test_mistakes_are_found_and_nothing_else(kind, seed):
    recording, rig = measured(kind, seed)
    for name, (made, expected) in mistakes(recording, np.random.default_rng(seed)).items():
        assert told(made, rig) == expected, name


def test_factors_are_told():
    recording, rig = measured("random", 1)
    factor = np.ones((len(recording.outputs), 1))
    factor[1] = 9.80665
    (remark,) = lab.check(changed(recording, outputs=factor), rig)
    # Shapes of a model 5 % off are themselves a tenth off.
    assert remark.evidence["factor"] == pytest.approx(9.80665, rel=0.15)
    assert "g for m/s^2" in remark.advice
    (remark,) = lab.check(changed(recording, inputs=1 / 4.4482), rig)
    assert remark.evidence["factor"] == pytest.approx(4.4482, rel=0.15)


def test_another_unit_than_the_models_is_told():
    recording, rig = measured("ambient", 0)
    outputs = tuple(Channel(c.name, "V" if k == 0 else c.unit) for k, c in enumerate(recording.outputs))
    made = Recording(recording.records, (), outputs, recording.sample_rate)
    assert told(made, rig) == {("units", outputs[0].name)}


def test_an_unknown_channel_is_an_error():
    recording, rig = measured("ambient", 0)
    outputs = (Channel("nobody", "m/s^2"), *recording.outputs[1:])
    with pytest.raises(UnknownNameError, match="'nobody', which model 'chain' lacks"):
        lab.check(Recording(recording.records, (), outputs, recording.sample_rate), rig)


def test_noise_shows_no_modes_and_says_so():
    recording, rig = measured("ambient", 0)
    rng = np.random.default_rng(0)
    record = Record("ambient", np.zeros((0, 4000)), rng.standard_normal((len(recording.outputs), 4000)))
    remarks = lab.check(Recording((record,), (), recording.outputs, 3.0), rig)
    assert {remark.check for remark in remarks} == {"fitting"}


def test_missing_samples_leave_the_other_checks_alone():
    recording, rig = measured("ambient", 0)
    y = np.array(recording.records[0].outputs)
    y[0, 100] = np.nan
    made = Recording((Record("ambient", np.zeros((0, y.shape[1])), y),), (), recording.outputs, 100.0)
    assert told(made, rig) == {("missing", recording.outputs[0].name), ("fitting", "")}


def test_the_best_arrangement_is_that_of_all_orders_and_signs():
    """Against trying all 4! orders and 2^4 signs, for shapes that hardly agree with anything."""
    rng = np.random.default_rng(1)
    for _ in range(5):
        phi, psi = rng.standard_normal((2, 4, 3))
        phi, psi = phi / np.linalg.norm(phi, axis=0), psi / np.linalg.norm(psi, axis=0)
        best = best_arrangement(phi, psi)

        def overlap(order, signs, phi=phi, psi=psi):
            return np.sum(np.abs(np.sum(phi[list(order)] * np.array(signs)[:, None] * psi, axis=0)))

        highest = max(
            overlap(order, signs)
            for order in itertools.permutations(range(4))
            for signs in itertools.product((1, -1), repeat=4)
        )
        assert overlap(best.order, best.signs) == pytest.approx(highest, rel=1e-12)


def test_balanced_shapes_hold_no_factors():
    rng = np.random.default_rng(2)
    shapes = rng.standard_normal((5, 3))
    scaled = shapes * rng.uniform(0.1, 10, (5, 1)) * rng.uniform(0.1, 10, 3)
    # 100 sweeps converge far beyond what the checks need.
    np.testing.assert_allclose(balanced(scaled), balanced(shapes), rtol=1e-6)
    assert mean_mac(balanced(scaled), balanced(shapes)) == pytest.approx(1.0, abs=1e-9)


def test_modules_of_the_checks_have_the_names_of_the_checks():
    from lab.checks import CHECKS

    for name, function in CHECKS.items():
        assert getattr(importlib.import_module(f"lab.checks.{name}"), name) is function
