"""One or more sizes for every cause, each with the response that its law promises, worked out without the library."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from math import pi

import numpy as np

from identification.recording import Array
from lab.effects import EFFECTS, Effect
from tests.lab.effects.reference import (
    DT,
    EYE,
    SPRING,
    C_d,
    K,
    M,
    finely,
    forces,
    held,
    linear,
    local,
    rubbing,
    system,
)

Reference = Callable[[Array], Array]


@dataclass(frozen=True)
class Case:
    """A cause at a place with a size.

    Attributes:
        effect: the cause.
        reference: recorded outputs from recorded inputs.
        order: of the error of MuJoCo's steps, as its law is smooth or not; None where only the chain is concerned.
        twin: largest error of the twin relative to the largest output, at 24 substeps a sample.
        steady: outputs without jumps; a sample beside the jump of an acceleration may lie on either side of it.
    """

    effect: Effect
    reference: Reference
    order: float | None = 4.0
    twin: float = 1e-9
    steady: tuple[int, ...] = (0, 1, 2, 3, 4)


def _outer(*row: float) -> Array:
    return np.outer(row, row)


def _oscillator(inputs: Array) -> Array:
    m, omega, zeta = 0.2, 2 * pi * 1.1, 0.04
    tie = _outer(0.0, -1.0, 0.0, 1.0)

    def grown(X: Array) -> Array:
        return np.pad(X, ((0, 1), (0, 1)))

    return linear(
        inputs,
        grown(M) + np.diag([0, 0, 0, m]),
        grown(C_d) + 2 * zeta * m * omega * tie,
        grown(K) + m * omega**2 * tie,
    )


def _clipped(x: Array, limit: float) -> Array:
    return np.minimum(np.maximum(x, -limit), limit)


def _with_output(channel: int, change: Callable[[Array], Array]) -> Reference:
    def reference(inputs: Array) -> Array:
        y = linear(inputs)
        y[channel] = change(y[channel])
        return y

    return reference


def _with_input(channel: int, change: Callable[[Array], Array]) -> Reference:
    def reference(inputs: Array) -> Array:
        u = np.array(inputs)
        u[channel] = change(u[channel])
        return linear(u)

    return reference


def _late_output(channel: int, delay: float, parts: int) -> Reference:
    """The delay is a whole number of parts of a sample."""
    late = round(delay / DT * parts)

    def reference(inputs: Array) -> Array:
        y, fine = linear(inputs), finely(inputs, parts)[channel]
        y[channel] = np.concatenate([np.zeros(late), fine])[: fine.size : parts]
        return y

    return reference


def _late_input(channel: int, delay: float, parts: int) -> Reference:
    late = round(delay / DT * parts)

    def reference(inputs: Array) -> Array:
        u = np.repeat(inputs, parts, axis=1)
        u[channel] = np.concatenate([np.zeros(late), u[channel]])[: u.shape[1]]
        return held(*system(), forces(u), DT / parts)[:, ::parts]

    return reference


def _lagging_output(channel: int, corner_hz: float) -> Reference:
    """One more state, w' = 2π f (y - w)."""

    def reference(inputs: Array) -> Array:
        A, B, C, D = system()
        rate, n = 2 * pi * corner_hz, A.shape[0]
        A = np.block([[A, np.zeros((n, 1))], [rate * C[[channel]], np.array([[-rate]])]])
        B = np.vstack([B, rate * D[[channel]]])
        C, D = np.pad(C, ((0, 0), (0, 1))), np.array(D)
        C[channel], D[channel] = np.eye(n + 1)[n], 0.0
        return held(A, B, C, D, forces(inputs))

    return reference


def _lagging_input(channel: int, mass: int, time_constant: float) -> Reference:
    """One more state, p' = (u - p) / τ, which pushes in the place of u."""

    def reference(inputs: Array) -> Array:
        A, B, C, D = system()
        n, rate = A.shape[0], 1 / time_constant
        A = np.block([[A, B[:, [mass]]], [np.zeros((1, n)), np.array([[-rate]])]])
        C, D = np.hstack([C, D[:, [mass]]]), np.array(D)
        B = np.vstack([B, rate * EYE[[mass]]])
        B[:n, mass] = D[:, mass] = 0.0
        return held(A, B, C, D, forces(inputs))

    return reference


def _held_lag(time_constant: float) -> Callable[[Array], Array]:
    def change(u: Array) -> Array:
        p, state = np.empty_like(u), 0.0
        for k, value in enumerate(u):
            state += (1 - np.exp(-DT / time_constant)) * (value - state)
            p[k] = state
        return p

    return change


