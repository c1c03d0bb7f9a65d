"""Survey: what the checks look at together, each pass over the data made once and only when asked for."""

from __future__ import annotations

from collections.abc import Iterator
from functools import cached_property

import numpy as np
import scipy.signal

from identification.errors import IdentificationError
from identification.recording import Array, Channel, Record, Recording
from lab.checks.extremes import Extremes, extremes_of
from lab.checks.levels import Levels, levels_of
from lab.checks.lines import Lines, lines_of
from lab.checks.outliers import Outlier, autoregression, outliers_of
from lab.checks.pairs import Pairs, pairs_of
from lab.checks.remark import Trace
from lab.rig import Rig

WHITENING = 32
"""Order of the filters that flatten spectra."""

BLOCK_VALUES = 1 << 21
"""Values held in memory at a time."""


class Sheet:
    """One record as rows of channels, inputs first, read block by block."""

    def __init__(self, recording: Recording, number: int) -> None:
        self.number = number
        self.record: Record = recording.records[number]
        self.n_inputs: int = self.record.inputs.shape[0]
        self.channels: tuple[Channel, ...] = recording.inputs[: self.n_inputs] + recording.outputs
        self.sample_rate: float = recording.sample_rate
        self.n_samples: int = self.record.n_samples

    def blocks(self, *, multiple: int = 1) -> Iterator[Array]:
        """Consecutive blocks, shape (n_channels, n), all but the last a whole multiple of samples long."""
        size = max(BLOCK_VALUES // max(len(self.channels), 1) // multiple, 1) * multiple
        for inputs, outputs in self.record.blocks(size):
            yield np.vstack([inputs, outputs]) if self.n_inputs else outputs

    def stretch(self, row: int, start: int, stop: int) -> Array:
        """Samples start to stop of one channel."""
        side, k = (
            (self.record.inputs, row) if row < self.n_inputs else (self.record.outputs, row - self.n_inputs)
        )
        return np.asarray(side[k : k + 1, max(start, 0) : stop], dtype=float)[0]

    @cached_property
    def levels(self) -> Levels:
        """Sizes, missing and repeated samples of every channel."""
        return levels_of(self.blocks, self.n_samples, len(self.channels))

    @cached_property
    def extremes(self) -> tuple[Extremes, ...]:
        """What every channel does at its largest and smallest values."""
        return extremes_of(self.blocks, self.levels)

    @cached_property
    def lines(self) -> Lines:
        """Spectra of the record."""
        return lines_of(self.blocks, self.n_samples, len(self.channels), self.n_inputs, self.sample_rate)

    @cached_property
    def coherence(self) -> Array:
        """Multiple coherence of the outputs with the inputs, shape (n_lines, n_outputs).

        It is that of the outputs behind a filter that makes their spectra flat: the same for any filter, and long
        ringing does not leak out of the pieces.
        """
        flat = lines_of(self._whitened, self.n_samples, len(self.channels), self.n_inputs, self.sample_rate)
        return flat.coherence()

    def explained(self) -> Array:
        """Share of each output's power that the inputs explain, shape (n_outputs,); NaN for a silent one."""
        # The lowest lines hold what the window leaves of the mean.
        power = self.lines.power[self.n_inputs :, 2:].T
        total, part = power.sum(axis=0), (power * self.coherence[2:]).sum(axis=0)
        return np.asarray(np.divide(part, total, out=np.full(total.size, np.nan), where=total > 0))

    def _whitened(self, *, multiple: int = 1) -> Iterator[Array]:
        filters: list[Array] | None = None
        for x in self.blocks(multiple=multiple):
            if filters is None:
                known = (autoregression(np.nan_to_num(row - np.nanmean(row)), WHITENING) for row in x)
                filters = [np.ones(1) if pi is None else pi for pi in known]
                memory = [np.zeros(pi.size - 1) for pi in filters]
            flat = x.copy()
            for row in range(self.n_inputs, len(x)):
                flat[row], memory[row] = scipy.signal.lfilter(filters[row], [1.0], x[row], zi=memory[row])
            yield flat

    @cached_property
    def outliers(self) -> tuple[tuple[Outlier, ...], ...]:
        """Samples that the past of their own channel does not foretell, channel by channel."""
        return tuple(outliers_of(self.blocks, self.levels))

    def traces(self) -> list[Trace]:
        """All channels."""
        return [
            Trace(self.number, self.record, row, channel, row < self.n_inputs)
            for row, channel in enumerate(self.channels)
        ]


class Survey:
    """A recording, the model it should fit where there is one, and what was measured about it so far.

    Attributes:
        recording: as read from its file.
        rig: the model with the recording's channels connected; None when there is none.
        sheets: one for each record.
    """

    def __init__(self, recording: Recording, rig: Rig | None = None) -> None:
        self.recording = recording
        self.rig = rig
        self.sheets = tuple(Sheet(recording, number) for number in range(len(recording.records)))

    @property
    def pairs(self) -> Pairs | None:
        """Modes of the recording beside the model's; None without a model or without common modes."""
        return self._pairing[0]

    @property
    def why_unpaired(self) -> str:
        """Why there are no pairs."""
        return self._pairing[1]

    @cached_property
    def _pairing(self) -> tuple[Pairs | None, str]:
        if self.rig is None:
            return None, "there is no model"
        try:
            found = pairs_of(self.recording, self.rig)
        except IdentificationError as error:
            return None, str(error)
        return found, "" if found else "no mode of the recording lies near one of the model's"

    @property
    def same_units(self) -> bool:
        """Whether the recorded outputs have the units of the model's."""
        outputs = self.rig.outputs if self.rig is not None else self.recording.outputs
        return all(a.unit == b.unit for a, b in zip(self.recording.outputs, outputs, strict=True))
