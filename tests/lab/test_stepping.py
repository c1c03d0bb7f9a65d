"""Time steps: aligned with their readings, of the order that theory promises, alike on any number of threads."""

import os
import runpy
import xml.etree.ElementTree as ET

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from lab import stepping
from lab.errors import DivergedError
from lab.instruments import instrument
from lab.rig import Rig
from lab.stepping import Plan, Stepper
from tests.lab.structures import LINEAR, MODELS, chain_xml, held_response, model, moving, oscillator

THREE = chain_xml([1.0, 2.0, 0.5], [(50.0, 0.3)] * 3, {(0, 1): (20.0, 0.1), (1, 2): (30.0, 0.2)})


def stepper(rig, dt, substeps, n_batch=1, *, position=None, velocity=None):
    still = np.zeros((n_batch, len(rig.dofs)))
    position, velocity = (still if x is None else np.asarray(x, float) for x in (position, velocity))
    return Stepper(rig, dt, substeps, position, velocity, 1e3)


def random_controls(rig, n_batch, n, seed=0):
    return np.random.default_rng(seed).standard_normal((n_batch, len(rig.inputs), n))


def with_velocities(root):
    """Adds a velocity sensor on every joint."""
    for joint in root.iter("joint"):
        if joint.get("name"):
            ET.SubElement(
                root.find("sensor"), "jointvel", name=f"speed_{joint.get('name')}", joint=joint.get("name")
            )


@pytest.mark.parametrize("substeps", [1, 3])
@pytest.mark.parametrize("name", LINEAR)
def test_readings_belong_to_the_force_of_the_same_instant(name, substeps):
    """y_k = C x_k + D u_k: M a + C v + K q = f holds among the readings of one instant, however coarse the steps."""
    rate, structure = LINEAR[name]
    rig = model(name).edited(with_velocities)
    n = len(rig.dofs)
    force = np.random.default_rng(1).standard_normal((1, n, 50 * substeps))
    readings, positions = stepper(rig, 0.2 / rate, substeps).advance(np.zeros_like(force), force)
    v = readings[0, [rig.row_of(f"speed_{dof}") for dof in rig.dofs]]
    a = np.linalg.solve(structure.mass, force[0] - structure.damping @ v - structure.stiffness @ positions[0])
    accelerometers = [c for c in rig.outputs if c.quantity == "acceleration" and c.dof]
    assert len(accelerometers) == n
    for channel in accelerometers:
        expected = a[rig.dofs.index(channel.dof)]
        np.testing.assert_allclose(
            readings[0, rig.row_of(channel.name)], expected, atol=1e-12 * np.max(np.abs(expected))
        )


@pytest.mark.parametrize("name", LINEAR)
def test_controls_and_forces_act_on_their_own_degree_of_freedom(name):
    """A control of unit gain is a force on its joint: both ways give the same bits."""
    rig = model(name)
    u = random_controls(rig, 1, 40)
    by_control = stepper(rig, 0.01, 1).advance(u, None)
    by_force = stepper(rig, 0.01, 1).advance(np.zeros_like(u), u)
    for a, b in zip(by_control, by_force, strict=True):
        np.testing.assert_array_equal(a, b)


