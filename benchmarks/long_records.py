"""What identification of long records with measured forces costs, with its error bars: CPU seconds and memory.

    python benchmarks/long_records.py                   300 000 samples of 8 outputs and 3 forces
    python benchmarks/long_records.py --samples 30000   another length
    python benchmarks/long_records.py --rows            every regression by its rows, as of short records

The structure is a chain of eight masses, with 2 % of noise; one thread.
"""

from __future__ import annotations

import argparse
import os
import resource
import sys
import time
from pathlib import Path

for library in ("OPENBLAS", "OMP", "MKL"):
    os.environ.setdefault(f"{library}_NUM_THREADS", "1")
sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

import numpy as np  # noqa: E402

from identification import input_fit, observer  # noqa: E402
from identification.identify import identify  # noqa: E402
from identification.systems import SecondOrder, StateSpace  # noqa: E402
from tests.systems import actuators, instrumented, recorded, sensors, with_noise  # noqa: E402


def chain8() -> StateSpace:
    """Eight masses of 1 kg in a chain fixed at one end, an accelerometer on each, forces on three, sampled at 64 Hz."""
    shape = 2 * np.eye(8) - np.eye(8, k=1) - np.eye(8, k=-1)
    shape[-1, -1] = 1
    structure = SecondOrder(np.eye(8), shape, 2500 * shape, tuple(f"x{k}" for k in range(1, 9)))
    return instrumented(structure, sensors(structure.dofs), actuators(("x1", "x4", "x7"))).sampled(1 / 64)


def main() -> None:
    """Prints one line for the estimates alone, and one with error bars."""
    arguments = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    arguments.add_argument("--samples", type=int, default=300_000)
    arguments.add_argument("--rows", action="store_true")
    asked = arguments.parse_args()
    if asked.rows:
        input_fit.LONG = observer.LONG = asked.samples
    rng = np.random.default_rng(0)
    recording = with_noise(recorded(chain8(), [rng.standard_normal((3, asked.samples))]), 0.02, rng)
    for uncertainty in (False, True):
        start = time.process_time()
        found = identify(recording, uncertainty=uncertainty)
        seconds = time.process_time() - start
        memory = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
        what = "with error bars" if uncertainty else "estimates alone"
        print(f"{what}: {seconds:.1f} s, {memory:.0f} MiB at most, {len(found.modes)} modes")


if __name__ == "__main__":
    main()
