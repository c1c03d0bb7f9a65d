"""How far noise moves a model realized through an observer, with its fitted B and D.

The residual of the model tells the noise. Noise of the same spectra is drawn again and again, and each draw
takes the same way as that of the recording did: through the observer's regression, the recursion to Markov
parameters, the realization, and the fit of B and D.
"""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np
import scipy.fft
import scipy.linalg

from identification.errors import IdentificationError, TooShortError
from identification.hankel_perturbation import hankel_tangent, observability
from identification.input_fit import fit_inputs
from identification.observer import Observer, observe
from identification.parameterizations import Tangent
from identification.recording import Array, Recording
from identification.regression import BLOCK, FROM_REST
from identification.residual_scatter import redrawn
from identification.systems import Realization, StateSpace

MOST_GROWTH = 1e6
"""Growth over a record beyond which an unstable model cannot be fitted to it."""
DRAWS = 60
"""Draws of the noise: enough for standard deviations to 9 %."""


class Signals(NamedTuple):
    """A record in channels of unit RMS.

    Attributes:
        inputs: shape (n_inputs, n_samples).
        clean: outputs of the model, shape (n_outputs, n_samples).
        noise: what the model leaves, likewise.
        first: first sample that the observer predicts.
    """

    inputs: Array
    clean: Array
    noise: Array
    first: int


def observer_tangent(
    recording: Recording, realization: Realization, order: int, *, inputs: bool = True
) -> Tangent:
    """Derivatives of an OKID model along independent disturbances, each of one standard deviation.

    Args:
        recording: the one that was realized.
        realization: by `okid_era`.
        order: number of states of the model asked for.
        inputs: whether B and D matter; poles and shapes alone cost less.

    Returns:
        The covariance of the model's parameters is Σ dθ dθᵀ over the directions; zero for data without noise.

    Raises:
        TooShortError: too few samples.
        IdentificationError: the model grows beyond all bounds.

    Source: parametric bootstrap, Efron and Tibshirani (1993), section 6.5, of linearized least squares.
    """
    settings, system = realization.settings, realization.at(order)
    found = observe(recording, observer=int(settings["observer"]))
    if found.exact:
        return _at_rest(system)
    if np.max(np.abs(np.linalg.eigvals(system.A))) >= 1:
        raise IdentificationError(
            "an unstable pole forbids a simulation of the whole record; lower the order"
        )
    size_u, size_y = found.input_rms, found.output_rms[:, None]
    scaled = replace(system, B=system.B * size_u, C=system.C / size_y, D=system.D / size_y * size_u)
    records = _signals(scaled, recording, found)
    rng = np.random.default_rng(0)
    draws = [[redrawn(record.noise, rng) for record in records] for _ in range(DRAWS)]
    changes = _markov_changes(records, draws, found.length, int(settings["n_lags"])) / np.sqrt(DRAWS)
    moved = hankel_tangent(
        scaled, changes, n_rows=int(settings["n_rows"]), n_columns=int(settings["n_columns"])
    )
    tangent = Tangent(
        system, moved.A_theta, moved.B_theta / size_u, moved.C_theta * size_y, moved.D_theta * size_y / size_u
    )
    if not inputs or order != realization.order:
        return tangent
    return _with_fitted_inputs(tangent, recording, [[v * size_y for v in draw] for draw in draws])


def _at_rest(system: StateSpace) -> Tangent:
    zeros = (np.zeros((1, *X.shape)) for X in (system.A, system.B, system.C, system.D))
    return Tangent(system, *zeros)


def _signals(scaled: StateSpace, recording: Recording, found: Observer) -> list[Signals]:
    records = []
    for record in recording.records:
        u = np.asarray(record.inputs[:, :], dtype=float) / found.input_rms[:, None]
        y = np.asarray(record.outputs[:, :], dtype=float) / found.output_rms[:, None]
        at_rest = record.kind in FROM_REST
        noise = y - scaled.simulate(u)
        if not at_rest:
            free = observability(scaled.A, scaled.C, y.shape[1])
            noise -= (free @ np.linalg.lstsq(free, noise.T.ravel())[0]).reshape(-1, len(y)).T
        records.append(Signals(u, y - noise, noise, 0 if at_rest else found.length))
    return records


def _markov_changes(records: list[Signals], draws: list[list[Array]], length: int, n_lags: int) -> Array:
    """Changes of the scaled Markov parameters under each draw, shape (n_draws, n_lags, n_outputs, n_inputs).

    The coefficients of the observer move by (XᵀX)⁻¹ Xᵀ e from those that minimize the expected error, with e the
    prediction error of these and X the regressors, both under the drawn noise.
    """
    n_inputs, n_outputs = len(records[0].inputs), len(records[0].clean)
    gram, right, n_rows = _expected(records, length)
    n = len(gram)
    if n_rows <= n:
        raise TooShortError(
            f"{n_rows} samples leave nothing to tell the noise by from {n} coefficients; record for longer"
        )
    size = np.sqrt(np.diag(gram))
    inverse = scipy.linalg.pinvh(gram / np.outer(size, size)) / np.outer(size, size)
    theta = inverse @ right
    moves = np.empty((len(draws), *theta.shape))
    for k, draw in enumerate(draws):
        moves[k] = inverse @ sum(
            _score(record, record.clean + noise, theta, length)
            for record, noise in zip(records, draw, strict=True)
        )
    moves -= np.mean(moves, axis=0)
    Y = _recursion(np.concatenate([theta[None], theta + moves]), n_inputs, n_outputs, n_lags)
    return np.asarray(Y[1:] - Y[0])


