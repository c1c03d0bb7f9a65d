"""Simulated recordings against exact ones, through every kind of instrument."""

import math

import numpy as np
import pytest
import scipy.linalg
import scipy.signal

from lab.chain import Chain
from lab.excitation import FreeDecay, Pulse
from lab.stages import Delay, Dropout, Gain, Hum, Lag, LowPass, Noise, Resolution, Saturation
from tests.lab.oscillating import ONE, WHITE, lagged_response, one, relative, run
from tests.lab.structures import (
    held_response,
)


def test_shaker_with_a_lag():
    """The accelerometer reads with the force at the instant, not with its mean over the substep that begins."""
    tau = 0.08
    rig = one(Chain(actuators=(Lag("force", 1 / (2 * np.pi * tau)),)))
    recording = run(rig, WHITE, accuracy=1e-7)
    exact = lagged_response(recording, tau)
    error = relative(recording.records[0].outputs[[0, 2]], exact)
    assert error <= 1e-7
    assert (
        recording.attributes["simulation_error"] / 3 <= error <= 2 * recording.attributes["simulation_error"]
    )


def test_instruments_with_a_memory_do_not_cost_their_accuracy():
    """Straight lines between substeps err by h², which extrapolation cancels: ten digits from a few substeps."""
    tau = 0.08
    rig = one(Chain(actuators=(Lag("force", 1 / (2 * np.pi * tau)),)))
    recording = run(rig, WHITE, accuracy=1e-10)
    assert relative(recording.records[0].outputs[[0, 2]], lagged_response(recording, tau)) <= 1e-10
    assert recording.attributes["simulation_substeps"] <= 40


def test_instruments_that_clip_are_still_followed():
    """A clipped force after a lag has kinks that cancel nothing; more substeps do."""
    rig = one(Chain(actuators=(Lag("force", 3.0), Saturation("force", 2.0))))
    recording = run(rig, WHITE, accuracy=1e-4)
    fine = run(rig, WHITE, accuracy=1e-5)
    assert relative(recording.records[0].outputs, fine.records[0].outputs) <= 1.1e-4
    assert recording.attributes["simulation_error"] <= 1e-4


def test_recorded_force_is_the_command_or_what_a_load_cell_saw():
    tau = 0.08
    actuators = (Lag("force", 1 / (2 * np.pi * tau)), Gain("force", -0.25))
    for measured in (False, True):
        recording = run(one(Chain(actuators=actuators, force_measured=measured)), Pulse(4.0), accuracy=1e-5)
        u = recording.records[0].inputs[0]
        if not measured:
            np.testing.assert_array_equal(u, [4.0, *[0.0] * 199])
            continue
        # Mean over each sample of 0.75 · 4 (1 - exp(-t / τ)), and of what is left of it later.
        dt, decay = 0.05, math.exp(-0.05 / tau)
        first = 3.0 * (1 - tau / dt * (1 - decay))
        later = 3.0 * (1 - decay) * tau / dt * (1 - decay) * decay ** np.arange(199)
        np.testing.assert_allclose(u, [first, *later], rtol=1e-10)


@pytest.mark.parametrize("delay", [0.05, 0.15, 0.02, 0.0137])
def test_shaker_with_a_delay(delay):
    """A delayed held force is the sum of two held forces: exact by splitting each sample where the force changes."""
    recording = run(one(Chain(actuators=(Delay("force", delay),))), WHITE, accuracy=1e-5)
    u = recording.records[0].inputs[0]
    whole = math.floor(delay / 0.05 + 1e-9)
    part = delay - 0.05 * whole
    late = np.concatenate([np.zeros(whole), u])
    F = np.array([[0, 1, 0], [-25, -0.2, 0.5], [0, 0, 0]])
    before, after = scipy.linalg.expm(F * part), scipy.linalg.expm(F * (0.05 - part))
    state, exact = np.zeros(2), []
    for k in range(u.size):
        acting = late[k] if part < 1e-9 else (late[k - 1] if k else 0.0)
        exact.append([*state, F[1] @ np.append(state, acting)])
        middle = (before @ np.append(state, acting))[:2]
        state = (after @ np.append(middle, late[k]))[:2]
    error = relative(recording.records[0].outputs, np.array(exact).T)
    assert error <= max(1e-5, 2 * recording.attributes["simulation_error"])


