"""What output-only identification finds of a known structure, beside a peer on the same data.

    python benchmarks/ssi_accuracy.py [SEEDS]

A chain of 100 masses under white forces, 30 accelerometers with 5 % noise, 200 000 samples, 50 block rows, orders 2 to
100. Every seed draws forces and noise anew. Each package judges by its own stabilization, with the same tolerances; its
stable poles within 1 % of a true frequency count for that mode, which is found when at least five orders have one, and
their mean is the estimate. When pyoma2 is not installed (`pip install --group peers`), the lab stands alone.
"""

from __future__ import annotations

import importlib.util
import sys
from pathlib import Path

import numpy as np

ROOT = Path(__file__).resolve().parent.parent
sys.path[:0] = [str(ROOT), str(ROOT / "benchmarks")]

from ssi import CASES, chain_modes, chain_response, lab_ssi, pyoma2_ssi, recording_of  # noqa: E402

N_MASSES = 100
TOLERANCES = {"err_fn": 0.01, "err_xi": 0.2, "err_phi": 0.1}
"""Those of `identification.clusters.Thresholds`, by the peer's names."""


def truth():
    """Frequencies [Hz] and damping ratios of the chain."""
    value, _ = chain_modes(N_MASSES)
    omega = np.sqrt(2500 * value)
    return omega / (2 * np.pi), 2.5 * value / (2 * omega)


def estimates(frequency_hz, damping_ratio):
    """Frequency and damping ratio of each true mode from stable poles, NaN where fewer than five are near it."""
    true_f, _ = truth()
    nearest = np.argmin(np.abs(frequency_hz[:, None] - true_f), axis=1)
    near = np.abs(frequency_hz - true_f[nearest]) < 0.01 * true_f[nearest]
    found = np.full((2, N_MASSES), np.nan)
    for k in range(N_MASSES):
        own = near & (nearest == k)
        if np.sum(own) >= 5:
            found[:, k] = np.mean(frequency_hz[own]), np.mean(damping_ratio[own])
    return found


def lab_poles(recording, n_rows: int, highest: int):
    """Stable poles of the lab."""
    found = lab_ssi(recording, n_rows, highest)()
    stable = np.array(found.label) == "stable"
    return found.frequency_hz[stable], found.damping_ratio[stable]


def pyoma2_poles(recording, n_rows: int, highest: int):
    """Stable poles of pyoma2."""
    found = pyoma2_ssi(recording, n_rows, highest, sc=TOLERANCES)()
    stable = found.Lab == 1
    return found.Fn_poles[stable], found.Xi_poles[stable]


def main() -> None:
    """Print how many modes each finds, and how well, on all modes and on those that both find."""
    n_seeds = int(sys.argv[1]) if len(sys.argv) > 1 else 3
    channels, n_samples, n_rows, highest = CASES["chain100"]
    packages = {"lab": lab_poles}
    if importlib.util.find_spec("pyoma2"):
        packages["pyoma2"] = pyoma2_poles
    for seed in range(n_seeds):
        clean = chain_response(N_MASSES, n_samples, channels, seed=seed)
        noise = np.random.default_rng([seed, 1]).standard_normal(clean.shape)
        recording = recording_of(clean + 0.05 * np.std(clean, axis=1, keepdims=True) * noise)
        found = {name: estimates(*poles(recording, n_rows, highest)) for name, poles in packages.items()}
        both = np.all([np.isfinite(each[0]) for each in found.values()], axis=0)
        print(f"seed {seed}: {int(np.sum(both))} modes found by all")
        for name, each in found.items():
            error = np.abs(each / np.stack(truth()) - 1)
            print(f"  {name:8}{int(np.sum(np.isfinite(each[0]))):4d} modes", end="")
            for which in (np.isfinite(each[0]), both):
                print(f"  | {'common' if which is both else 'own'}:", end="")
                for row, what in zip(error[:, which], ("frequency", "damping"), strict=True):
                    print(f" {what} {100 * np.median(row):.3f} % (worst {100 * np.max(row):.2f} %)", end="")
            print()


if __name__ == "__main__":
    main()
