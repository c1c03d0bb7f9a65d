"""The kernel: the same compiled and plain, of second order, and honest where the motion diverges."""

from dataclasses import replace

import numpy as np
import pytest
import scipy.linalg
import scipy.signal

from lab import forces, kernel
from lab.paths import recorded
from lab.responder import ready
from lab.twin import twin
from tests.lab.effects.cases import CASES
from tests.lab.effects.reference import DT, EYE, SPRING, local, nominal, system
from tests.lab.effects.reference import forces as pushed

LAWS = {
    "cubic": (forces.CUBIC, (4000.0, 10.0)),
    "quadratic": (forces.QUADRATIC, (1.5, 0.2)),
    "bilinear": (forces.BILINEAR, (24.0,)),
    "deadband": (forces.DEADBAND, (0.01, 60.0)),
    "stop": (forces.STOP, (0.02, 200.0, 1.0)),
    "dry friction": (forces.COULOMB, (0.5, 0.0)),
    "rounded friction": (forces.COULOMB, (0.5, 0.02)),
    "Bouc-Wen": (forces.BOUC_WEN, (30.0, 0.04)),
    "drift": (forces.DRIFT, (-30.0,)),
}


def pushes(n=120, seed=0):
    return np.random.default_rng(seed).standard_normal((2, n))


def with_laws(*names, row=SPRING):
    found = twin(nominal()).plant
    for name in names:
        kind, parameters = LAWS[name]
        found = found.with_law(kind, row, *parameters)
    return found


def error(found, truth):
    return np.max(np.max(np.abs(found - truth), axis=1) / np.max(np.abs(truth), axis=1))


@pytest.mark.parametrize("names", [(), *((name,) for name in LAWS), ("cubic", "dry friction", "Bouc-Wen")])
def test_compiled_is_plain(names, monkeypatch):
    late = {"delay": 0.4 * DT}
    plant = with_laws(*names).with_output(0, **late).with_output(3, **late).with_input(1, **late)
    responder, u = ready(plant, DT, substeps=4), pushes(25)
    rng = np.random.default_rng(1)
    start = 0.1 * rng.standard_normal(6)
    pulled = {"observer": 1e-3 * rng.standard_normal((6, 5)), "measured": rng.standard_normal((5, 25))}
    compiled, followed = responder.outputs(u, 25, initial=start), responder.outputs(u, 25, **pulled)
    for function in (
        "force",
        "_dry",
        "_rounded",
        "_stick",
        "_yielding",
        "_in_fours",
        "_product",
        "_over_a_sample",
        "respond",
    ):
        monkeypatch.setattr(kernel, function, getattr(kernel, function).py_func)
    # The compiler may join a product and a sum, and take sums in another order: both change the rounding only.
    assert error(responder.outputs(u, 25, initial=start), compiled) < 1e-11
    assert error(responder.outputs(u, 25, **pulled), followed) < 1e-11


@pytest.mark.parametrize("z", [-0.9, -0.2, 0.0, 0.7])
@pytest.mark.parametrize("dx", [-0.1, -0.01, 0.0, 0.02, 0.3])
def test_a_memory_pulled_along_yields_as_its_equation_says(z, dx):
    stiffness, reach, steps = 30.0, 0.04, 100_000
    force, step = z * stiffness * reach, dx / 100_000
    for _ in range(steps):
        # Wen (1976) with exponent 1: dz = A dx - (|dx| z + dx |z|) / (2 x_y).
        force += stiffness * step - (abs(step) * force + step * abs(force)) / (2 * reach)
    p = np.array([stiffness, reach, 0.0])
    for yielding in (kernel._yielding, kernel._yielding.py_func):
        # Euler's steps err by half a step of the exponential: 0.3 / 0.04 / 2 / 100 000.
        assert yielding(p, z * stiffness * reach, dx) == pytest.approx(force, abs=1e-4 * stiffness * reach)


