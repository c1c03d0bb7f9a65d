"""Prints the seconds and the memory that `lab diagnose` takes from command to files: 5 and 16 masses, 8192 samples.

Cases are those of the blind trials (family "singles", with every mass measured), written as files. Every command is run several
times; the median counts. Memory is that of the command and its helpers together, looked up on Linux every 50 ms. The first
run of a fresh installation compiles the kernels and is slower.

Run `python benchmarks/diagnosis_time.py [REPETITIONS]`.
"""

from __future__ import annotations

import json
import os
import statistics
import subprocess
import sys
import tempfile
import time
from dataclasses import replace
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

from benchmarks.blind import written
from benchmarks.blind_cases.draw import FAMILIES, draw

CASES = ((5, "attached_oscillator", 1), (5, "sensor_lag", 2), (5, "freeplay", 3), (16, "freeplay", 703))
"""Masses, what is hidden, and the seed."""
N_SAMPLES = 8192
PAGE = os.sysconf("SC_PAGE_SIZE") if hasattr(os, "sysconf") else 4096


def run(folder: Path) -> tuple[float, float]:
    """Seconds of one command, and memory at its peak [MB]; NaN where the system does not tell."""
    command = [
        *(sys.executable, "-m", "lab", "diagnose", str(folder / "recording.h5")),
        *("--model", str(folder / "model.xml"), "--out", str(folder / "answer"), "--force", "--quiet"),
    ]
    start, most = time.perf_counter(), float("nan")
    # A session of its own, by which its helpers are known.
    with subprocess.Popen(command, start_new_session=True) as process:
        while process.poll() is None:
            most = max(memory(process.pid), most) if most == most else memory(process.pid)
            time.sleep(0.05)
    seconds = time.perf_counter() - start
    if process.returncode:
        raise SystemExit(f"{' '.join(command)} ended with {process.returncode}")
    return seconds, most


def memory(session: int) -> float:
    """Resident memory of all processes of a session [MB]; NaN where the system does not tell."""
    pages = []
    for entry in Path("/proc").glob("[0-9]*/stat"):
        try:
            fields = entry.read_text().rpartition(")")[2].split()
        except OSError:
            continue
        if int(fields[3]) == session:
            pages.append(int(fields[21]))
    return sum(pages) * PAGE / 1e6 if pages else float("nan")


def main(repetitions: int) -> None:
    """One line per case."""
    for masses, cause, seed in CASES:
        kind = replace(FAMILIES["singles"], masses=(masses, masses), n_samples=N_SAMPLES)
        case = draw(seed, "singles", kind=kind, only=cause)
        with tempfile.TemporaryDirectory() as name:
            folder = Path(name)
            written(case, folder)
            runs = [run(folder) for _ in range(repetitions)]
            answer = json.loads((folder / "answer" / "diagnosis.json").read_text(encoding="utf-8"))
        named = "; ".join(f"{f['cause']}@{f['location']}" for f in answer["findings"]) or "nothing"
        hidden = "; ".join(f"{h.cause}@{h.location}" for h in case.hidden)
        seconds = statistics.median(s for s, _ in runs)
        print(
            f"{masses} masses, {hidden}: {answer['verdict']}, {named}; {seconds:.1f} s, {max(m for _, m in runs):.0f} MB",
            flush=True,
        )


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 3)
