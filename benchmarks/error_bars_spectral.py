"""Whether error bars from spectra, and of refined results, are true: reported over true, as in error_bars.py.

python benchmarks/error_bars_spectral.py [REPETITIONS] [CASE …]
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np

ROOT = Path(__file__).resolve().parent.parent
sys.path.insert(0, str(ROOT))

from benchmarks.error_bars import CHAIN3, CHAIN7, Case, Generator, calibrate  # noqa: E402
from identification.recording import Recording  # noqa: E402
from tests.ambient import ambient  # noqa: E402
from tests.systems import chain3, paper_chain3, recorded, with_noise  # noqa: E402


def forced(rng: Generator) -> Recording:
    """One minute of the founding experiment under two random forces, with 5 % noise."""
    return with_noise(recorded(paper_chain3(), [rng.standard_normal((2, 1200))]), 0.05, rng)


def wind(rng: Generator) -> Recording:
    """Seven masses for seven minutes under white forces that nobody measures, with 5 % noise."""
    return ambient(20_000, int(rng.integers(1 << 31)), noise=0.05)


DOFS = chain3().dofs
CASES = {
    "chain3 random plscf": Case(forced, CHAIN3, {"method": "plscf", "order": 6, "dofs": DOFS}, chain3()),
    "chain3 random plscf, all orders": Case(forced, CHAIN3, {"method": "plscf"}),
    "chain3 random refined": Case(forced, CHAIN3, {"order": 6, "dofs": DOFS, "refine": True}, chain3()),
    "chain7 ambient plscf": Case(wind, CHAIN7, {"method": "plscf"}),
    # The two highest modes melt into one in spectra of so few averages.
    "chain7 ambient efdd": Case(wind, CHAIN7.take([0, 1, 2, 3]), {"method": "efdd"}),
}


def main() -> None:
    """Print every case, or those named."""
    n_tests = int(sys.argv[1]) if len(sys.argv) > 1 else 60
    for name in sys.argv[2:] or CASES:
        c = calibrate(CASES[name], n_tests)
        print(f"{name}: {c.n_tests} of {n_tests} tests with all modes, {c.seconds:.3f} s each")
        figures = (("std / spread", c.ratio), ("coverage", c.coverage), ("bias / spread", c.bias))
        for row, what in enumerate(("frequency", "damping")):
            for label, values in figures:
                print(f"  {what:10}{label:14}" + "".join(f"{x:7.2f}" for x in values[row]))
        if c.matrix_ratio is None or c.matrix_coverage is None:
            continue
        upper = np.triu_indices(c.matrix_ratio.shape[1])
        for row, what in enumerate(("mass", "damping", "stiffness")):
            for label, values in (("std / spread", c.matrix_ratio), ("coverage", c.matrix_coverage)):
                print(f"  {what:10}{label:14}" + "".join(f"{x:7.2f}" for x in values[row][upper]))


if __name__ == "__main__":
    main()