def _expected(records: list[Signals], length: int) -> tuple[Array, Array, int]:
    """Expected XᵀX and Xᵀy of the regression rows [u(k), v(k - 1), …, v(k - p)], v = (u, y), and their number."""
    n_inputs, n_outputs = len(records[0].inputs), len(records[0].clean)
    n = n_inputs + length * (n_inputs + n_outputs)
    gram, right, n_rows = np.zeros((n, n)), np.zeros((n, n_outputs)), 0
    for record in records:
        v = np.pad(np.vstack([record.inputs, record.clean]), ((0, 0), (length, 0)))
        windows = np.lib.stride_tricks.sliding_window_view(v, length + 1, axis=1)[:, record.first :, ::-1]
        for first in range(0, windows.shape[1], BLOCK):
            block = windows[:, first : first + BLOCK]
            now = block[:, :, 0].T
            X = np.hstack([now[:, :n_inputs], block[:, :, 1:].transpose(1, 2, 0).reshape(len(now), -1)])
            gram += X.T @ X
            right += X.T @ now[:, n_inputs:]
        variance = np.mean(record.noise**2, axis=1)
        of_noise = np.tile(np.concatenate([np.zeros(n_inputs), variance]), length)
        gram += windows.shape[1] * np.diag(np.concatenate([np.zeros(n_inputs), of_noise]))
        n_rows += windows.shape[1]
    return gram, right, n_rows


def _score(record: Signals, y: Array, theta: Array, length: int) -> Array:
    """Xᵀ e of a record with the outputs y, through correlations of e with the inputs and outputs before."""
    n_inputs, n_outputs = len(record.inputs), len(y)
    v = np.vstack([record.inputs, y])
    size = scipy.fft.next_fast_len(v.shape[1] + length + 1, real=True)
    V = scipy.fft.rfft(v, size)
    past = theta[n_inputs:].reshape(length, len(v), n_outputs)
    filters = np.zeros((length + 1, len(v), n_outputs))
    filters[1:] = past
    filters[0, :n_inputs] = theta[:n_inputs]
    W = scipy.fft.rfft(filters, size, axis=0)
    e = y - scipy.fft.irfft(np.einsum("cf,fco->of", V, W), size)[:, : y.shape[1]]
    e[:, : record.first] = 0
    E = scipy.fft.rfft(e, size)
    products = scipy.fft.irfft(V.conj()[:, None] * E, size)[:, :, : length + 1]  # Σ_k v(k - i) e(k)
    score = products.transpose(2, 0, 1)
    return np.concatenate([score[0, :n_inputs], score[1:].reshape(-1, n_outputs)])


def _recursion(theta: Array, n_inputs: int, n_outputs: int, n_lags: int) -> Array:
    """Markov parameters of many observers at a time, as `Observer.markov` gives those of one."""
    n = len(theta)
    past = theta[:, n_inputs:].reshape(n, -1, n_inputs + n_outputs, n_outputs).transpose(0, 1, 3, 2)
    p, beta = past.shape[1], past[..., :n_inputs]
    # From the furthest past to the nearest, as the Markov parameters come: (n, n_outputs, p * n_outputs).
    alpha = past[:, ::-1, :, n_inputs:].transpose(0, 2, 1, 3).reshape(n, n_outputs, -1)
    Y = np.zeros((n, p + n_lags, n_outputs, n_inputs))  # p lags of rest come first
    Y[:, p] = theta[:, :n_inputs].transpose(0, 2, 1)
    for k in range(1, n_lags):
        Y[:, p + k] = alpha @ Y[:, k : p + k].reshape(n, -1, n_inputs)
        if k <= p:
            Y[:, p + k] += beta[:, k - 1]
    return Y[:, p:]


def _with_fitted_inputs(tangent: Tangent, recording: Recording, draws: list[list[Array]]) -> Tangent:
    """The tangent with the changes of B and D that `fit_inputs` makes of new A and C and of new outputs."""
    system = tangent.system
    dB, dD = np.empty_like(tangent.B_theta), np.empty_like(tangent.D_theta)
    for k, draw in enumerate(draws):
        records = tuple(
            replace(record, outputs=np.asarray(record.outputs[:, :]) + noise / np.sqrt(len(draws)))
            for record, noise in zip(recording.records, draw, strict=True)
        )
        moved = replace(system, A=system.A + tangent.A_theta[k], C=system.C + tangent.C_theta[k])
        fastest = np.max(np.abs(np.linalg.eigvals(moved.A)))
        swings = max(record.n_samples for record in recording.records)
        if not swings * np.log(fastest) <= np.log(MOST_GROWTH):
            raise IdentificationError(
                "the residual is so large that a pole could as well be unstable; lower the order or look for nonlinearity"
            )
        fitted = fit_inputs(moved, replace(recording, records=records))
        dB[k], dD[k] = fitted.B - system.B, fitted.D - system.D
    return replace(tangent, B_theta=dB, D_theta=dD)