def errors_of(name, counts, *, n=60):
    """Errors of accelerations for several substeps, and of the combination of the finest three."""
    rate, structure = LINEAR[name]
    rig = moving(name)
    u = random_controls(rig, 1, n)
    exact = held_response(structure, rig.outputs, 1 / rate, u[0])
    rows = [rig.row_of(c.name) for c in rig.outputs]
    largest = np.max(np.abs(exact), axis=1, keepdims=True)
    found = {}
    for count in counts:
        readings, _ = stepper(rig, 1 / rate, count).advance(np.repeat(u, count, axis=2), None)
        found[count] = readings[0, rows, ::count]
    plain = [np.max(np.abs(found[count] - exact) / largest) for count in counts]
    plans = [Plan(count, (4, 5)) for count in counts if count // 4 in counts]
    combined = [
        np.max(np.abs(plan.combined([found[c] for c in plan.runs]) - exact) / largest) for plan in plans
    ]
    return np.array(plain), np.array(combined)


@pytest.mark.parametrize(("name", "first"), [("chain3_coupled", 1), ("chain7", 8), ("truss", 2)])
def test_orders_of_convergence(name, first):
    """Halving the substep divides the error by 2⁴, and by 2⁶ after extrapolation."""
    plain, combined = errors_of(name, [first * 2**k for k in range(6)])
    rates = np.log2(plain[1:-1] / plain[2:])
    # The next term of the error series is left, of relative size ω h: a few per cent in the order.
    np.testing.assert_allclose(rates[1:], 4.0, atol=0.15)
    np.testing.assert_allclose(np.log2(combined[0] / combined[1]), 6.0, atol=0.4)


@given(
    st.floats(-10, 10),
    st.lists(st.floats(-10, 10), min_size=2, max_size=2),
    st.sampled_from([4, 12, 64]),
)
def test_extrapolation_cancels_the_fourth_and_fifth_order(limit, coefficients, substeps):
    plan = Plan(substeps, (4, 5))
    assert plan.runs == (substeps, substeps // 2, substeps // 4)
    values = [
        np.array([limit + sum(c * (4 / s) ** p for c, p in zip(coefficients, (4, 5), strict=True))])
        for s in plan.runs
    ]
    # Rounding of values up to 30.
    np.testing.assert_allclose(plan.combined(values), [limit], atol=1e-13)


def test_plain_plan_runs_once():
    plan = Plan(6)
    assert plan.runs == (6,)
    assert plan.combined([np.arange(3)]) is not None
    assert stepping.doubled(plan) == Plan(12)


# Plans.


def test_highest_frequency_and_settling_time_of_one_mass():
    rig = Rig.from_xml(oscillator(mass=2.0, stiffness=50.0, damping=0.4))
    assert stepping.highest_frequency(rig) == pytest.approx(5.0, rel=1e-14)
    # Re λ = -c / 2 m.
    assert stepping.settling_time(rig) == pytest.approx(10.0, rel=1e-12)
    assert stepping.settling_time(Rig.from_xml(oscillator(stiffness=0.0, damping=0.0))) == 0.0


@pytest.mark.parametrize("accuracy", [1e-3, 1e-6, 1e-9, 1e-12])
def test_first_guess_is_stable_and_near(accuracy):
    for name, (rate, _) in LINEAR.items():
        plan = stepping.first_guess(model(name), 1 / rate, accuracy, 60.0)
        phase = stepping.highest_frequency(model(name)) / rate / plan.runs[-1]
        # RK4 is stable up to ω h = 2.78 on the imaginary axis.
        assert phase < 2.7
        assert all(count >= 1 for count in plan.runs)


def test_a_loose_accuracy_asks_for_no_more_runs_than_one():
    rig = instrument(model("truss"), acquisition={"anti_alias": 0.3}, sample_rate=50.0)
    loose, tight = (stepping.first_guess(rig, 0.02, accuracy, 60.0) for accuracy in (1e-2, 1e-6))
    # Three runs to extrapolate from would have to be stable and in phase, which is finer than 1e-2 asks for.
    assert loose.runs == (loose.substeps,)
    assert loose.substeps < tight.substeps / 2


@given(st.floats(1e-4, 0.3), st.integers(1, 60))
def test_delays_come_close_to_whole_substeps(delay, substeps):
    dt = 0.05
    plan = stepping.aligned(Plan(substeps), dt, [delay])
    assert substeps <= plan.substeps < 2 * substeps + 16

    def away(count):
        return abs(delay * count / dt - round(delay * count / dt))

    assert away(plan.substeps) <= min(away(count) for count in range(substeps, 2 * substeps + 16)) + 1e-9


def test_without_delays_a_plan_stays():
    assert stepping.aligned(Plan(7, (4, 5)), 0.1, []) == Plan(7, (4, 5))


# Batches.


def advance_all(rig, substeps, n_batch, n=30):
    u = np.repeat(random_controls(rig, n_batch, n), substeps, axis=2)
    run = stepper(rig, 0.02, substeps, n_batch)
    return run.advance(u, None)


@pytest.mark.parametrize("threads", [1, 2, 3, 16])
def test_results_do_not_depend_on_the_number_of_threads(threads, monkeypatch):
    rig = Rig.from_xml(THREE)
    expected = advance_all(rig, 3, 7)
    monkeypatch.setattr(os, "cpu_count", lambda: threads)
    for a, b in zip(advance_all(rig, 3, 7), expected, strict=True):
        np.testing.assert_array_equal(a, b)


def test_a_copy_does_not_know_of_the_others():
    rig = Rig.from_xml(THREE)
    together, _ = advance_all(rig, 2, 5)
    u = np.repeat(random_controls(rig, 5, 30), 2, axis=2)
    for number in range(5):
        alone, _ = stepper(rig, 0.02, 2).advance(u[number : number + 1], None)
        np.testing.assert_array_equal(alone[0], together[number])


STICKY = oscillator(damping=0.0).replace('damping="0.0"', 'frictionloss="0.3"')


@pytest.mark.parametrize("xml", [THREE, STICKY], ids=["linear", "dry friction"])
@pytest.mark.parametrize("cut", [1, 7, 29])
def test_chunks_give_the_same_bits(xml, cut):
    """Also where a solver iterates, from nothing but the state."""
    rig = Rig.from_xml(xml)
    u = 3 * random_controls(rig, 3, 30)
    whole, positions = stepper(rig, 0.02, 1, 3).advance(u, None)
    run = stepper(rig, 0.02, 1, 3)
    first, second = run.advance(u[..., :cut], None), run.advance(u[..., cut:], None)
    np.testing.assert_array_equal(np.concatenate([first[0], second[0]], axis=2), whole)
    np.testing.assert_array_equal(np.concatenate([first[1], second[1]], axis=2), positions)


@pytest.mark.parametrize("xml", [STICKY], ids=["dry friction"])
def test_solver_results_do_not_depend_on_threads(xml, monkeypatch):
    rig = Rig.from_xml(xml)
    expected = advance_all(rig, 2, 6)
    monkeypatch.setattr(os, "cpu_count", lambda: 1)
    for a, b in zip(advance_all(rig, 2, 6), expected, strict=True):
        np.testing.assert_array_equal(a, b)


def test_copies_start_where_they_are_put():
    rig = Rig.from_xml(THREE)
    position, velocity = np.eye(3)[:2], -np.eye(3)[1:]
    readings, positions = stepper(rig, 0.01, 1, 2, position=position, velocity=velocity).advance(
        np.zeros((2, 3, 1)), None
    )
    np.testing.assert_array_equal(positions[:, :, 0], position)
    speed = [rig.row_of(f"vel{i}") for i in range(3)]
    np.testing.assert_array_equal(readings[:, speed, 0], velocity)


# Rest.


def test_instruments_read_zero_at_rest_in_gravity():
    hanging = oscillator().replace('gravity="0 0 0"', 'gravity="9.81 0 -2"')
    rig = Rig.from_xml(hanging)
    assert stepping.readings_at_rest(rig)[rig.row_of("pos")] == pytest.approx(2 * 9.81 / 50)
    # An accelerometer at rest reads minus gravity.
    np.testing.assert_allclose(stepping.readings_at_rest(rig)[-3:], [-9.81, 0, 2], atol=1e-12)
    readings, positions = stepper(rig, 0.01, 1).advance(np.zeros((1, 1, 100)), None)
    # Equilibrium is found to 1e-13 of the load.
    assert np.max(np.abs(readings)) < 1e-11
    assert np.max(np.abs(positions)) < 1e-12


def test_the_model_is_left_alone():
    rig = Rig.from_xml(oscillator())
    before = (rig.model.opt.timestep, rig.model.opt.integrator, rig.model.opt.disableflags)
    stepper(rig, 0.123, 3).advance(np.zeros((1, 1, 3)), None)
    assert (rig.model.opt.timestep, rig.model.opt.integrator, rig.model.opt.disableflags) == before


# Divergence.


def in_stretches(run, count):
    for _ in range(count):
        run.advance(np.zeros((1, 2, 100)), None)


def test_divergence_names_time_and_degree_of_freedom_and_leaves_no_log(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    rig = Rig.from_xml(chain_xml([1.0, 1.0], [(10.0, 0.1), (-40.0, 0.0)], {}))
    run = stepper(rig, 0.01, 1, velocity=[[0.0, 1e-3]])
    # The time is that of the record, whichever stretch it is in.
    with pytest.raises(
        DivergedError, match=r"'chain' diverged near t = .* at degree of freedom 'q1'"
    ) as caught:
        in_stretches(run, 20)
    # The acceleration 40 q, with q = 1e-3 sinh(√40 t) / √40, passes MuJoCo's limit of 1e10 at about 5 s.
    time = float(str(caught.value).split("t = ")[1].split(" s")[0])
    expected = np.arcsinh(1e10 / 40 * np.sqrt(40) / 1e-3) / np.sqrt(40)
    assert time == pytest.approx(expected, abs=0.1)
    assert list(tmp_path.iterdir()) == []


def test_divergence_is_noticed_where_mujoco_does_not_reset():
    unstable = chain_xml([1.0], [(-40.0, 0.0)], {}).replace(
        'contact="disable"', 'contact="disable" autoreset="disable"'
    )
    run = stepper(Rig.from_xml(unstable), 0.1, 1, velocity=[[1.0]])
    with pytest.raises(DivergedError, match="diverged near"):
        run.advance(np.zeros((1, 1, 3000)), None)


# The benchmark.


def test_the_benchmark_prints_errors_and_costs(capsys):
    path = MODELS.parent / "benchmarks" / "simulation.py"
    tiny = [
        "--models",
        "chain3_coupled",
        "--samples",
        "40",
        "--substeps",
        "4",
        "--steps",
        "50",
        "--repeats",
        "1",
    ]
    runpy.run_path(str(path))["main"](tiny)
    rows = [
        line.split() for line in capsys.readouterr().out.splitlines() if line.startswith("chain3_coupled")
    ]
    *errors, costs = rows
    assert [int(row[1]) for row in errors] == [1, 2, 4, 8]
    plain = np.array([float(row[3]) for row in errors])
    # Printed with two digits.
    np.testing.assert_allclose(plain[:-1] / plain[1:], 16, rtol=0.15)
    assert [len(row) for row in errors] == [4, 4, 5, 5]
    assert all(float(value) > 0 for value in costs[1:])
    assert len(costs) == 8
