"""Motion of a structure by classical Runge-Kutta steps: the integrator of the cases, which shares nothing with the lab."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numba
import numpy as np

from benchmarks.blind_cases.structure import DERIVATIVE, Array, Structure

DENSE = 16
"""Instants kept of every sample."""
FINE = 8
"""Steps between two of them where forces are steep."""

(
    FRICTION, STRIBECK, SOFT_STOP, LOADED_FRICTION, QUINTIC, SINE, PULSATING, HARDENING, DRAG, ROUND_BILINEAR,
    ROUND_FREEPLAY, AGEING, TRIANGLE,
) = range(13)  # fmt: skip
STEEP = (FRICTION, STRIBECK, LOADED_FRICTION)


@dataclass(frozen=True, eq=False)
class Law:
    """A restoring force f(x, v, t) between two points, x the extension by `row`.

    Attributes:
        kind: one of the laws named above.
        row: extension per displacement, (n,).
        values: up to four constants of the law.
        other: second row, of laws that feel two extensions.
    """

    kind: int
    row: Array
    values: tuple[float, ...]
    other: Array | None = None


def respond(
    structure: Structure, u: Array, dt: float, laws: Sequence[Law] = (), *, clock: Array | None = None
) -> Array:
    """Displacement, velocity and acceleration at every dense instant, (3, n, n_samples * DENSE).

    Args:
        structure: as built.
        u: forces of the shakers, (n_inputs, n_samples), each held over a sample [N].
        dt: sample time [s].
        laws: further forces.
        clock: true length of every sample over `dt`, (n_samples,); ones when None.
    """
    M, C, K = structure.matrices
    n = structure.n
    f = np.zeros((u.shape[1], n))
    for port, row in zip(structure.inputs, u, strict=True):
        f[:, port.dof] += row
    rows = np.array([law.row for law in laws], dtype=float).reshape(-1, n)
    others = np.array([law.row if law.other is None else law.other for law in laws], dtype=float).reshape(
        -1, n
    )
    values = np.array([(*law.values, *np.zeros(4 - len(law.values))) for law in laws], dtype=float).reshape(
        -1, 4
    )
    kinds = np.array([law.kind for law in laws], dtype=np.int64)
    lengths = dt * (np.ones(u.shape[1]) if clock is None else clock)
    between = FINE if any(law.kind in STEEP for law in laws) else 2 if laws else 1
    out: Any = _march(1 / np.diag(M), C, K, f, lengths, between, kinds, rows, others, values)
    return np.asarray(out)


def read(structure: Structure, motion: Array) -> Array:
    """What the sensors see of a motion, (n_outputs, n)."""
    return np.stack([motion[DERIVATIVE[port.quantity], port.dof] for port in structure.outputs])


@numba.njit(cache=True)
def _force(kind, x, v, y, t, p):  # type: ignore[no-untyped-def]
    if kind == FRICTION:
        return p[0] * np.tanh(v / p[1])
    if kind == STRIBECK:
        # Breakaway force p[0] (1 + p[2]) falls to p[0] over the velocity p[3].
        return p[0] * (1 + p[2] * np.exp(-((v / p[3]) ** 2))) * np.tanh(v / p[1])
    if kind == SOFT_STOP:
        # Rubber: stiffness p[1] builds up over the depth p[2] beyond the gap p[0], met on the side of its sign.
        depth = x - p[0] if p[0] > 0 else p[0] - x
        if depth <= 0:
            return 0.0
        push = p[1] * (depth - p[2] * (1 - np.exp(-depth / p[2])))
        return push if p[0] > 0 else -push
    if kind == LOADED_FRICTION:
        return p[0] * np.abs(y) * np.tanh(v / p[1])
    if kind == QUINTIC:
        return p[0] * x**5
    if kind == SINE:
        # A magnetic detent: the force repeats with the distance.
        return p[0] * np.sin(x / p[1])
    if kind == PULSATING:
        # Damping and stiffness beat with time.
        return (p[0] * v + p[2] * x) * np.sin(p[1] * t + p[3])
    if kind == HARDENING:
        return p[0] * x**3 + p[1] * x**5
    if kind == DRAG:
        return p[0] * np.abs(v) ** p[1] * np.sign(v)
    if kind == ROUND_BILINEAR:
        return p[0] * (x + np.sqrt(x**2 + p[1] ** 2) - p[1]) / 2
    if kind == ROUND_FREEPLAY:
        return -p[0] * p[1] * np.tanh(x / p[1])
    if kind == AGEING:
        return p[0] * x * (1 - np.exp(-t / p[1]))
    # TRIANGLE: a force that rises and falls in straight lines.
    return p[0] * 2 / np.pi * np.arcsin(np.sin(p[1] * t + p[2]))


@numba.njit(cache=True)
def _slope(s, f, t, inverse, C, K, kinds, rows, others, values, out):  # type: ignore[no-untyped-def]
    n = inverse.size
    for i in range(n):
        total = f[i]
        for j in range(n):
            total -= C[i, j] * s[n + j] + K[i, j] * s[j]
        out[i] = s[n + i]
        out[n + i] = total
    for law in range(kinds.size):
        x, v, y = 0.0, 0.0, 0.0
        for i in range(n):
            x += rows[law, i] * s[i]
            v += rows[law, i] * s[n + i]
            y += others[law, i] * s[i]
        force = _force(kinds[law], x, v, y, t, values[law])
        for i in range(n):
            out[n + i] -= rows[law, i] * force
    for i in range(n):
        out[n + i] *= inverse[i]


@numba.njit(cache=True)
def _march(inverse, C, K, f, lengths, between, kinds, rows, others, values):  # type: ignore[no-untyped-def]
    n, n_samples = inverse.size, f.shape[0]
    out = np.empty((3, n, n_samples * DENSE))
    s, t = np.zeros(2 * n), 0.0
    a, b, c, d = np.empty(2 * n), np.empty(2 * n), np.empty(2 * n), np.empty(2 * n)
    for k in range(n_samples):
        h = lengths[k] / (DENSE * between)
        for j in range(DENSE * between):
            _slope(s, f[k], t, inverse, C, K, kinds, rows, others, values, a)
            if j % between == 0:
                at = k * DENSE + j // between
                out[0, :, at] = s[:n]
                out[1, :, at] = s[n:]
                out[2, :, at] = a[n:]
            _slope(s + h / 2 * a, f[k], t + h / 2, inverse, C, K, kinds, rows, others, values, b)
            _slope(s + h / 2 * b, f[k], t + h / 2, inverse, C, K, kinds, rows, others, values, c)
            _slope(s + h * c, f[k], t + h, inverse, C, K, kinds, rows, others, values, d)
            s = s + h / 6 * (a + 2 * b + 2 * c + d)
            t += h
    return out
