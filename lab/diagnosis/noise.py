"""Noise: how much of each output is noise, as the fit tells it and not as any setting says."""

from __future__ import annotations

import numpy as np

from identification.recording import Array, Recording
from lab.diagnosis.gain import noise_floor
from lab.diagnosis.outcome import Quantity


def noise_of(residual: Array, recording: Recording) -> dict[str, Quantity]:
    """Noise of each output by channel: RMS of what its residual's own past does not foretell, with its error bar.

    Args:
        residual: of the final fit, (n_outputs, n) [unit of each output]; n above twice the past it is foretold from.
        recording: whose outputs these are.
    """
    found = {}
    # Of n Gaussian samples the RMS is known to 1 / √(2 n).
    relative = 1 / np.sqrt(2 * residual.shape[1])
    for channel, e in zip(recording.outputs, residual, strict=True):
        rms = float(np.sqrt(np.mean(e**2)))
        level = rms * noise_floor(e[None], e[None]) if rms > 0 else 0.0
        found[channel.name] = Quantity(level, float(relative * level), channel.unit)
    return found