def filtered_response(recording, A, B, C, row):
    """One output of the one mass through an analog filter ẋ = A x + B y, exact for held forces."""
    u, dt, n = np.asarray(recording.records[0].inputs)[0], recording.dt, len(A)
    readings = np.array([[1, 0, 0], [0, 1, 0], [-25, -0.2, 0.5]])[row]  # of x, v, u
    F = np.zeros((n + 3, n + 3))  # x, v, u, filter
    F[0, 1] = 1
    F[1, :3] = [-25, -0.2, 0.5]
    F[3:, :3], F[3:, 3:] = np.outer(B, readings), A
    step, state, y = scipy.linalg.expm(F * dt), np.zeros(n + 3), []
    for value in u:
        state[2] = value
        y.append(C @ state[3:])
        state = step @ state
    return np.array(y)


@pytest.mark.parametrize("row", [0, 1, 2], ids=["position", "velocity", "acceleration"])
@pytest.mark.parametrize("drive", [Pulse(), WHITE], ids=["pulse", "random"])
def test_sensors_with_a_lag(row, drive):
    """Accelerations jump with the force; a filter that took them for continuous would be a sample late."""
    channel, tau = ("pos", "vel", "acc.x")[row], 0.03
    recording = run(one(Chain(sensors=(Lag(channel, 1 / (2 * np.pi * tau)),))), drive, accuracy=1e-6)
    exact = filtered_response(recording, np.array([[-1 / tau]]), np.array([1 / tau]), np.array([1.0]), row)
    error = relative(recording.records[0].outputs[[row]], exact[None])
    assert error <= 1e-6
    others = np.delete(recording.records[0].outputs, row, axis=0)
    ideal = np.delete(
        held_response(ONE, recording.outputs, recording.dt, np.asarray(recording.records[0].inputs)), row, 0
    )
    assert relative(others, ideal) <= 1e-6


def test_lagging_sensors_before_a_release():
    """Held still where it starts: a position has been there all the time, velocity and acceleration begin with the release."""
    tau, dt, x0, v0 = 0.08, 0.05, 0.3, -0.7
    sensors = tuple(Lag(channel, 1 / (2 * np.pi * tau)) for channel in ("pos", "vel", "acc.x"))
    recording = run(one(Chain(sensors=sensors)), FreeDecay({"x": x0}, {"x": v0}), accuracy=1e-7)
    F = np.zeros((5, 5))  # x, v and the filters of x, v, a
    F[0, 1], F[1, :2] = 1, [-25, -0.2]
    F[2, [0, 2]], F[3, [1, 3]] = [1 / tau, -1 / tau], [1 / tau, -1 / tau]
    F[4, [0, 1, 4]] = [-25 / tau, -0.2 / tau, -1 / tau]
    state, step, exact = np.array([x0, v0, x0, 0, 0]), scipy.linalg.expm(F * dt), []
    for _ in range(200):
        exact.append(state[2:])
        state = step @ state
    assert relative(recording.records[0].outputs, np.array(exact).T) <= 1e-7


def test_anti_alias_filter():
    corner, order = 8.0, 6
    recording = run(one(Chain(sensors=(LowPass("acc.x", corner, order),))), WHITE, accuracy=1e-6)
    b, a = scipy.signal.butter(order, 2 * np.pi * corner, analog=True)
    A, B, C, _ = scipy.signal.tf2ss(b, a)
    exact = filtered_response(recording, A, B[:, 0], C[0], 2)
    assert relative(recording.records[0].outputs[[2]], exact[None]) <= 1e-6


@pytest.mark.parametrize("delay", [0.05, 0.1, 0.0325])
def test_sensors_with_a_delay(delay):
    """Reading k is that of t_k - delay: exact by stepping to that instant from the sample before it."""
    stages = tuple(Delay(channel, delay) for channel in ("pos", "vel", "acc.x"))
    recording = run(one(Chain(sensors=stages)), WHITE, accuracy=1e-5)
    u, F = recording.records[0].inputs[0], np.array([[0, 1, 0], [-25, -0.2, 0.5], [0, 0, 0]])
    back = math.ceil(delay / 0.05 - 1e-9)
    part, step = scipy.linalg.expm(F * (0.05 * back - delay)), scipy.linalg.expm(F * 0.05)
    state, exact = np.zeros(3), np.zeros((3, u.size))
    for k in range(u.size - back):
        state[2] = u[k]
        there = part @ state
        exact[:, k + back] = [there[0], there[1], F[1] @ there]
        state = step @ state
    error = relative(recording.records[0].outputs, exact)
    assert error <= max(1e-5, 2 * recording.attributes["simulation_error"])