def test_a_memory_that_never_yields_is_a_spring_where_measurements_pull_the_state():
    u, y = pushes(300), np.random.default_rng(1).standard_normal((5, 300))
    gain, stiff = 1e-2 * np.random.default_rng(2).standard_normal((6, 5)), 30.0
    bare = with_laws()
    remembering = bare.with_law(forces.BOUC_WEN, SPRING, stiff, 1e9)
    stiffened = replace(bare, stiffness=bare.stiffness + stiff * np.outer(SPRING, SPRING))
    found = [
        ready(each, DT, substeps=32).outputs(u, 300, observer=gain, measured=y)
        for each in (remembering, stiffened)
    ]
    # The force of a law is a straight line over each substep: an error of second order, 2e-4 with 32 of them here.
    assert error(*found) < 1e-3


def test_a_lag_is_the_digital_filter():
    signal = np.random.default_rng(3).standard_normal(500)
    filtered = scipy.signal.lfilter([0.2], [1, -0.8], signal)
    for lagged in (kernel.lagged, kernel.lagged.py_func):
        assert lagged(signal, 0.2) == pytest.approx(filtered, abs=1e-13)


def test_every_law_is_tried():
    assert {kind for kind, _ in LAWS.values()} == set(range(8))


@pytest.mark.parametrize("name", [name for name, case in CASES.items() if case.order and case.twin > 1e-9])
def test_second_order_in_the_substep(name):
    found, u = twin(CASES[name].effect.apply(nominal())).plant, pushes(80)
    truth = CASES[name].reference(u)
    coarse, fine = (error(ready(found, DT, substeps=n).outputs(u, 80), truth) for n in (4, 32))
    # Kinks fall anywhere within a substep, so that the observed order scatters about 2.
    assert np.log(coarse / fine) / np.log(8) > 1.5


def test_rounded_friction():
    u = pushes(60)
    truth = local(u, lambda s, x, v, z: (0.5 * np.tanh(v / 0.02), 0.0), row=EYE[1])
    found = ready(with_laws("rounded friction", row=EYE[1]), DT, substeps=96).outputs(u, 60)
    # Second order with a slope of 25 N s/m inside the layer: (25 / 2 kg · dt / 96)² = 4e-5, times a few turns.
    assert error(found, truth) < 1e-3


def test_laws_add_up():
    u = pushes(80)

    def both(s, x, v, z):
        return 4000 * x**3 + 10 * x**2 + 1.5 * abs(v) * v + 0.2 * v**3, 0.0

    found = ready(with_laws("cubic", "quadratic"), DT, substeps=48).outputs(u, 80)
    assert error(found, local(u, both)) < 1e-4


def test_a_stuck_mass_stands_still():
    # Friction beyond every force holds: the outputs of that mass are zero, its acceleration too.
    held = twin(nominal()).plant.with_law(forces.COULOMB, EYE[1], 1e3, 0.0)
    u = pushes()
    y = ready(held, DT).outputs(u, u.shape[1])
    assert np.max(np.abs(y[[1, 3]])) < 1e-12 * np.max(np.abs(y))
    assert np.max(np.abs(y[0])) > 0.1


@pytest.mark.parametrize("late", [0.0, 0.37 * DT])
def test_divergence_is_marked_from_where_it_happens(late):
    runaway = twin(nominal()).plant.with_law(forces.CUBIC, SPRING, -1e9, 0.0).with_output(0, delay=late)
    y = ready(runaway, DT).outputs(pushes(), 120)
    lost = np.isnan(y).any(axis=0)
    assert lost[-1]
    assert not lost[0]
    assert np.all(lost[np.argmax(lost) :])


def test_an_observer_believes_a_perfect_model():
    responder, u = ready(with_laws("cubic"), DT), pushes()
    y = responder.outputs(u, 120)
    gain = np.random.default_rng(1).standard_normal((6, 5)) * 1e-2
    again = responder.outputs(u, 120, observer=gain, measured=y)
    assert error(again, y) < 1e-11


