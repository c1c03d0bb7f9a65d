"""Frequency responses as the estimators leave them and the fits take them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from identification.errors import IdentificationError
from identification.recording import Array, Channel, frozen, named_rows

Complex = NDArray[np.complex128]

SCALES = ("known", "unknown per input", "unknown per response")
"""What a test bench may leave open: nothing, one complex factor on all responses to an input, or one on every response."""


@dataclass(frozen=True, eq=False, repr=False)
class FrequencyResponse:
    """Responses per unit of input, line by line.

    Attributes:
        frequency_hz: rising, shape (n_frequencies,).
        values: shape (n_frequencies, n_outputs, n_inputs) [output unit / input unit].
        dt: sample time of the signals [s]; the response is that to forces held over each sample.
        inputs: input channels; the references where only outputs were measured.
        outputs: output channels.
        coherence: multiple coherence of each output with all inputs, shape (n_frequencies, n_outputs); None
            where there are too few averages to tell.
        variance: E|ΔH|², shape (n_frequencies, n_outputs, n_inputs); None likewise.
        weight: of each line in a fit, shape (n_frequencies,): one over the standard deviation of H under noise of
            one power at all lines, 1 on average; None for equal weights.
        n_averages: number of independent pieces of record behind each value.
        decay: rate of the exponential window on the signals [1/s], by which poles appear shifted.
        scale: which complex factors on the values nobody knows, one of `SCALES`.
        notes: what was chosen and why, one sentence each.
    """

    frequency_hz: Array
    values: Complex
    dt: float
    inputs: tuple[Channel, ...]
    outputs: tuple[Channel, ...]
    coherence: Array | None = None
    variance: Array | None = None
    weight: Array | None = None
    n_averages: float = 1.0
    decay: float = 0.0
    scale: str = "known"
    notes: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        for name in ("frequency_hz", "coherence", "variance", "weight"):
            if getattr(self, name) is not None:
                object.__setattr__(self, name, frozen(getattr(self, name)))
        values = np.array(self.values, dtype=np.complex128)
        values.setflags(write=False)
        object.__setattr__(self, "values", values)
        if self.scale not in SCALES:
            raise IdentificationError(f"the scale is {self.scale!r}; expected one of {', '.join(SCALES)}")
        expected = (self.frequency_hz.size, len(self.outputs), len(self.inputs))
        if values.shape != expected:
            raise IdentificationError(f"frequency responses have shape {values.shape}; expected {expected}")
        if not np.all(np.isfinite(values)):
            line, row, column = np.argwhere(~np.isfinite(values))[0]
            raise IdentificationError(
                f"the response of {self.outputs[row].name!r} to {self.inputs[column].name!r} at "
                f"{self.frequency_hz[line]:.6g} Hz is not finite; leave the line or the channel out"
            )

    def between(self, low: float, high: float) -> FrequencyResponse:
        """The lines with low <= f <= high [Hz].

        Raises:
            IdentificationError: there is none.
        """
        keep = (self.frequency_hz >= low) & (self.frequency_hz <= high)
        if not keep.any():
            raise IdentificationError(
                f"no line lies between {low} and {high} Hz; there are {self.frequency_hz.size} from "
                f"{self.frequency_hz[0]:g} to {self.frequency_hz[-1]:g} Hz"
            )
        return self.take(keep)

    def take(self, lines: NDArray[np.bool_] | slice) -> FrequencyResponse:
        """The given lines."""
        coherence, variance, weight = (
            None if each is None else each[lines] for each in (self.coherence, self.variance, self.weight)
        )
        return replace(
            self,
            frequency_hz=self.frequency_hz[lines],
            values=self.values[lines],
            coherence=coherence,
            variance=variance,
            weight=weight,
        )

    def select(
        self, *, inputs: Sequence[str] | None = None, outputs: Sequence[str] | None = None
    ) -> FrequencyResponse:
        """The responses of the named outputs to the named inputs, in the order given (all when None).

        Raises:
            RecordingError: a name is not among the channels.
        """
        columns, channels_in = named_rows(self.inputs, inputs, "input")
        rows, channels_out = named_rows(self.outputs, outputs, "output")
        return replace(
            self,
            values=self.values[:, rows][:, :, columns],
            inputs=channels_in,
            outputs=channels_out,
            coherence=None if self.coherence is None else self.coherence[:, rows],
            variance=None if self.variance is None else self.variance[:, rows][:, :, columns],
        )

    def __repr__(self) -> str:
        return (
            f"FrequencyResponse({len(self.outputs)} outputs, {len(self.inputs)} inputs, "
            f"{self.frequency_hz.size} lines up to {self.frequency_hz[-1]:g} Hz, "
            f"{self.n_averages:.3g} averages)"
        )