def test_stages_without_memory_act_on_the_exact_response():
    sensors = (Gain("pos", 0.1), Saturation("vel", 0.2), Hum("acc.x", 3.0, 0.5, 0.1))
    recording = run(one(Chain(sensors=sensors)), WHITE)
    exact = held_response(ONE, recording.outputs, 0.05, np.asarray(recording.records[0].inputs))
    t = np.arange(200) * 0.05
    expected = [
        1.1 * exact[0],
        np.clip(exact[1], -0.2, 0.2),
        exact[2] + 0.5 * np.sin(2 * np.pi * 3 * t + 0.1),
    ]
    assert np.any(np.abs(exact[1]) > 0.2)
    assert relative(recording.records[0].outputs, np.array(expected)) <= 2e-9


def test_clipped_shaker_still_gives_nine_digits():
    """Clipping a held force leaves a held force: no kink in time."""
    recording = run(one(Chain(actuators=(Saturation("force", 1.0),))), WHITE)
    clipped = np.clip(recording.records[0].inputs, -1, 1)
    assert (
        relative(recording.records[0].outputs, held_response(ONE, recording.outputs, 0.05, clipped)) <= 1e-9
    )


def test_noise_in_percent_of_each_channel():
    rig = one(Chain(acquisition=(Noise("*", percent=5.0),)))
    clean = run(one(), WHITE, duration=400.0, accuracy=1e-4)
    noisy = run(rig, WHITE, duration=400.0, accuracy=1e-4)
    added = noisy.records[0].outputs - clean.records[0].outputs
    share = np.std(added, axis=1) / np.sqrt(np.mean(clean.records[0].outputs ** 2, axis=1))
    # 8000 samples: the standard deviation scatters by 0.8 %; four of that.
    np.testing.assert_allclose(share, 0.05, rtol=0.032)
    assert np.max(np.abs(np.corrcoef(added) - np.eye(3))) < 4 / math.sqrt(8000)
    np.testing.assert_array_equal(noisy.records[0].inputs, clean.records[0].inputs)


def test_noise_of_force_sensors_is_on_the_recorded_input_only():
    rig = one(Chain(force_sensors=(Noise("force", std=0.3),), force_measured=True))
    clean, noisy = (run(r, WHITE, duration=400.0, accuracy=1e-4).records[0] for r in (one(), rig))
    np.testing.assert_array_equal(noisy.outputs, clean.outputs)
    assert np.std(noisy.inputs - clean.inputs) == pytest.approx(0.3, rel=0.032)


def test_dropouts_and_resolution():
    rig = one(Chain(acquisition=(Resolution("pos", 0.01), Dropout("vel", 0.1))))
    clean, real = (run(r, WHITE, duration=100.0, accuracy=1e-4).records[0] for r in (one(), rig))
    np.testing.assert_allclose(real.outputs[0] / 0.01, np.round(clean.outputs[0] / 0.01), atol=1e-9)
    lost = np.isnan(real.outputs[1])
    assert 0.05 < np.mean(lost) < 0.15
    np.testing.assert_array_equal(real.outputs[1][~lost], clean.outputs[1][~lost])
    assert not np.isnan(real.outputs[[0, 2]]).any()


def test_swapped_cables():
    """Channels carry each other's signal; what follows the cables stays with the channel."""
    acquisition = (Gain("pos", 1.0),)
    rig = one(Chain(swaps=(("pos", "vel"),), acquisition=acquisition))
    ideal, real = (run(r, WHITE, accuracy=1e-9).records[0].outputs for r in (one(), rig))
    np.testing.assert_array_equal(real, [2 * ideal[1], ideal[0], ideal[2]])


def test_noise_in_percent_follows_the_signal_that_the_cable_carries():
    rig = one(Chain(swaps=(("pos", "vel"),)))
    noisy = rig.with_chain(rig.chain.adding("acquisition", Noise("pos", percent=5.0)))
    clean, real = (run(r, WHITE, duration=400.0, accuracy=1e-4).records[0].outputs[0] for r in (rig, noisy))
    # 8000 samples: 0.8 % of scatter. Position and velocity differ by a factor of about five.
    assert np.std(real - clean) == pytest.approx(0.05 * np.sqrt(np.mean(clean**2)), rel=0.032)


def test_disturbances_push_without_being_recorded():
    rig = one(Chain(disturbances=(Hum("x", 1.5, 2.0, 0.3),)))
    recording = run(rig, WHITE)
    tone = 2.0 * np.sin(2 * np.pi * 1.5 * np.arange(200) * 0.05 + 0.3)
    exact = held_response(ONE, recording.outputs, 0.05, recording.records[0].inputs + tone)
    assert relative(recording.records[0].outputs, exact) <= 1e-9
    np.testing.assert_array_equal(recording.records[0].inputs, run(one(), WHITE).records[0].inputs)
