"""Recording -> recording file: block by block, and the file is whole or absent."""

from __future__ import annotations

import os
import uuid
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from types import TracebackType
from typing import Any

import h5py
import numpy as np
from numpy.typing import ArrayLike, DTypeLike

from identification.recording import Channel, Recording
from lab.errors import FileError

FORMAT = "modal-recording"
VERSION = 1
RESERVED = {"format", "version", "title", "source", "kind", "sample_rate", "start_time", "note"}
"""Attributes with a field of their own; all others are the free `attributes`."""

CHUNK = 1 << 20
"""Size of a chunk on disk [bytes]."""

BLOCK = 1 << 18
"""Samples copied at a time."""


def save(recording: Recording, path: str | Path, *, dtype: DTypeLike = np.float64) -> None:
    """Write a recording; an existing file is replaced once the new one is whole.

    Args:
        recording: in memory or on disk.
        path: file to write.
        dtype: float64, or float32 for half the size.

    Raises:
        FileError: the file cannot be written.
    """
    with RecordingWriter(
        path,
        recording.inputs,
        recording.outputs,
        recording.sample_rate,
        title=recording.title,
        source=recording.source,
        attributes=recording.attributes,
        dtype=dtype,
    ) as writer:
        for record in recording.records:
            writer.start(record.kind, record.attributes, start_time=record.start_time, note=record.note)
            # Tells how many rows there are, even when there is no sample.
            writer.append(np.zeros((record.inputs.shape[0], 0)), np.zeros((record.outputs.shape[0], 0)))
            for inputs, outputs in record.blocks(BLOCK):
                writer.append(inputs, outputs)


class RecordingWriter:
    """A recording file that grows block by block: in a `with` statement, start a record, append to it.

    The blocks go to a hidden file beside `path`, which takes its name once whole, or vanishes.
    """

    def __init__(
        self,
        path: str | Path,
        inputs: Sequence[Channel],
        outputs: Sequence[Channel],
        sample_rate: float,
        *,
        title: str = "",
        source: str = "",
        attributes: Mapping[str, str | float] | None = None,
        dtype: DTypeLike = np.float64,
    ) -> None:
        """See `start` and `append`.

        Args:
            path: file to write; its folder must exist.
            inputs: input channels.
            outputs: output channels.
            sample_rate: [Hz].
            title: free text.
            source: where the data come from.
            attributes: further facts, not named like those of the format.
            dtype: float64, or float32 for half the size.

        Raises:
            FileError: the file cannot be written there.
        """
        self.path = Path(path)
        self._channels = {"inputs": tuple(inputs), "outputs": tuple(outputs)}
        self._sample_rate = float(sample_rate)
        self._dtype = np.dtype(dtype)
        self._hidden = self.path.with_name(f".{self.path.name}.{uuid.uuid4().hex[:8]}.part")
        self._streams: list[_Stream] = []
        self._n_records = 0
        try:
            self._file = h5py.File(self._hidden, "w")
        except OSError as error:
            raise FileError(
                f"{self.path}: cannot be written ({_reason(error)}); choose another place"
            ) from None
        try:
            self._file.attrs["format"] = FORMAT
            self._file.attrs["version"] = VERSION
            _describe(self._file, {"title": title, "source": source})
            self.annotate(attributes or {})
        except BaseException:
            self._discard()
            raise

    def annotate(self, attributes: Mapping[str, str | float]) -> None:
        """Add facts about the record being written, or about the whole recording when none was started yet.

        Raises:
            FileError: a name belongs to the format.
        """
        taken = sorted(RESERVED & set(attributes))
        if taken:
            raise FileError(f"{self.path}: attribute {taken[0]!r} belongs to the format; choose another name")
        _describe(self._streams[0].group if self._streams else self._file, attributes)

    def start(
        self,
        kind: str,
        attributes: Mapping[str, str | float] | None = None,
        *,
        start_time: str = "",
        note: str = "",
    ) -> None:
        """Begin the next record.

        Args:
            kind: what drives the structure.
            attributes: further facts about this record.
            start_time: ISO 8601, or empty.
            note: free text.
        """
        self._flush()
        group = self._file.create_group(f"records/{self._n_records}")
        self._n_records += 1
        group.attrs["kind"] = kind
        group.attrs["sample_rate"] = self._sample_rate
        _describe(group, {"start_time": start_time, "note": note})
        self._streams = [
            _Stream(group, side, channels, self._dtype) for side, channels in self._channels.items()
        ]
        self.annotate(attributes or {})

    def append(self, inputs: ArrayLike, outputs: ArrayLike) -> None:
        """Add samples to the record being written.

        Args:
            inputs: shape (n_inputs, n_samples), or no rows where none was measured.
            outputs: shape (n_outputs, n_samples).

        Raises:
            FileError: the disk is full.
        """
        try:
            for stream, block in zip(self._streams, (inputs, outputs), strict=True):
                stream.append(np.asarray(block, dtype=self._dtype))
        except OSError as error:
            raise FileError(f"{self.path}: cannot be written ({_reason(error)})") from None

    def __enter__(self) -> RecordingWriter:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if kind is not None:
            self._discard()
            return
        try:
            self._flush()
            self._file.close()
            os.replace(self._hidden, self.path)
        except OSError as failure:
            self._discard()
            raise FileError(f"{self.path}: cannot be written ({_reason(failure)})") from None

    def _flush(self) -> None:
        for stream in self._streams:
            stream.flush()

    def _discard(self) -> None:
        self._streams = []
        self._file.close()
        self._hidden.unlink(missing_ok=True)