def _every_tone(response: Callable[[float], complex]) -> Callable[[Array], Array]:
    """Every tone of the signal and as much silence times a response at its frequency, tone by tone."""

    def change(y: Array) -> Array:
        n, t = y.size, np.arange(y.size)
        w = np.zeros(n)
        for k in range(n + 1):
            tone = np.exp(1j * pi * k * t / n)
            size = np.vdot(tone, y) / n / (2 if k in (0, n) else 1)
            w += (size * response(k / (2 * n * DT)) * tone).real
        return w

    return change


def _sine(frequency_hz: float, amplitude: float, phase: float, n: int) -> Array:
    return amplitude * np.sin(2 * pi * frequency_hz * DT * np.arange(n) + phase)


def _pushed(inputs: Array) -> Array:
    f = forces(inputs)
    f[1] += _sine(1.3, 0.8, 0.4, f.shape[1])
    return held(*system(), f)


def _bouc_wen(_: float, x: float, v: float, z: float) -> tuple[float, float]:
    A, x_y = 30.0, 0.04
    return z, A * v - (abs(v) * z + v * abs(z)) / (2 * x_y)


def _deadband(_: float, x: float, v: float, z: float) -> tuple[float, float]:
    k, gap = 60.0, 0.01
    return k * (x - gap if x > gap else x + gap if x < -gap else 0.0) - k * x, 0.0


