"""Responses to forces that nobody measures, in numpy alone."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from identification.recording import Array, Record, Recording
from identification.systems import SecondOrder
from tests.systems import actuators, chain7, instrumented, noisy, sensors

DT = 0.027  # [s], as in Cambraia and Kurka (2010), section 6


def ambient(
    n_samples: int | Sequence[int],
    seed: int,
    *,
    structure: SecondOrder | None = None,
    quantity: str = "acceleration",
    driven: Sequence[str] | None = None,
    noise: float = 0.0,
    dt: float = DT,
) -> Recording:
    """Readings at every degree of freedom under white forces, each held for one sample; one record per length."""
    structure = chain7() if structure is None else structure
    inputs = actuators(structure.dofs if driven is None else driven)
    system = instrumented(structure, sensors(structure.dofs, quantity), inputs).sampled(dt)
    rng = np.random.default_rng(seed)
    lengths = [n_samples] if isinstance(n_samples, int) else n_samples
    records = []
    for n in lengths:
        outputs = system.simulate(rng.standard_normal((len(inputs), n)))
        records.append(output_record(noisy(outputs, noise, rng)))
    return Recording(tuple(records), (), system.outputs, 1 / dt)


def output_record(outputs: Array, kind: str = "ambient") -> Record:
    """A record of outputs alone."""
    return Record(kind, np.zeros((0, outputs.shape[1])), outputs)
