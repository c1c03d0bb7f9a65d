"""A structure whose responses the tests work out by themselves: matrix exponentials, or an adaptive integrator.

Nothing of the library takes part but the names of channels.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import scipy.integrate
import scipy.linalg

from identification.recording import Array
from lab.rig import Rig
from tests.lab import structures

DT = 0.05
MASSES = (1.0, 2.0, 1.5)
GROUND = ((40.0, 0.3), (0.0, 0.0), (25.0, 0.2))
JOINED = {(0, 1): (60.0, 0.4), (1, 2): (50.0, 0.3)}
M, C_d, K = structures.chain_matrices(MASSES, GROUND, JOINED)
N = len(MASSES)
EYE = np.eye(N)
SPRING = np.array([-1.0, 1.0, 0.0])
"""Extension of spring0_1 per displacement."""

INPUTS = ("force0", "force2")
DRIVEN = (0, 2)
OUTPUTS = ("acc0.x", "acc1.x", "acc2.x", "vel1", "pos2")
READ = ((2, 0), (2, 1), (2, 2), (1, 1), (0, 2))
"""Derivative and mass of every output."""


def nominal() -> Rig:
    """The rig as the engineer believes it to be: three masses, two of them on the ground."""
    rig = Rig.from_xml(structures.chain_xml(MASSES, GROUND, JOINED))
    return rig.connected(inputs=INPUTS, outputs=OUTPUTS)


def forces(inputs: Array) -> Array:
    """Forces on the masses, (n, n_samples), of the recorded inputs."""
    f = np.zeros((N, inputs.shape[1]))
    f[list(DRIVEN)] = inputs
    return f


def system(M: Array = M, C_d: Array = C_d, K: Array = K) -> tuple[Array, Array, Array, Array]:
    """A, B, C, D from forces on all masses to the outputs; further masses come behind the three."""
    n = M.shape[0]
    A, B = np.zeros((2 * n, 2 * n)), np.zeros((2 * n, n))
    A[:n, n:] = np.eye(n)
    A[n:] = -np.linalg.solve(M, np.hstack([K, C_d]))
    B[n:] = np.linalg.inv(M)
    motion = [np.eye(2 * n)[:n], np.eye(2 * n)[n:], A[n:]]
    C = np.array([motion[order][mass] for order, mass in READ])
    D = np.array([B[n + mass] if order == 2 else np.zeros(n) for order, mass in READ])
    return A, B, C, D


def held(A: Array, B: Array, C: Array, D: Array, u: Array, dt: float = DT) -> Array:
    """Exact outputs, (n_outputs, n_samples), under inputs held over each sample, from rest."""
    n, m = B.shape
    step = scipy.linalg.expm(np.block([[A, B], [np.zeros((m, n + m))]]) * dt)[:n]
    x, y = np.zeros(n), np.empty((C.shape[0], u.shape[1]))
    for k in range(u.shape[1]):
        y[:, k] = C @ x + D @ u[:, k]
        x = step @ np.concatenate([x, u[:, k]])
    return y


def linear(inputs: Array, M: Array = M, C_d: Array = C_d, K: Array = K) -> Array:
    """Exact outputs of a structure with these matrices."""
    f = forces(inputs)
    f = np.vstack([f, np.zeros((M.shape[0] - N, f.shape[1]))])
    return held(*system(M, C_d, K), f)


def finely(inputs: Array, parts: int = 2) -> Array:
    """Exact outputs of the nominal structure at every part of a sample."""
    return held(*system(), np.repeat(forces(inputs), parts, axis=1), DT / parts)


def local(
    inputs: Array,
    law: Callable[[float, float, float, float], tuple[float, float]],
    *,
    row: Array = SPRING,
    memory: bool = False,
) -> Array:
    """Outputs of the structure with a local law, by an adaptive Runge-Kutta method of order 8.

    Args:
        inputs: held over each sample.
        law: (share of the record, extension, rate, memory) -> restoring force, rate of the memory.
        row: extension per displacement.
        memory: whether the law has one.

    Returns:
        Outputs to a relative 1e-10, unless the law kinks more often than the step can be cut.
    """
    f, inverse = forces(inputs), np.linalg.inv(M)
    n_samples = f.shape[1]
    duration = n_samples * DT

    def slope(t: float, s: Array, force: Array) -> Array:
        g, rate = law(t / duration, row @ s[:N], row @ s[N : 2 * N], s[-1])
        a = inverse @ (force - C_d @ s[N : 2 * N] - K @ s[:N] - row * g)
        return np.concatenate([s[N : 2 * N], a, [rate]])

    s, y = np.zeros(2 * N + 1), np.empty((len(READ), n_samples))
    for k in range(n_samples):
        motion = (s[:N], s[N : 2 * N], slope(k * DT, s, f[:, k])[N : 2 * N])
        y[:, k] = [motion[order][mass] for order, mass in READ]
        done = scipy.integrate.solve_ivp(
            slope, (k * DT, (k + 1) * DT), s, "DOP853", args=(f[:, k],), rtol=1e-10, atol=1e-12
        )
        s = done.y[:, -1]
    return y


def rubbing(inputs: Array, force: float, mass: int) -> Array:
    """Outputs with dry friction between one mass and the ground, from one turn between sticking and slipping to the next."""
    f, inverse = forces(inputs), np.linalg.inv(M)
    y, s, sign = np.empty((len(READ), f.shape[1])), np.zeros(2 * N), 0.0

    def pull(s: Array, held: Array) -> float:
        return float((held - C_d @ s[N:] - K @ s[:N])[mass])

    def slope(_: float, s: Array, held: Array, sign: float) -> Array:
        a = inverse @ (held - C_d @ s[N:] - K @ s[:N] - force * sign * EYE[mass])
        if sign == 0:
            a[mass] = 0.0
        return np.concatenate([s[N:], a])

    def turn(_: float, s: Array, held: Array, sign: float) -> float:
        # Slipping ends where the velocity crosses zero, sticking where the pull exceeds the friction.
        return sign * s[N + mass] if sign else force - abs(pull(s, held))

    turn.terminal, turn.direction = True, -1  # type: ignore[attr-defined]

    def after_stop(s: Array, held: Array) -> float:
        p = pull(s, held)
        return float(np.sign(p)) if abs(p) > force * (1 + 1e-12) else 0.0

    for k in range(f.shape[1]):
        if sign == 0:
            sign = after_stop(s, f[:, k])
        a = slope(0.0, s, f[:, k], sign)[N:]
        y[:, k] = [(s[:N], s[N:], a)[order][i] for order, i in READ]
        t, end = k * DT, (k + 1) * DT
        while t < end:
            done = scipy.integrate.solve_ivp(
                slope, (t, end), s, "DOP853", args=(f[:, k], sign), events=turn, rtol=1e-10, atol=1e-12
            )
            lasted, t, s = done.t[-1] - t, done.t[-1], done.y[:, -1].copy()
            if done.status == 1:
                stopped = bool(sign)
                sign = after_stop(s, f[:, k]) if sign else float(np.sign(pull(s, f[:, k])))
                if stopped:
                    s[N + mass] = 0.0
                if lasted < 1e-9:
                    # On the very border between sticking and slipping: it sticks for a moment.
                    sign, held_still = 0.0, (t, min(t + 1e-6, end))
                    done = scipy.integrate.solve_ivp(slope, held_still, s, args=(f[:, k], sign))
                    t, s = done.t[-1], done.y[:, -1].copy()
                    sign = after_stop(s, f[:, k])
    return y