CASES: dict[str, Case] = {
    "mass": Case(
        EFFECTS["mass_change"]("mass1", delta_mass=0.5),
        lambda u: linear(u, M=M + np.diag([0, 0.5, 0])),
    ),
    "all masses": Case(
        EFFECTS["mass_change"]("*", relative_change=-0.1),
        lambda u: linear(u, M=0.9 * M),
    ),
    "stiffness of a tendon": Case(
        EFFECTS["stiffness_change"]("spring0_1", relative_change=-0.2),
        lambda u: linear(u, K=K - 0.2 * 60 * _outer(*SPRING)),
    ),
    "stiffness of a joint": Case(
        EFFECTS["stiffness_change"]("q2", relative_change=0.3),
        lambda u: linear(u, K=K + 0.3 * 25 * _outer(0, 0, 1)),
    ),
    "all stiffnesses": Case(
        EFFECTS["stiffness_change"]("*", relative_change=0.25),
        lambda u: linear(u, K=1.25 * K),
    ),
    "damping of a tendon": Case(
        EFFECTS["damping_change"]("spring0_1", relative_change=1.5),
        lambda u: linear(u, C_d=C_d + 1.5 * 0.4 * _outer(*SPRING)),
    ),
    "all dampings": Case(
        EFFECTS["damping_change"]("*", relative_change=-0.5),
        lambda u: linear(u, C_d=0.5 * C_d),
    ),
    "spring between masses": Case(
        EFFECTS["missing_spring"]("mass0|mass2", stiffness=15.0, damping=0.2),
        lambda u: linear(u, C_d=C_d + 0.2 * _outer(-1, 0, 1), K=K + 15 * _outer(-1, 0, 1)),
    ),
    "spring to the ground": Case(
        EFFECTS["missing_spring"]("world|mass1", stiffness=12.0),
        lambda u: linear(u, K=K + 12 * _outer(0, 1, 0)),
    ),
    "oscillator": Case(
        EFFECTS["attached_oscillator"]("mass1", mass=0.2, frequency_hz=1.1, damping_ratio=0.04),
        _oscillator,
    ),
    "cubic": Case(
        EFFECTS["cubic_stiffness"]("spring0_1", k3=4000.0),
        lambda u: local(u, lambda s, x, v, z: (4000 * x**3, 0.0)),
        twin=1e-4,
    ),
    "bilinear": Case(
        EFFECTS["bilinear_stiffness"]("spring0_1", relative_change_in_extension=0.4),
        lambda u: local(u, lambda s, x, v, z: (24 * x if x > 0 else 0.0, 0.0)),
        order=2.0,
        twin=1e-4,
    ),
    "freeplay": Case(
        EFFECTS["freeplay"]("spring0_1", half_gap=0.01),
        lambda u: local(u, _deadband),
        order=2.0,
        twin=3e-4,
    ),
    "stop in extension": Case(
        EFFECTS["gap_contact"]("spring0_1", gap=0.02, contact_stiffness=200.0),
        lambda u: local(u, lambda s, x, v, z: (200 * (x - 0.02) if x > 0.02 else 0.0, 0.0)),
        order=2.0,
        twin=3e-4,
    ),
    "stop in compression": Case(
        EFFECTS["gap_contact"]("q2", gap=-0.03, contact_stiffness=200.0),
        lambda u: local(u, lambda s, x, v, z: (200 * (x + 0.03) if x < -0.03 else 0.0, 0.0), row=EYE[2]),
        order=2.0,
        twin=3e-4,
    ),
    "friction": Case(
        EFFECTS["coulomb_friction"]("q1", force=0.5),
        lambda u: rubbing(u, 0.5, 1),
        order=1.0,
        twin=3e-4,
        steady=(0, 2, 3, 4),
    ),
    "drag": Case(
        EFFECTS["quadratic_damping"]("spring0_1", c2=1.5),
        lambda u: local(u, lambda s, x, v, z: (1.5 * abs(v) * v, 0.0)),
        order=3.0,
        twin=1e-4,
    ),
    "hysteresis": Case(
        EFFECTS["hysteresis"]("spring0_1", stiffness=30.0, yield_displacement=0.04),
        lambda u: local(u, _bouc_wen),
        order=2.0,
        twin=2e-4,
    ),
    "drift": Case(
        EFFECTS["stiffness_drift"]("spring0_1", relative_change_over_record=-0.5),
        lambda u: local(u, lambda s, x, v, z: (-30 * s * x, 0.0)),
        twin=1e-4,
    ),
    "unmeasured sine": Case(
        EFFECTS["unmeasured_force"]("mass1", frequency_hz=1.3, amplitude=0.8, phase=0.4),
        _pushed,
        order=None,
    ),
    "sensor gain": Case(
        EFFECTS["sensor_gain"]("acc1.x", relative_change=-2.0), _with_output(1, lambda y: -y), order=None
    ),
    "sensor delay, samples": Case(
        EFFECTS["sensor_delay"]("acc1.x", delay=2 * DT), _late_output(1, 2 * DT, 1), order=None
    ),
    "sensor delay, parts": Case(
        EFFECTS["sensor_delay"]("acc0.x", delay=1.25 * DT), _late_output(0, 1.25 * DT, 4), order=None
    ),
    "sensor lag": Case(EFFECTS["sensor_lag"]("acc0.x", corner_hz=4.0), _lagging_output(0, 4.0), order=None),
    "sensor lag, band-limited": Case(
        EFFECTS["sensor_lag"]("acc0.x", corner_hz=4.0, band_limited=True),
        _with_output(0, _every_tone(lambda f: 1 / (1 + 1j * f / 4.0))),
        order=None,
    ),
    "sensor delay, band-limited": Case(
        EFFECTS["sensor_delay"]("acc0.x", delay=0.6 * DT, band_limited=True),
        _with_output(0, _every_tone(lambda f: np.exp(-2j * pi * f * 0.6 * DT))),
        order=None,
    ),
    "sensor saturation": Case(
        EFFECTS["sensor_saturation"]("acc2.x", limit=0.6),
        _with_output(2, lambda y: _clipped(y, 0.6)),
        order=None,
    ),
    "sensor swap": Case(
        EFFECTS["sensor_swap"]("acc0.x|acc2.x"), lambda u: linear(u)[[2, 1, 0, 3, 4]], order=None
    ),
    "hum": Case(
        EFFECTS["line_hum"]("acc1.x", frequency_hz=3.7, amplitude=0.3, phase=-1.0),
        _with_output(1, lambda y: y + _sine(3.7, 0.3, -1.0, y.size)),
        order=None,
    ),
    "actuator gain": Case(
        EFFECTS["actuator_gain"]("force2", relative_change=0.3), _with_input(1, lambda u: 1.3 * u), order=None
    ),
    "actuator lag, smooth": Case(
        EFFECTS["actuator_lag"]("force2", time_constant=0.06), _lagging_input(1, 2, 0.06), order=None
    ),
    "actuator lag, held": Case(
        EFFECTS["actuator_lag"]("force2", time_constant=0.06, held=True),
        _with_input(1, _held_lag(0.06)),
        order=None,
    ),
    "actuator delay, samples": Case(
        EFFECTS["actuator_delay"]("force0", delay=DT), _late_input(0, DT, 1), order=None
    ),
    "actuator delay, parts": Case(
        EFFECTS["actuator_delay"]("force0", delay=1.25 * DT), _late_input(0, 1.25 * DT, 4), order=None
    ),
    "actuator saturation": Case(
        EFFECTS["actuator_saturation"]("force2", limit=0.9),
        _with_input(1, lambda u: _clipped(u, 0.9)),
        order=None,
    ),
}
