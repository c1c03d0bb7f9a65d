"""Kernel: responses of a linear structure with a few local force laws, sample by sample, compiled.

Between samples the linear part is exact (matrix exponential); the force of a law is taken as a straight line over each
substep and solved for implicitly at its end, which is of second order in the substep and stable for stiff laws. The same
function runs uncompiled as `respond.py_func`.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from lab.forces import BILINEAR, BOUC_WEN, COULOMB, CUBIC, DEADBAND, DRIFT, QUADRATIC, STOP


@njit(cache=True, nogil=True)
def force(law, p, x, v, s):  # type: ignore[no-untyped-def]
    """Restoring force of a law without memory; the laws are those of `lab.forces`."""
    if law == CUBIC:
        return (p[0] * x + p[1]) * x * x
    if law == QUADRATIC:
        return (p[0] * abs(v) + p[1] * v * v) * v
    if law == BILINEAR:
        return p[0] * x if x > 0 else 0.0
    if law == DEADBAND:
        return -p[1] * min(max(x, -p[0]), p[0])
    if law == STOP:
        past = p[2] * (x - p[0])
        return p[2] * p[1] * past if past > 0 else 0.0
    if law == COULOMB:
        return p[0] * math.tanh(v / p[1]) if p[1] > 0 else 0.0
    if law == DRIFT:
        return p[0] * s * x
    return 0.0


@njit(cache=True, nogil=True)
def _dry(F, v, v_free, a):  # type: ignore[no-untyped-def]
    """Mean friction over a substep from velocity v, where the velocity at its end is v_free + a g with a < 0."""
    if v != 0.0:
        sign = 1.0 if v > 0 else -1.0
        slipping = v_free + a * sign * F
        if sign * slipping >= 0:
            return sign * F
        turned = v_free - a * sign * F
        if sign * (turned - v) < 0:
            # It stops on the way and sets off again in the other direction, for what is left of the substep.
            end = (turned - v) * (1.0 - v / (v - slipping))
            return min(max((end - v_free) / a, -F), F)
    return min(max(-v_free / a, -F), F)


@njit(cache=True, nogil=True)
def _rounded(p, v_free, a):  # type: ignore[no-untyped-def]
    """Friction p0 tanh(v / p1) at the end of a substep, where the velocity v is v_free + a g with a < 0."""
    low, high = -p[0], p[0]
    g = min(max(-v_free / a, low), high)
    # g - F tanh((v_free + a g) / eps) rises with g: Newton inside a shrinking bracket.
    for _ in range(60):
        t = math.tanh((v_free + a * g) / p[1])
        r = g - p[0] * t
        if r > 0:
            high = g
        else:
            low = g
        if abs(r) < 1e-12 * p[0]:
            break
        slope = 1.0 - p[0] * (1.0 - t * t) * a / p[1]
        g = g - r / slope
        if not low < g < high:
            g = 0.5 * (low + high)
    return g


@njit(cache=True, nogil=True)
def _stick(S, T, R, x, u, laws, params, stuck, g):  # type: ignore[no-untyped-def]
    """Puts into g the dry friction that acts at an instant: what holds a stuck law still, as far as it can."""
    for _ in range(1 if laws.size <= 1 else 12):
        moved = 0.0
        for e in range(laws.size):
            if stuck[e]:
                pull = 0.0
                for j in range(x.size):
                    pull += S[e, j] * x[j]
                for j in range(u.size):
                    pull += T[e, j] * u[j]
                for other in range(laws.size):
                    if other != e:
                        pull += R[e, other] * g[other]
                old, F = g[e], params[e, 0]
                g[e] = min(max(-pull / R[e, e], -F), F)
                moved = max(moved, abs(g[e] - old) - 1e-12 * abs(g[e]))
        if moved <= 0.0:
            break


@njit(cache=True, nogil=True)
def _read(step, at, C, D, E, x, u, g, out):  # type: ignore[no-untyped-def]
    """Puts into out what is read at the start of that substep."""
    for i in range(out.size):
        if at[i] == step:
            value = 0.0
            for j in range(x.size):
                value += C[i, j] * x[j]
            for j in range(u.size):
                value += D[i, j] * u[j]
            for e in range(g.size):
                value += E[i, e] * g[e]
            out[i] = value


@njit(cache=True, nogil=True)
def respond(F, G, P, Q, X, V, S, T, R, at, C, D, E, laws, params, u, x0, n_record, L, y):  # type: ignore[no-untyped-def]
    """Outputs, shape (n_samples, n_outputs), of one record; NaN from where the motion diverges.

    Args:
        F: state over one substep, (n_states, n_states).
        G: inputs held over a sample, in each of its substeps, (substeps, n_states, n_inputs).
        P, Q: forces of the laws that fall from one to zero and rise from zero to one over a substep, (n_states, n_laws);
            for dry friction, which jumps, zero and the force that is one all along.
        X, V: rows of extension and of its rate, (n_laws, n_states).
        S, T, R: rate of the rate from state, input and law forces.
        at: substep at whose start each output is read, (n_outputs,).
        C, D, E: outputs from state, input and law forces there.
        laws, params: law numbers (n_laws,) and parameters (n_laws, 3).
        u: inputs, (n_samples, n_inputs).
        x0: state at the start.
        n_record: samples of the whole record, for drift.
        L: observer gain (n_states, n_outputs) that pulls the state to the measured `y`, or no rows.
        y: measured outputs, (n_samples, n_outputs), used with an observer only; NaN where missing.
    """
    n, n_states, n_inputs, n_outputs, n_laws = u.shape[0], F.shape[0], u.shape[1], C.shape[0], laws.size
    out = np.empty((n, n_outputs))
    x, free = x0.copy(), np.zeros(n_states)
    g, z = np.zeros(n_laws), np.zeros(n_laws)
    a_x, a_v = np.zeros(n_laws), np.zeros(n_laws)
    for e in range(n_laws):
        for j in range(n_states):
            a_x[e] += X[e, j] * Q[j, e]
            a_v[e] += V[e, j] * Q[j, e]
    observed, substeps = L.shape[0] > 0, G.shape[0]
    dry = np.array([laws[e] == COULOMB and params[e, 1] <= 0 for e in range(n_laws)])
    stuck = np.zeros(n_laws, dtype=np.bool_)
    for e in range(n_laws):
        stuck[e] = dry[e] and not np.any(V[e] * x0)
    any_dry = np.any(dry)
    for k in range(n):
        s = k / n_record
        for pull in range(2 if observed else 1):
            for e in range(n_laws):
                xe, ve = 0.0, 0.0
                for j in range(n_states):
                    xe += X[e, j] * x[j]
                    ve += V[e, j] * x[j]
                if laws[e] == BOUC_WEN:
                    g[e] = z[e]
                elif dry[e]:
                    g[e] = params[e, 0] * np.sign(ve)
                else:
                    g[e] = force(laws[e], params[e], xe, ve, s)
            if any_dry:
                _stick(S, T, R, x, u[k], laws, params, stuck, g)
            if pull == 1:
                break
            _read(0, at, C, D, E, x, u[k], g, out[k])
            if observed:
                for i in range(n_outputs):
                    # What is read later cannot correct the state yet.
                    error = y[k, i] - out[k, i] if at[i] == 0 else np.nan
                    if error == error:
                        for j in range(n_states):
                            x[j] += L[j, i] * error
        for step in range(substeps):
            s = (k + (step + 1) / substeps) / n_record
            if step > 0:
                _read(step, at, C, D, E, x, u[k], g, out[k])
            for j in range(n_states):
                value = 0.0
                for i in range(n_inputs):
                    value += G[step, j, i] * u[k, i]
                for i in range(n_states):
                    value += F[j, i] * x[i]
                for e in range(n_laws):
                    value += P[j, e] * g[e]
                free[j] = value
            # With several laws, each is solved in turn given the others, until none moves.
            for _ in range(1 if n_laws <= 1 else 12):
                moved = 0.0
                for e in range(n_laws):
                    xf, vf, xs, vs = 0.0, 0.0, 0.0, 0.0
                    for j in range(n_states):
                        value = free[j]
                        for other in range(n_laws):
                            if other != e:
                                value += Q[j, other] * g[other]
                        xf += X[e, j] * value
                        vf += V[e, j] * value
                        xs += X[e, j] * x[j]
                        vs += V[e, j] * x[j]
                    old = g[e]
                    if dry[e]:
                        g[e] = _dry(params[e, 0], vs, vf, a_v[e])
                        stuck[e] = abs(vf + a_v[e] * g[e]) <= 1e-12 * (abs(vf) + abs(a_v[e] * g[e]))
                    elif laws[e] == COULOMB:
                        g[e] = _rounded(params[e], vf, a_v[e])
                    elif laws[e] == BOUC_WEN:
                        trial = g[e]
                        for _ in range(8):
                            dx = xf + a_x[e] * trial - xs
                            mean = 0.5 * (z[e] + trial)
                            trial = (
                                z[e]
                                + params[e, 0] * dx
                                - 0.5 / params[e, 1] * (abs(dx) * mean + dx * abs(mean))
                            )
                        g[e] = trial
                    else:
                        trial = g[e]
                        for _ in range(12):
                            following = force(laws[e], params[e], xf + a_x[e] * trial, vf + a_v[e] * trial, s)
                            change = following - trial
                            trial = following
                            if abs(change) <= 1e-13 * abs(trial):
                                break
                        g[e] = trial
                    moved = max(moved, abs(g[e] - old) - 1e-12 * abs(g[e]))
                if moved <= 0.0:
                    break
            for e in range(n_laws):
                if laws[e] == BOUC_WEN:
                    z[e] = g[e]
            finite = True
            for j in range(n_states):
                value = free[j]
                for e in range(n_laws):
                    value += Q[j, e] * g[e]
                x[j] = value
                finite = finite and abs(value) < 1e100
            if not finite:
                out[k + 1 :] = np.nan
                for i in range(n_outputs):
                    if at[i] > step:
                        out[k, i] = np.nan
                return out
    return out
