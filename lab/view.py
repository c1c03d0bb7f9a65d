"""An output folder in the Rerun viewer."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

from lab.errors import FileError, LabError


def view(folder: str | Path) -> None:
    """Open `run.rrd` of an output folder in the Rerun viewer, and return when that is closed.

    Args:
        folder: written by the lab, or the .rrd file itself.

    Raises:
        FileError: there is no `run.rrd`.
        LabError: there is no display, or the viewer does not start.
    """
    path = Path(folder)
    path = path if path.suffix == ".rrd" else path / "run.rrd"
    if not path.is_file():
        raise FileError(
            f"{path}: no such file; expected a folder that `lab run`, `lab identify` or `lab diagnose` wrote"
        )
    if not _has_display():
        raise LabError(
            f"there is no display here to show {path}; copy it to a machine that has one and run "
            f"'rerun {path.name}' there, or open report.html in a browser"
        )
    done = subprocess.run([sys.executable, "-m", "rerun", str(path)], check=False)
    if done.returncode:
        raise LabError(
            f"the Rerun viewer ended with status {done.returncode}; open report.html in a browser instead"
        )


def _has_display() -> bool:
    if sys.platform in ("win32", "darwin"):
        return True
    return bool(os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY"))