class _Stream:
    """One data set that grows along time, written in whole chunks."""

    def __init__(self, group: Any, side: str, channels: tuple[Channel, ...], dtype: np.dtype[Any]) -> None:
        self.group, self.side, self.channels, self.dtype = group, side, channels, dtype
        self.chunk = max(1, CHUNK // (dtype.itemsize * max(1, len(channels))))
        self.pending: list[np.ndarray] = []
        self.n_pending = 0
        self.data: Any = None

    def append(self, block: np.ndarray) -> None:
        self.pending.append(block)
        self.n_pending += block.shape[1]
        if self.n_pending >= self.chunk:
            self._write(self.n_pending // self.chunk * self.chunk)

    def flush(self) -> None:
        self._write(self.n_pending)

    def _write(self, n: int) -> None:
        rows = self.pending[0].shape[0] if self.pending else len(self.channels)
        block = np.concatenate(self.pending, axis=1) if self.pending else np.zeros((rows, 0), self.dtype)
        self.pending, self.n_pending = [block[:, n:]], block.shape[1] - n
        if self.data is None:
            self._create(rows, n)
        if n and rows:
            old = self.data.shape[1]
            self.data.resize(old + n, axis=1)
            self.data[:, old:] = block[:, :n]

    def _create(self, rows: int, n: int) -> None:
        # A record shorter than a chunk must not occupy a whole one.
        chunks = (rows, max(1, min(self.chunk, n))) if rows else None
        limits = (rows, None) if rows else None
        shape = (rows, 0) if rows else (0, n)
        self.data = self.group.create_dataset(self.side, shape, self.dtype, chunks=chunks, maxshape=limits)
        attributes = self.data.attrs
        attributes["names"] = _strings(channel.name for channel in self.channels)
        attributes["units"] = _strings(channel.unit for channel in self.channels)
        attributes["dofs"] = _strings(channel.dof for channel in self.channels)
        attributes["factors"] = np.array([channel.factor for channel in self.channels], dtype=float)


def _strings(values: Iterable[str]) -> np.ndarray:
    return np.array(list(values), dtype=h5py.string_dtype())


def _describe(group: Any, facts: Mapping[str, str | float]) -> None:
    for name, value in facts.items():
        if value != "" or name not in RESERVED:
            group.attrs[name] = value


def _reason(error: OSError) -> str:
    return error.strerror or " ".join(str(error).split())
