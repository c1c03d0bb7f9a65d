"""Frequency responses in the shape of averaged spectra, so that the figures of a test in time draw them as well."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from identification.response import FrequencyResponse
from lab.result import Result
from lab.show.signals import Spectra


def response_spectra(response: FrequencyResponse) -> Spectra:
    """Spectra of outputs under uncorrelated white inputs of unit density, with the measured responses behind them.

    Args:
        response: to forces.
    """
    H = response.values
    inputs = np.broadcast_to(
        np.eye(len(response.inputs), dtype=complex), (H.shape[0], *[len(response.inputs)] * 2)
    )
    # One average tells no coherence.
    return Spectra(response.frequency_hz, np.sum(np.abs(H) ** 2, axis=2).T, inputs, H, 1, "none", 0.0)


def drawable(result: Result, response: FrequencyResponse) -> Result:
    """The result with the sample rate that the last line is half of at most, where time is continuous."""
    return replace(result, sample_rate=min(result.sample_rate, 2 * float(response.frequency_hz[-1])))
