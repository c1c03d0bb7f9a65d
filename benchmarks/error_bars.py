"""Whether error bars are true: reported standard deviation over true spread, and how often ±2 of it hold the truth.

    python benchmarks/error_bars.py [REPETITIONS]

Each case repeats a test with new noise (and new forces, where they are random) and identifies it anew. A spread
over n tests is itself known to 1/√(2 n), and so a ratio of one scatters by that much.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

ROOT = Path(__file__).resolve().parent.parent
sys.path.insert(0, str(ROOT))

from identification.identify import Identification, identify  # noqa: E402
from identification.modes import Modes  # noqa: E402
from identification.recording import Array, Recording  # noqa: E402
from identification.systems import SecondOrder  # noqa: E402
from tests.ambient import ambient  # noqa: E402
from tests.systems import (  # noqa: E402
    chain3,
    chain7,
    instrumented,
    paper_chain3,
    pulse_recording,
    recorded,
    sensors,
    with_noise,
)

Generator = np.random.Generator


@dataclass(frozen=True)
class Case:
    """A test that can be repeated, and its truth."""

    make: Callable[[Generator], Recording]
    truth: Modes
    settings: dict[str, object]
    matrices: SecondOrder | None = None


@dataclass(frozen=True)
class Calibration:
    """Over all repetitions, shape (2, n_modes): frequency in the first row, damping ratio in the second.

    Attributes:
        ratio: root mean square of the reported standard deviations over the true spread.
        coverage: share of tests in which the truth lies within ±2 reported standard deviations.
        bias: mean error over the true spread.
        n_tests: in which all modes were found.
        seconds: median time of an identification.
        matrix_ratio: as `ratio`, shape (3, n_dofs, n_dofs) for M, C_d and K; None where there are none.
        matrix_coverage: likewise.
    """

    ratio: Array
    coverage: Array
    bias: Array
    n_tests: int
    seconds: float
    matrix_ratio: Array | None
    matrix_coverage: Array | None


def pulses(rng: Generator) -> Recording:
    """Both forces of the founding experiment in turn, with 5 % noise."""
    return with_noise(pulse_recording(paper_chain3(), 400), 0.05, rng)


def random_forces(rng: Generator) -> Recording:
    """Two records of 25 s of the founding experiment under white forces, with 5 % noise."""
    system = paper_chain3()
    forces = [rng.standard_normal((2, 500)) for _ in range(2)]
    return with_noise(recorded(system, forces), 0.05, rng)


def short_pulses(rng: Generator) -> Recording:
    """Ten seconds after each pulse, less than the first mode takes to fall to 1 / e, with 4 % noise."""
    return with_noise(pulse_recording(paper_chain3(), 200), 0.04, rng)


def released(rng: Generator) -> Recording:
    """Two free decays of all three masses, read by accelerometers, with 5 % noise."""
    system = instrumented(chain3(), sensors(chain3().dofs), ()).sampled(0.05)
    still = [np.zeros((0, 400))] * 2
    start = [np.array([1.0, 0, 0, 0, 0, 0]), np.array([0, 0, 1.0, 0, 0, 0])]
    return with_noise(recorded(system, still, kind="free_decay", initial=start), 0.05, rng)


def wind(rng: Generator) -> Recording:
    """Seven masses under white forces that nobody measures, with 5 % noise."""
    return ambient(20_000, int(rng.integers(1 << 31)), noise=0.05)


CHAIN7 = instrumented(chain7(), sensors(chain7().dofs), ()).modes()
CHAIN3 = paper_chain3().modes()
CASES = {
    "chain3 pulse era": Case(pulses, CHAIN3, {"method": "era", "order": 6, "dofs": chain3().dofs}, chain3()),
    "chain3 free_decay era": Case(released, CHAIN3, {"method": "era", "order": 6}),
    "chain3 random okid_era": Case(
        random_forces, CHAIN3, {"method": "okid_era", "order": 6, "dofs": chain3().dofs}, chain3()
    ),
    "chain3 short pulse okid_era": Case(short_pulses, CHAIN3, {"method": "okid_era", "order": 6}),
    "chain7 ambient ssi_cov": Case(wind, CHAIN7, {"method": "ssi_cov"}),
    "chain7 ambient ssi_data": Case(wind, CHAIN7, {"method": "ssi_data"}),
    "chain7 ambient next_era": Case(wind, CHAIN7, {"method": "next_era"}),
}


def calibrate(case: Case, n_tests: int, *, seed: int = 0) -> Calibration:
    """Error bars of repeated tests beside what they claim to be."""
    values, stds, seconds, matrices = [], [], [], []
    for k in range(n_tests):
        recording = case.make(np.random.default_rng([seed, k]))
        start = time.perf_counter()
        found = identify(recording, **case.settings)  # type: ignore[arg-type]
        seconds.append(time.perf_counter() - start)
        both = _matched(found, case.truth)
        if both is not None:
            values.append(both[0])
            stds.append(both[1])
        if case.matrices is not None and found.second_order is not None:
            matrices.append((_entries(found.second_order), _entries(found.second_order, "_std")))
    x, s = np.array(values), np.array(stds)
    truth = np.stack([case.truth.frequency_hz, case.truth.damping_ratio])
    spread = np.std(x, axis=0, ddof=1)
    return Calibration(
        np.sqrt(np.mean(s**2, axis=0)) / spread,
        np.mean(np.abs(x - truth) < 2 * s, axis=0),
        (np.mean(x, axis=0) - truth) / spread,
        len(x),
        float(np.median(seconds)),
        *_matrix_calibration(matrices, case.matrices),
    )


def _entries(matrices: SecondOrder, suffix: str = "") -> Array:
    """M, C_d and K, or their standard deviations, shape (3, n_dofs, n_dofs)."""
    return np.stack([getattr(matrices, name + suffix) for name in ("mass", "damping", "stiffness")])


def _matrix_calibration(
    pairs: list[tuple[Array, Array]], truth: SecondOrder | None
) -> tuple[Array, Array] | tuple[None, None]:
    if truth is None:
        return None, None
    x, s = (np.array(each) for each in zip(*pairs, strict=True))
    ratio = np.sqrt(np.mean(s**2, axis=0)) / np.std(x, axis=0, ddof=1)
    return ratio, np.mean(np.abs(x - _entries(truth)) < 2 * s, axis=0)


def _matched(found: Identification, truth: Modes) -> tuple[Array, Array] | None:
    """Estimates and standard deviations, shape (2, n_modes) each; None unless every true mode has its own."""
    modes = found.modes
    if modes.frequency_std is None or modes.damping_std is None or not len(modes):
        return None
    nearest = [int(np.argmin(np.abs(modes.frequency_hz - f))) for f in truth.frequency_hz]
    if len(set(nearest)) < len(truth):
        return None
    return (
        np.stack([modes.frequency_hz[nearest], modes.damping_ratio[nearest]]),
        np.stack([modes.frequency_std[nearest], modes.damping_std[nearest]]),
    )


def main() -> None:
    """Print every case."""
    n_tests = int(sys.argv[1]) if len(sys.argv) > 1 else 100
    for name, case in CASES.items():
        c = calibrate(case, n_tests)
        print(f"{name}: {c.n_tests} of {n_tests} tests with all modes, {c.seconds:.3f} s each")
        for row, what in enumerate(("frequency", "damping")):
            for label, figures in (
                ("std / spread", c.ratio),
                ("coverage", c.coverage),
                ("bias / spread", c.bias),
            ):
                print(f"  {what:10}{label:14}" + "".join(f"{x:7.2f}" for x in figures[row]))
        if c.matrix_ratio is not None and c.matrix_coverage is not None:
            for row, what in enumerate(("mass", "damping", "stiffness")):
                upper = np.triu_indices(c.matrix_ratio.shape[1])
                for label, figures in (("std / spread", c.matrix_ratio), ("coverage", c.matrix_coverage)):
                    print(f"  {what:10}{label:14}" + "".join(f"{x:7.2f}" for x in figures[row][upper]))


if __name__ == "__main__":
    main()
