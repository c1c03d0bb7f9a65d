"""What output-only identification costs: CPU seconds and memory of `ssi_cov` and `stabilize`.

    python benchmarks/ssi.py            30 channels x 200 000 samples, and 7 channels x 20 000
    python benchmarks/ssi.py --disk     also 100 channels x 2 million samples in a file of 0.8 GB

Each case runs in an interpreter of its own with one thread, at least three times after a first; the median is printed.
Memory is what comes on top of the interpreter with its libraries and the recording. When pyoma2 is installed (`pip
install --group peers`), its SSI-cov runs on the same data in the same way. `ssi_accuracy.py` compares what both find.
"""

from __future__ import annotations

import argparse
import importlib.util
import json
import os
import resource
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
CASES = {"chain100": (30, 200_000, 50, 100), "chain7": (7, 20_000, 20, 40), "disk": (100, 2_000_000, 50, 60)}
"""Channels, samples, block rows, highest order."""


def chain_modes(n_masses: int):
    """Eigenvalues v and eigenvectors of a chain of unit masses and springs, fixed at one end: ω² = 2500 v."""
    import numpy as np
    import scipy.linalg

    shape = 2 * np.eye(n_masses) - np.eye(n_masses, k=1) - np.eye(n_masses, k=-1)
    shape[-1, -1] = 1
    return scipy.linalg.eigh(shape)


