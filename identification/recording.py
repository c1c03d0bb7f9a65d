"""Recording: named signals with units and one sample time, as a test bench delivers them.

Sample k of an input is the force held over [t_k, t_k + dt); sample k of an output is read at t_k with that force
acting. Time is the last axis of every signal, and everything is in SI units.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from identification.errors import RecordingError

Array = NDArray[np.float64]

KINDS = (
    "pulse",
    "impact",
    "random",
    "burst_random",
    "sweep",
    "multisine",
    "ambient",
    "free_decay",
    "other",
)

QUANTITIES = {
    "m": "displacement",
    "rad": "displacement",
    "m/s": "velocity",
    "rad/s": "velocity",
    "m/s^2": "acceleration",
    "rad/s^2": "acceleration",
    "N": "force",
    "N m": "force",
    "V": "voltage",
    "A": "current",
    "Pa": "pressure",
    "K": "temperature",
    "1": "ratio",
}
"""What each SI unit measures."""

DERIVATIVE = {"displacement": 0, "velocity": 1, "acceleration": 2}
"""How many time derivatives separate a motion quantity from displacement."""


class Signals(Protocol):
    """Rows of samples that can be sliced: an array, or a data set on disk."""

    @property
    def shape(self) -> tuple[int, ...]:
        """(n_channels, n_samples)."""

    def __getitem__(self, key: Any, /) -> Any:
        """Samples as an array."""


@dataclass(frozen=True)
class Channel:
    """One input or output signal.

    Attributes:
        name: the channel's own name, unique among the inputs or among the outputs.
        unit: SI unit.
        dof: the degree of freedom that the channel drives or reads; empty when unknown.
        factor: reading per unit of motion of `dof`, or generalized force on `dof` per unit of input; -1 for a channel
            mounted against the positive direction.
    """

    name: str
    unit: str
    dof: str = ""
    factor: float = 1.0

    def __post_init__(self) -> None:
        if self.unit not in QUANTITIES:
            raise RecordingError(
                f"channel {self.name!r} has unit {self.unit!r}; expected one of {', '.join(QUANTITIES)}"
            )

    @property
    def quantity(self) -> str:
        """What the channel measures, such as displacement, velocity, acceleration or force."""
        return QUANTITIES[self.unit]


def frozen(values: Any) -> Array:
    """A read-only float64 copy of `values`.

    Args:
        values: numbers in an array of any shape.

    Returns:
        An array that cannot be written to.
    """
    array = np.array(values, dtype=np.float64)
    array.setflags(write=False)
    return array


@dataclass(frozen=True, eq=False, repr=False)
class Record:
    """One test run.

    Attributes:
        kind: what drove the structure, one of `KINDS`.
        inputs: measured forces, shape (n_inputs, n_samples); no rows when none was measured.
        outputs: responses, shape (n_outputs, n_samples).
        start_time: ISO 8601, or empty.
        note: free text.
        attributes: further facts that travel with the record.

    Arrays are copied and made read-only; data sets on disk are kept as they are and read slice by slice.
    """

    kind: str
    inputs: Signals
    outputs: Signals
    start_time: str = ""
    note: str = ""
    attributes: Mapping[str, str | float] = field(default_factory=dict)

    def __post_init__(self) -> None:
        if self.kind not in KINDS:
            raise RecordingError(f"record kind {self.kind!r} is unknown; expected one of {', '.join(KINDS)}")
        for side in ("inputs", "outputs"):
            signals = getattr(self, side)
            if isinstance(signals, np.ndarray | list | tuple):
                signals = frozen(signals)
                object.__setattr__(self, side, signals)
            if len(signals.shape) != 2:
                raise RecordingError(
                    f"{side} have shape {signals.shape}; expected (n_channels, n_samples) with time last"
                )
        if self.inputs.shape[0] and self.inputs.shape[1] != self.outputs.shape[1]:
            raise RecordingError(
                f"inputs have {self.inputs.shape[1]} samples and outputs {self.outputs.shape[1]}; expected equal lengths"
            )

    @property
    def n_samples(self) -> int:
        """Samples per channel."""
        return self.outputs.shape[1]

    def blocks(self, size: int) -> Iterator[tuple[Array, Array]]:
        """Inputs and outputs in consecutive blocks of at most `size` samples."""
        for start in range(0, self.n_samples, size):
            stop = min(start + size, self.n_samples)
            inputs = self.inputs[:, start:stop] if self.inputs.shape[0] else np.zeros((0, stop - start))
            yield (
                np.asarray(inputs, dtype=np.float64),
                np.asarray(self.outputs[:, start:stop], dtype=np.float64),
            )

    def __repr__(self) -> str:
        return (
            f"Record({self.kind}, {self.inputs.shape[0]} inputs, {self.outputs.shape[0]} outputs, "
            f"{self.n_samples} samples)"
        )


@dataclass(frozen=True, eq=False, repr=False)
class Recording:
    """Several records that share channels and sample rate.

    Attributes:
        records: at least one record.
        inputs: input channels; a record may have all of them, or none.
        outputs: output channels.
        sample_rate: [Hz].
        title: free text.
        source: where the data come from.
        attributes: further facts that travel with the recording.

    Raises:
        RecordingError: shapes, names or rate do not fit together.
    """

    records: tuple[Record, ...]
    inputs: tuple[Channel, ...]
    outputs: tuple[Channel, ...]
    sample_rate: float
    title: str = ""
    source: str = ""
    attributes: Mapping[str, str | float] = field(default_factory=dict)

    def __post_init__(self) -> None:
        object.__setattr__(self, "records", tuple(self.records))
        object.__setattr__(self, "inputs", tuple(self.inputs))
        object.__setattr__(self, "outputs", tuple(self.outputs))
        if not self.records:
            raise RecordingError("the recording holds no record; expected at least one")
        if not (np.isfinite(self.sample_rate) and self.sample_rate > 0):
            raise RecordingError(f"sample rate is {self.sample_rate} Hz; expected a positive number")
        for side, channels in (("input", self.inputs), ("output", self.outputs)):
            names = [channel.name for channel in channels]
            doubles = sorted({name for name in names if names.count(name) > 1})
            if doubles:
                raise RecordingError(f"{side} channel {doubles[0]!r} appears twice; expected unique names")
        for number, record in enumerate(self.records):
            if record.outputs.shape[0] != len(self.outputs):
                raise RecordingError(
                    f"record {number} has {record.outputs.shape[0]} output rows for {len(self.outputs)} output channels"
                )
            if record.inputs.shape[0] not in (0, len(self.inputs)):
                raise RecordingError(
                    f"record {number} has {record.inputs.shape[0]} input rows for {len(self.inputs)} input channels; "
                    "expected all of them or none"
                )

    @property
    def dt(self) -> float:
        """Sample time [s]."""
        return 1.0 / self.sample_rate

    @property
    def n_samples(self) -> int:
        """Samples of all records together."""
        return sum(record.n_samples for record in self.records)

    @property
    def duration(self) -> float:
        """Length of all records together [s]."""
        return self.n_samples / self.sample_rate

    def select(
        self, *, inputs: Sequence[str] | None = None, outputs: Sequence[str] | None = None
    ) -> Recording:
        """The recording with only the named channels, in the order given (all when None).

        Raises:
            RecordingError: a name is not among the channels.
        """
        rows_in, channels_in = named_rows(self.inputs, inputs, "input")
        rows_out, channels_out = named_rows(self.outputs, outputs, "output")
        records = tuple(
            replace(
                record,
                inputs=_take(record.inputs, rows_in),
                outputs=_take(record.outputs, rows_out),
            )
            for record in self.records
        )
        return replace(self, records=records, inputs=channels_in, outputs=channels_out)

    def cut(self, start: float, stop: float) -> Recording:
        """The samples with start <= t < stop [s] of every record, as arrays in memory.

        Raises:
            RecordingError: nothing is left of a record.
        """
        a, b = (round(limit * self.sample_rate) for limit in (start, stop))
        records = []
        for number, record in enumerate(self.records):
            if a < 0 or a >= min(b, record.n_samples):
                raise RecordingError(
                    f"cut from {start} s to {stop} s leaves nothing of record {number}, which lasts "
                    f"{record.n_samples / self.sample_rate} s"
                )
            inputs = record.inputs[:, a:b] if record.inputs.shape[0] else record.inputs
            records.append(
                replace(record, inputs=np.asarray(inputs), outputs=np.asarray(record.outputs[:, a:b]))
            )
        return replace(self, records=tuple(records))

    def require_complete(self, *, but_outputs: bool = False) -> None:
        """Check that no sample is missing.

        Args:
            but_outputs: whether samples of the outputs may be missing (NaN, not infinite).

        Raises:
            RecordingError: a sample is NaN or infinite; names the channel and the first time.
        """
        for number, record in enumerate(self.records):
            first = 0
            for blocks in record.blocks(1 << 18):
                for channels, block in zip((self.inputs, self.outputs), blocks, strict=True):
                    # A finite sum proves that all is finite, at a fraction of the cost of looking.
                    if np.isfinite(np.sum(block)):
                        continue
                    bad = np.isinf(block) if but_outputs and channels is self.outputs else ~np.isfinite(block)
                    if not bad.any():
                        continue
                    column = int(np.argmax(bad.any(axis=0)))
                    row, sample = int(np.argmax(bad[:, column])), first + column
                    raise RecordingError(
                        f"channel {channels[row].name!r} of record {number} misses a sample at "
                        f"t = {sample / self.sample_rate:.6g} s ({int(bad.sum())} missing near there); "
                        "cut the record to a complete stretch or leave the channel out"
                    )
                first += blocks[1].shape[1]

    def __repr__(self) -> str:
        kinds = ", ".join(sorted({record.kind for record in self.records}))
        return (
            f"Recording({len(self.records)} records ({kinds}), {len(self.inputs)} inputs, {len(self.outputs)} outputs, "
            f"{self.sample_rate:g} Hz, {self.duration:g} s)"
        )


def named_rows(
    channels: Sequence[Channel], names: Iterable[str] | None, side: str
) -> tuple[list[int], tuple[Channel, ...]]:
    """Positions of the named channels, and the channels, in the order of the names (all when None).

    Args:
        channels: those that there are.
        names: those asked for.
        side: "input" or "output", for the message.

    Returns:
        Positions, and channels.

    Raises:
        RecordingError: a name is not among the channels.
    """
    if names is None:
        return list(range(len(channels))), tuple(channels)
    position = {channel.name: row for row, channel in enumerate(channels)}
    rows = []
    for name in names:
        if name not in position:
            raise RecordingError(
                f"{side} channel {name!r} does not exist; there are {', '.join(position) or 'none'}"
            )
        rows.append(position[name])
    return rows, tuple(channels[row] for row in rows)


def _take(signals: Signals, rows: list[int]) -> Signals:
    if not signals.shape[0] or rows == list(range(signals.shape[0])):
        return signals
    return np.asarray(signals[:, :])[rows]
