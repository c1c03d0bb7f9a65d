"""Where the measured points are: nodes and the lines between them, as the group /geometry of a recording file.

In it lie the data sets nodes (n,), whole numbers, positions (n, 3) [m] and lines (m, 2), pairs of node numbers.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import h5py
import numpy as np

from identification.recording import Array, frozen
from lab.errors import FileError
from lab.files.recording_reader import check_format, one_line, open_file

GROUP = "geometry"


@dataclass(frozen=True, eq=False)
class Geometry:
    """Points of a structure.

    Attributes:
        nodes: their numbers, each once.
        positions: shape (n_nodes, 3) [m].
        lines: pairs of node numbers that are drawn joined.
    """

    nodes: tuple[int, ...]
    positions: Array
    lines: tuple[tuple[int, int], ...] = ()

    def __post_init__(self) -> None:
        object.__setattr__(self, "positions", frozen(self.positions))
        if self.positions.shape != (len(self.nodes), 3):
            raise FileError(
                f"{len(self.nodes)} nodes have positions of shape {self.positions.shape}; expected (n, 3)"
            )
        if len(set(self.nodes)) < len(self.nodes):
            double = next(node for node in self.nodes if self.nodes.count(node) > 1)
            raise FileError(f"node {double} appears twice; expected each number once")
        loose = {node for line in self.lines for node in line} - set(self.nodes)
        if loose:
            raise FileError(f"a line ends at node {min(loose)}, which has no position")


def add_geometry(geometry: Geometry, path: str | Path) -> None:
    """Puts a geometry into a recording file."""
    with h5py.File(path, "r+") as file:
        group = file.create_group(GROUP)
        group["nodes"] = np.array(geometry.nodes, dtype=np.int64)
        group["positions"] = geometry.positions
        group["lines"] = np.array(geometry.lines, dtype=np.int64).reshape(-1, 2)


def load_geometry(path: str | Path) -> Geometry | None:
    """The geometry in a recording file, or None where it has none.

    Raises:
        FileError: no such file, not a recording file, or damaged.
    """
    with one_line(Path(path)):
        file = open_file(Path(path))
        try:
            check_format(file)
            if GROUP not in file:
                return None
            nodes, positions, lines = (
                np.asarray(file[GROUP][name]) for name in ("nodes", "positions", "lines")
            )
            pairs = tuple((int(a), int(b)) for a, b in lines)
            return Geometry(tuple(int(node) for node in nodes), positions, pairs)
        except (ValueError, TypeError) as error:
            raise FileError(f"/{GROUP} is damaged ({error})") from None
        finally:
            file.close()
