"""Tests: what drives a structure, record by record."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from benchmarks.blind_cases.structure import Array, Structure

FORCE = 10.0
"""RMS of a shaker [N]."""


@dataclass(frozen=True, eq=False)
class Run:
    """One record to come.

    Attributes:
        kind: of the record.
        inputs: forces of the shakers, (n_inputs, n_samples) [N].
        release: displacement of every degree of freedom at the start (n,) [m]; None from rest.
    """

    kind: str
    inputs: Array
    release: Array | None = None


def random(structure: Structure, n: int, dt: float, rng: np.random.Generator) -> Run:
    """White noise on every shaker, held over each sample."""
    return Run("random", _stored(FORCE * rng.standard_normal((len(structure.inputs), n))))


def impact(structure: Structure, n: int, dt: float, rng: np.random.Generator) -> Run:
    """A few half-sine blows on one shaker's place, far enough apart to die away in between."""
    u = np.zeros((len(structure.inputs), n))
    width = int(rng.integers(3, 6))
    blow = np.sin(np.pi * (np.arange(width) + 0.5) / width)
    row = int(rng.integers(len(u)))
    for start in range(5, n - width, max(n // 6, width + 1)):
        u[row, start : start + width] = 20 * FORCE * rng.uniform(0.7, 1.3) * blow
    return Run("impact", _stored(u))


def sweep(structure: Structure, n: int, dt: float, rng: np.random.Generator) -> Run:
    """A sine that runs through the band on every shaker, with phases of their own."""
    f = structure.frequencies_hz
    t = np.arange(n) * dt
    low, high = 0.5 * f[0], min(1.2 * f[-1], 0.45 / dt)
    phase = 2 * np.pi * (low * t + (high - low) * t**2 / (2 * n * dt))
    shifts = rng.uniform(0, 2 * np.pi, len(structure.inputs))
    return Run("sweep", _stored(np.sqrt(2) * FORCE * np.sin(phase + shifts[:, None])))


def free_decay(structure: Structure, n: int, dt: float, rng: np.random.Generator) -> Run:
    """A release from a static pull at a random place, nothing measured but the motion."""
    pull = np.zeros(structure.n)
    pull[int(rng.integers(structure.n))] = 20 * FORCE
    release = np.linalg.solve(structure.matrices[2], pull)
    return Run("free_decay", np.zeros((len(structure.inputs), n)), release)


RUNS = {"random": random, "impact": impact, "sweep": sweep, "free_decay": free_decay}


def _stored(u: Array) -> Array:
    """As a file of single precision holds it: the structure feels what the file says."""
    return u.astype(np.float32).astype(np.float64)
