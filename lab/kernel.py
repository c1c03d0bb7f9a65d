"""Kernel: responses of a linear structure with a few local force laws, sample by sample, compiled.

Between samples the linear part is exact (matrix exponential); the force of a law is taken as a straight line over each
substep and solved for implicitly at its end, which is of second order in the substep and stable as long as the law alone
swings less than half a turn in one (the linear acceleration method, Newmark 1959). The same function runs uncompiled as
`respond.py_func`. Compiled sums may be taken in another order, several terms at once.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from lab.forces import BILINEAR, BOUC_WEN, COULOMB, CUBIC, DEADBAND, DRIFT, QUADRATIC, STOP

REORDERED = {"reassoc", "contract", "nsz"}
"""What the compiler may do to sums; it must still know NaN and infinity."""


@njit(cache=True, nogil=True)
def lagged(signal, share):  # type: ignore[no-untyped-def]
    """A signal (n,) behind a first-order lag from rest, which takes up that share of the way left at every sample."""
    out = np.empty(signal.size)
    y = 0.0
    for k in range(signal.size):
        y += share * (signal[k] - y)
        out[k] = y
    return out


@njit(cache=True, nogil=True, fastmath=REORDERED)
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


@njit(cache=True, nogil=True, fastmath=REORDERED)
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


@njit(cache=True, nogil=True, fastmath=REORDERED)
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


@njit(cache=True, nogil=True, fastmath=REORDERED)
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


@njit(cache=True, nogil=True, fastmath=REORDERED)
def _yielding(p, z, dx):  # type: ignore[no-untyped-def]
    """Force of a Bouc-Wen spring after a way dx from force z: straight down to zero, then towards its level."""
    sign, left = (1.0, dx) if dx > 0 else (-1.0, -dx)
    g = sign * z
    if g < 0:
        straight = min(left, -g / p[0])
        g += p[0] * straight
        left -= straight
    return sign * (g - math.expm1(-left / p[1]) * (p[0] * p[1] - g))


@njit(cache=True, nogil=True, fastmath=REORDERED)
def _in_fours(A):  # type: ignore[no-untyped-def]
    """A matrix with rows and columns of zeros that make the number of each a multiple of four: so many at once."""
    n, m = A.shape
    padded = np.zeros((n + (-n) % 4, m + (-m) % 4))
    padded[:n, :m] = A
    return padded


@njit(cache=True, nogil=True, fastmath=REORDERED)
def _product(A, x, out):  # type: ignore[no-untyped-def]
    """Puts A x into out, four rows at once, which is three times as fast as one by one."""
    for j in range(0, out.size, 4):
        a, b, c, d = 0.0, 0.0, 0.0, 0.0
        for i in range(x.size):
            a += A[j, i] * x[i]
            b += A[j + 1, i] * x[i]
            c += A[j + 2, i] * x[i]
            d += A[j + 3, i] * x[i]
        out[j], out[j + 1], out[j + 2], out[j + 3] = a, b, c, d


@njit(cache=True, nogil=True, fastmath=REORDERED)
def _over_a_sample(F, G, P, Q, X, V, at, C, D, E):  # type: ignore[no-untyped-def]
    """What comes of a sample, from state, inputs and forces of the laws at its start, and from those at each substep's end.

    Rows are extensions of the laws and then their rates at the end of each substep, without the force that ends there;
    states at the end of the sample; and outputs that are read on the way.
    """
    (substeps, n_states, n_inputs), n_laws = G.shape, P.shape[1]
    n_ends = 2 * n_laws * substeps
    now = np.zeros((n_states, n_states + n_inputs + (substeps + 1) * n_laws))
    n_late = at.size if np.any(at > 0) else 0
    every = np.zeros((n_ends + n_states + n_late, now.shape[1]))
    for j in range(n_states):
        now[j, j] = 1.0
    for step in range(substeps):
        start = n_states + n_inputs + step * n_laws
        for i in range(n_late):
            if at[i] == step:
                read = every[n_ends + n_states + i]
                read[:] = C[i] @ now
                read[n_states : n_states + n_inputs] += D[i]
                read[start : start + n_laws] += E[i]
        now = F @ now
        now[:, n_states : n_states + n_inputs] += G[step]
        now[:, start : start + n_laws] += P
        at_end = every[2 * n_laws * step :]
        at_end[:n_laws], at_end[n_laws : 2 * n_laws] = X @ now, V @ now
        now[:, start + n_laws : start + 2 * n_laws] += Q
    every[n_ends : n_ends + n_states] = now
    return every


@njit(cache=True, nogil=True, fastmath=REORDERED)
def respond(F, G, P, Q, X, V, S, T, R, at, C, D, E, laws, params, u, x0, n_record, L, y):  # type: ignore[no-untyped-def]
    """Outputs, shape (n_samples, n_outputs), of one record; NaN from the sample in which the motion diverges.

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
    n, n_states, n_inputs, n_outputs, n_laws = u.shape[0], x0.size, u.shape[1], C.shape[0], laws.size
    substeps, n_acting = G.shape[0], n_states + n_inputs + n_laws
    n_ends, any_late = 2 * n_laws * substeps, np.any(at > 0)
    every = _over_a_sample(F, G, P, Q, X, V, at, C, D, E)
    # What acts at the start of a sample, and what comes of it.
    acting, moves = np.zeros(n_acting + (-n_acting) % 4), _in_fours(every[:, :n_acting])
    readings = _in_fours(np.concatenate((C, D, E), axis=1))
    ends, reading = np.zeros(moves.shape[0]), np.zeros(readings.shape[0])
    n_after = every.shape[0] - n_ends
    arrived = ends[n_ends : n_ends + n_after]
    acting[:n_states] = x0
    x, g = acting[:n_states], acting[n_states + n_inputs : n_acting]
    # The forces that end each substep, and what comes of them: extensions within the sample, states and readings after it.
    later, pushes = np.ascontiguousarray(every[:n_ends, n_acting:]), _in_fours(every[n_ends:, n_acting:])
    since, pushed = np.zeros(pushes.shape[1]), np.zeros(pushes.shape[0])
    out, z = np.empty((n, n_outputs)), np.zeros(n_laws)
    # Extensions and their rates at the start of a substep; and per force of each law at its end.
    xs, vs = np.zeros(n_laws), np.zeros(n_laws)
    per_x, per_v = X @ Q, V @ Q
    observed, pulls = L.shape[0] > 0, np.ascontiguousarray(L.T)
    dry = np.array([laws[e] == COULOMB and params[e, 1] <= 0 for e in range(n_laws)])
    stuck = np.zeros(n_laws, dtype=np.bool_)
    for e in range(n_laws):
        stuck[e] = dry[e] and not np.any(V[e] * x0)
    any_dry = np.any(dry)
    per_sample, per_substep = 1 / n_record, 1 / n_record / substeps
    for k in range(n):
        s = k / n_record
        for i in range(n_inputs):
            acting[n_states + i] = u[k, i]
        for pull in range(2 if observed else 1):
            for e in range(n_laws):
                xe, ve = 0.0, 0.0
                for j in range(n_states):
                    xe += X[e, j] * x[j]
                    ve += V[e, j] * x[j]
                if laws[e] == BOUC_WEN:
                    if pull == 1:
                        # A spring with a memory remembers where measurements pull it, or its rest would wander.
                        z[e] = _yielding(params[e], z[e], xe - xs[e])
                    g[e] = z[e]
                elif dry[e]:
                    g[e] = params[e, 0] * np.sign(ve)
                else:
                    g[e] = force(laws[e], params[e], xe, ve, s)
                xs[e], vs[e] = xe, ve
            if any_dry:
                _stick(S, T, R, x, u[k], laws, params, stuck, g)
            if pull == 1:
                break
            _product(readings, acting, reading)
            for i in range(n_outputs):
                if at[i] == 0:
                    out[k, i] = reading[i]
            if observed:
                for i in range(n_outputs):
                    # What is read later cannot correct the state yet.
                    error = y[k, i] - out[k, i] if at[i] == 0 else np.nan
                    if error == error:
                        for j in range(n_states):
                            x[j] += pulls[i, j] * error
        _product(moves, acting, ends)
        for step in range(substeps):
            s = k * per_sample + (step + 1) * per_substep
            first = 2 * n_laws * step
            xf, vf = ends[first : first + n_laws], ends[first + n_laws : first + 2 * n_laws]
            for e in range(n_laws):
                x_end, v_end = xf[e], vf[e]
                for i in range(step * n_laws):
                    x_end += later[first + e, i] * since[i]
                    v_end += later[first + n_laws + e, i] * since[i]
                xf[e], vf[e] = x_end, v_end
            # With several laws, each is solved in turn given the others, until none moves.
            for _ in range(1 if n_laws <= 1 else 12):
                moved = 0.0
                for e in range(n_laws):
                    x_end, v_end, a_x, a_v = xf[e], vf[e], per_x[e, e], per_v[e, e]
                    for other in range(n_laws):
                        if other != e:
                            x_end += per_x[e, other] * g[other]
                            v_end += per_v[e, other] * g[other]
                    old = g[e]
                    if dry[e]:
                        g[e] = _dry(params[e, 0], vs[e], v_end, a_v)
                        stuck[e] = abs(v_end + a_v * g[e]) <= 1e-12 * (abs(v_end) + abs(a_v * g[e]))
                    elif laws[e] == COULOMB:
                        g[e] = _rounded(params[e], v_end, a_v)
                    elif laws[e] == BOUC_WEN:
                        # Newton inside a shrinking bracket: following the force alone creeps where the spring is stiff.
                        trial, bend = g[e], 0.5 / params[e, 1]
                        high = 4 * (params[e, 0] * params[e, 1] + abs(z[e]))
                        low = -high
                        for _ in range(60):
                            dx, mean = x_end + a_x * trial - xs[e], 0.5 * (z[e] + trial)
                            # |dx| z + dx |z| is nothing where their signs differ.
                            alike = 2.0 if (dx > 0) == (mean > 0) else 0.0
                            level, way = alike * abs(mean), alike * abs(dx)
                            error = z[e] + params[e, 0] * dx - bend * dx * level - trial
                            if error > 0:
                                low = trial
                            else:
                                high = trial
                            change = error / (1 - a_x * (params[e, 0] - bend * level) + 0.5 * bend * way)
                            if not low <= trial + change <= high:
                                change = 0.5 * (low + high) - trial
                            trial += change
                            if abs(change) <= 1e-13 * abs(trial):
                                break
                        g[e] = trial
                    else:
                        trial = g[e]
                        for _ in range(12):
                            following = force(laws[e], params[e], x_end + a_x * trial, v_end + a_v * trial, s)
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
                since[step * n_laws + e] = g[e]
                xs[e], vs[e] = xf[e], vf[e]
                for other in range(n_laws):
                    xs[e] += per_x[e, other] * g[other]
                    vs[e] += per_v[e, other] * g[other]
        if n_laws:
            _product(pushes, since, pushed)
            for j in range(n_after):
                arrived[j] += pushed[j]
        for j in range(n_states):
            x[j] = arrived[j]
        if any_late:
            for i in range(n_outputs):
                if at[i] > 0:
                    out[k, i] = arrived[n_states + i]
        gone = 0
        for j in range(n_states):
            gone += not abs(x[j]) < 1e100
        if gone:
            out[k + 1 :] = np.nan
            for i in range(n_outputs):
                if at[i] > 0:
                    out[k, i] = np.nan
            break
    return out
