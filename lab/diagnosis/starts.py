"""Starts: records that do not begin at rest, such as free decays, and where their motion begins."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import scipy.special

from identification.recording import Array, Recording
from lab.diagnosis.fit import Fit, weights
from lab.diagnosis.misfit import Misfit
from lab.paths import recorded
from lab.plant import Plant
from lab.responder import ready
from lab.rig import Rig

LEVEL = 1e-3
"""Probability that a record that begins at rest is taken for one that does not."""
PLACEBOS = 8
"""Later instants from which a residual is regressed on free motion, to learn how much of it passes for one anyway."""


def free_decays(recording: Recording) -> tuple[int, ...]:
    """Numbers of the records that are free decays."""
    return tuple(i for i, record in enumerate(recording.records) if record.kind == "free_decay")


def with_starts(misfit: Misfit, records: tuple[int, ...]) -> Misfit:
    """The misfit with the motion at the start of these records unknown."""
    for record in records:
        if record not in misfit.parameters.started:
            measured = misfit.records[record][1]
            sizes = np.sqrt(np.nanmean(measured**2, axis=1))
            swing = _swings(misfit.twin.plant, misfit.dt, measured.shape[1])  # (2 n, n_outputs, n_samples)
            reach = np.max(np.sqrt(np.mean(swing**2, axis=2)) / np.maximum(sizes, 1e-300), axis=1)
            misfit = replace(misfit, parameters=misfit.parameters.with_start(record, 1 / reach))
    return misfit


def moving(misfit: Misfit, fit: Fit) -> tuple[int, ...]:
    """Numbers of further records whose residual says that they did not begin at rest.

    The residual is regressed on the free motion from every start; under rest the fall of its squares, in units of the
    noise, is chi-square distributed. Where the model is wrong the residual is no noise: then the fall must stand out from
    those at later instants, where nothing started (overdispersion as in quasi-likelihood, McCullagh and Nelder 1989, 4.5).
    """
    plant = misfit.plant(fit.theta)
    w, first, found = weights(fit.residual, misfit.counting_as_one()), 0, []
    for number, n in enumerate(misfit.n_train):
        e = fit.residual[:, first : first + n] * w[:, None]
        first += n
        if number in misfit.parameters.started:
            continue
        length = n // 2
        swing = (_swings(plant, misfit.dt, length) * w[:, None]).reshape(2 * plant.n_dofs, -1)
        swing /= np.linalg.norm(swing, axis=1, keepdims=True)
        inverse = np.linalg.pinv(swing @ swing.T, rcond=1e-10, hermitian=True)
        falls = []
        for instant in np.linspace(0, n - length, PLACEBOS + 1).astype(int):
            match = swing @ e[:, instant : instant + length].ravel()
            falls.append(match @ inverse @ match)
        dispersion = max(np.mean(falls[1:]) / swing.shape[0], 1.0)
        if falls[0] > dispersion * scipy.special.chdtri(swing.shape[0], LEVEL):
            found.append(number)
    return tuple(found)


def starts_of(misfit: Misfit, theta: Array) -> tuple[Array | None, ...]:
    """Displacements and velocities (2 n_dofs,) at the start of every record; None where it begins at rest."""
    return tuple(misfit.parameters.start(theta, number) for number in range(len(misfit.records)))


def best_starts(misfit: Misfit) -> tuple[Array | None, ...]:
    """The starts that suit the model as given, by least squares."""
    found: list[Array | None] = []
    plant = misfit.twin.plant
    for number, (u, y) in enumerate(misfit.records):
        if number not in misfit.parameters.started:
            found.append(None)
            continue
        n = misfit.n_train[number]
        e = y[:, :n] - ready(plant, misfit.dt).outputs(u, n, n_record=y.shape[1])
        w = 1 / np.sqrt(np.maximum(np.nanmean(y**2, axis=1), 1e-300))
        weighted = (np.where(np.isnan(e), 0.0, e) * w[:, None]).ravel()
        swing = (_swings(plant, misfit.dt, n) * w[:, None]).reshape(2 * plant.n_dofs, -1)
        size = np.linalg.norm(swing, axis=1)
        swing /= size[:, None]
        found.append(np.linalg.lstsq(swing @ swing.T, swing @ weighted, rcond=1e-10)[0] / size)
    return tuple(found)


def motions_of(
    rig: Rig, dofs: tuple[str, ...], starts: Sequence[Array | None]
) -> list[tuple[Array, Array] | None]:
    """Displacement and velocity of every degree of freedom of a rig at each start, from those of some; None for rest.

    What has been added to a structure moves along with what it is tied to.
    """
    if all(start is None for start in starts):
        return [None] * len(starts)
    known = [rig.dofs.index(name) for name in dofs]
    added = [i for i in range(len(rig.dofs)) if i not in known]
    K = rig.second_order().stiffness
    everywhere = np.zeros((len(rig.dofs), len(known)))
    everywhere[known] = np.eye(len(known))
    everywhere[added] = -np.linalg.lstsq(K[np.ix_(added, added)], K[np.ix_(added, known)], rcond=None)[0]
    halves = (None if start is None else np.split(start, 2) for start in starts)
    return [None if half is None else (everywhere @ half[0], everywhere @ half[1]) for half in halves]


def _swings(plant: Plant, dt: float, n_samples: int) -> Array:
    """Free motion of the linear part of a plant from every unit start, (2 n_dofs, n_outputs, n_samples)."""
    paths = tuple(replace(path, hum=(), limit=np.inf) for path in plant.output_paths)
    F, *_, C, _, _ = ready(replace(plant, laws=(), tones=(), output_paths=paths), dt).matrices
    # C, C F, C F², …, doubled in length by each product.
    readings, power = C[None], F
    while len(readings) < n_samples:
        readings = np.concatenate([readings, readings @ power])
        power = power @ power
    swings = readings[:n_samples, :, : 2 * plant.n_dofs].transpose(2, 1, 0)
    return np.array([recorded(paths, plant.order, np.ascontiguousarray(swing), dt) for swing in swings])