def test_an_observer_is_the_plain_recursion():
    u, y = pushes(40), pushes(100).reshape(5, 40)
    start, gain = np.full(6, 0.1), 1e-2 * np.random.default_rng(1).standard_normal((6, 5))
    A, B, C, D = system()
    step = scipy.linalg.expm(np.block([[A, B], [np.zeros((3, 9))]]) * DT)[:6]
    x, expected = start.copy(), np.empty((5, 40))
    for k, f in enumerate(pushed(u).T):
        expected[:, k] = C @ x + D @ f
        x = step @ np.concatenate([x + gain @ (y[:, k] - expected[:, k]), f])
    found = ready(twin(nominal()).plant, DT).outputs(u, 40, initial=start, observer=gain, measured=y)
    assert error(found, expected) < 1e-12


@pytest.mark.parametrize(
    "names",
    [*((name,) for name in LAWS if "-" not in name and name != "dry friction"), ("cubic", "quadratic")],
)
def test_a_sample_is_its_substeps_one_after_the_other(names):
    substeps, n, late = 3, 40, {"delay": 0.4 * DT}
    plant = with_laws(*names).with_output(0, **late).with_output(3, **late).with_input(1, **late)
    responder, u, y = ready(plant, DT, substeps=substeps), pushes(n), pushes(100).reshape(5, n)
    F, G, P, Q, X, V, *_, at, C, D, E = responder.matrices
    assert set(at) == {0, 1}

    def forces_of(x, s):
        known = zip((LAWS[name] for name in names), X @ x, V @ x, strict=True)
        return np.array([kernel.force.py_func(law, (*p, 0.0), way, rate, s) for (law, p), way, rate in known])

    gain, start = 1e-2 * np.random.default_rng(1).standard_normal((6, 5)), np.full(6, 0.02)
    gain[:, at > 0] = 0.0
    x, expected = start, np.empty((n, 5))
    for k, held in enumerate(responder._driven(u)):
        g = forces_of(x, k / n)
        read = C @ x + D @ held + E @ g
        expected[k, at == 0] = read[at == 0]
        x = x + gain @ (y[:, k] - np.where(at == 0, read, 0.0))
        g = forces_of(x, k / n)
        for step in range(substeps):
            if step:
                expected[k, at == step] = (C @ x + D @ held + E @ g)[at == step]
            free, s = F @ x + G[step] @ held + P @ g, (k + (step + 1) / substeps) / n
            # Each round brings the forces that end the substep several times nearer.
            for _ in range(60):
                g = (
                    0.5 * (g + forces_of(free + Q @ g, s))
                    if "rounded friction" in names
                    else forces_of(free + Q @ g, s)
                )
            x = free + Q @ g
    expected = recorded(plant.output_paths, (), expected.T.copy(), DT)
    found = responder.outputs(u, n, initial=start, observer=gain, measured=y)
    assert error(found, expected) < 1e-10


@pytest.mark.parametrize(("stiffness", "reach"), [(3000.0, 1e-4), (3000.0, 1e-5), (30.0, 1e-5)])
def test_a_spring_that_yields_many_times_over_in_a_substep_is_solved_for(stiffness, reach):
    plant, u = with_laws().with_law(forces.BOUC_WEN, SPRING, stiffness, reach), 10 * pushes(200)
    coarse, fine = (ready(plant, DT, substeps=n).outputs(u, 200) for n in (3, 96))
    # Where each of its jumps falls within a substep is left open: that errs by less than the force does in all.
    assert error(coarse, fine) < error(ready(with_laws(), DT).outputs(u, 200), fine)


def test_missing_measurements_pull_nothing():
    responder, u = ready(twin(nominal()).plant, DT), pushes(40)
    start = np.full(6, 0.1)
    free = responder.outputs(u, 40, initial=start)
    nothing = responder.outputs(
        u, 40, initial=start, observer=np.ones((6, 5)), measured=np.full((5, 40), np.nan)
    )
    np.testing.assert_array_equal(nothing, free)