def measured_masses(n_masses: int, channels: int):
    """Masses with an accelerometer, evenly spread, shape (channels,)."""
    import numpy as np

    return np.linspace(n_masses // channels, n_masses, channels, dtype=int) - 1


def chain_response(n_masses: int, n_samples: int, channels: int, *, seed: int = 0):
    """Accelerations of a chain of unit masses under white forces on all, at evenly spread masses."""
    import numpy as np
    import scipy.linalg
    import scipy.signal

    value, vector = chain_modes(n_masses)
    rng = np.random.default_rng(seed)
    rows = measured_masses(n_masses, channels)
    response = np.zeros((channels, n_samples))
    for k in range(n_masses):
        # One mode at a time: q̈ + 2.5 v q̇ + 2500 v q = p, sampled with p held for 0.027 s.
        A = np.array([[0, 1], [-2500 * value[k], -2.5 * value[k]]])
        E = scipy.linalg.expm(np.block([[A, np.eye(2)[:, 1:]], [np.zeros((1, 3))]]) * 0.027)
        p = rng.standard_normal(n_samples)
        sampled = (E[:2, :2], E[:2, 2:], A[1:], np.ones((1, 1)))
        numerator, denominator = scipy.signal.ss2tf(*sampled)
        response += np.outer(vector[rows, k], scipy.signal.lfilter(numerator[0], denominator, p))
    return response


def recording_of(outputs):
    """A recording of accelerations at 1 / 0.027 Hz."""
    import numpy as np

    from identification.recording import Channel, Record, Recording

    channels = tuple(Channel(f"acc{i + 1}", "m/s^2") for i in range(outputs.shape[0]))
    record = Record("ambient", np.zeros((0, outputs.shape[1])), outputs)
    return Recording((record,), (), channels, 1 / 0.027)


def measured(work: Callable[[], object]) -> dict[str, float]:
    """CPU seconds, median and least of the runs, and the memory that the first added at its peak [MiB].

    There are three runs, or as many as fit into two seconds.
    """
    before = peak_memory(reset=True)
    work()
    memory = peak_memory() - before
    seconds: list[float] = []
    while len(seconds) < 3 or sum(seconds) < 2:
        start = time.process_time()
        work()
        seconds.append(time.process_time() - start)
    return {"cpu_s": statistics.median(seconds), "least_s": min(seconds), "memory_mib": memory}


def peak_memory(*, reset: bool = False) -> float:
    """Largest resident memory so far, or since the last reset where the system allows one [MiB]."""
    try:
        if reset:
            Path("/proc/self/clear_refs").write_text("5")
        status = Path("/proc/self/status").read_text()
        return float(status.split("VmHWM:")[1].split()[0]) / 1024
    except OSError:
        return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024


def lab_ssi(recording, n_rows: int, highest: int) -> Callable[[], object]:
    """Our own: all orders and their stabilization."""
    from identification.ssi import ssi_cov
    from identification.stability import stabilize

    return lambda: stabilize(ssi_cov(recording, orders=range(2, highest + 1, 2), n_rows=n_rows))


def pyoma2_ssi(recording, n_rows: int, highest: int, **settings: object) -> Callable[[], object]:
    """The same by pyoma2, with its own stabilization; gives its result."""
    import numpy as np
    from pyoma2.algorithms import SSI
    from pyoma2.setup import SingleSetup

    data = np.array(recording.records[0].outputs).T

    def work() -> object:
        setup = SingleSetup(data, fs=recording.sample_rate)
        algorithm = SSI(name="ssi", method="cov", br=n_rows, ordmax=highest, step=2, **settings)
        setup.add_algorithms(algorithm)
        setup.run_all()
        return algorithm.result

    return work


def on_disk(folder: Path):
    """A recording in a file, written block by block, and the time that reading it takes."""
    import numpy as np

    from lab.files.recording import RecordingWriter, load

    n_channels, n_samples, _, _ = CASES["disk"]
    template = recording_of(np.zeros((n_channels, 1)))
    path = folder / "long.h5"
    rng = np.random.default_rng(0)
    arguments = (path, (), template.outputs, template.sample_rate)
    with RecordingWriter(*arguments, dtype=np.float32) as writer:
        writer.start("ambient")
        for _ in range(n_samples // 20_000):
            block = rng.standard_normal((n_channels, 20_000), dtype=np.float32)
            writer.append(np.zeros((0, 20_000)), block[::-1] + np.roll(block, 1, axis=1))
    return load(path, lazy=True)


def run_case(case: str, package: str) -> dict[str, float]:
    """One case in this process."""
    channels, n_samples, n_rows, highest = CASES[case]
    if case == "disk":
        from identification.covariance import output_covariances

        with tempfile.TemporaryDirectory(dir=ROOT / "benchmarks") as folder:
            recording = on_disk(Path(folder))
            start = time.process_time()
            for _ in recording.records[0].blocks(1 << 14):
                pass
            reading = time.process_time() - start
            covariances = measured(lambda: output_covariances(recording, 2 * n_rows))["cpu_s"]
            alone = {"of which reading": reading, "and covariances": covariances - reading}
            return measured(lab_ssi(recording, n_rows, highest)) | alone
    n_masses = 100 if case == "chain100" else 7
    recording = recording_of(chain_response(n_masses, n_samples, channels))
    work = {"lab": lab_ssi, "pyoma2": pyoma2_ssi}[package](recording, n_rows, highest)
    return measured(work)


def main() -> None:
    """Print every case."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--disk", action="store_true", help="also the recording on disk")
    parser.add_argument("--case", nargs=2, help=argparse.SUPPRESS)
    arguments = parser.parse_args()
    sys.path.insert(0, str(ROOT))
    if arguments.case:
        print(json.dumps(run_case(*arguments.case)))
        return
    one_thread = {name: "1" for name in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS")}
    packages = ["lab"] + ["pyoma2"] * (importlib.util.find_spec("pyoma2") is not None)
    for case, (channels, n_samples, n_rows, highest) in CASES.items():
        if case == "disk" and not arguments.disk:
            continue
        print(f"{channels} channels x {n_samples} samples, {n_rows} block rows, orders 2 to {highest}")
        for package in packages if case != "disk" else ["lab"]:
            command = [sys.executable, __file__, "--case", case, package]
            done = subprocess.run(command, env=os.environ | one_thread, capture_output=True, text=True)
            if done.returncode:
                sys.exit(done.stderr)
            figures = json.loads(done.stdout.splitlines()[-1])
            cost = f"{figures.pop('cpu_s'):9.4f} CPU s (least {figures.pop('least_s'):.4f})"
            cost += f"{figures.pop('memory_mib'):8.1f} MiB"
            rest = "".join(f", {name} {value:.2f}" for name, value in figures.items())
            print(f"  {package:8}{cost}{rest}")


if __name__ == "__main__":
    main()
