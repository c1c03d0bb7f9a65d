"""What output-only identification finds of a known structure, beside a peer on the same data.

    python benchmarks/ssi_accuracy.py [SEEDS]

A chain of 100 masses under white forces, 30 accelerometers with 5 % noise, 200 000 samples, 50 block rows, orders 2 to
100. Every seed draws forces and noise anew. The poles that count are those that agree with one of the next lower order,
with the same tolerances for each package. Such a pole within 1 % of a true frequency and with a MAC of at least 0.9
belongs to that mode, which is found when at least five orders have one; their mean is the estimate. (Without the shape,
any pole near 16 Hz, where modes are 0.1 % apart, would be a hit.) The lab names its modes by itself, too: how many, and
how many of them are not true. When pyoma2 is not installed (`pip install --group peers`), the lab stands alone.
"""

from __future__ import annotations

import importlib.util
import sys
from pathlib import Path
from typing import NamedTuple

import numpy as np

ROOT = Path(__file__).resolve().parent.parent
sys.path[:0] = [str(ROOT), str(ROOT / "benchmarks")]

from ssi import CASES, chain_modes, chain_response, lab_ssi, measured_masses, pyoma2_ssi, recording_of  # noqa: E402

N_MASSES = 100
TOLERANCES = {"err_fn": 0.01, "err_xi": 0.2, "err_phi": 0.1}
"""Those of `identification.clusters.Thresholds`, by the peer's names."""


class Truth(NamedTuple):
    """Modes of the chain."""

    frequency_hz: np.ndarray
    damping_ratio: np.ndarray
    shapes: np.ndarray  # (n_channels, n_modes), of length one


class Poles(NamedTuple):
    """Poles that agree with the next lower order."""

    frequency_hz: np.ndarray
    damping_ratio: np.ndarray
    shapes: np.ndarray  # (n_channels, n_poles)


def true_modes(n_channels: int) -> Truth:
    """Modes of the chain at the masses with accelerometers."""
    value, vector = chain_modes(N_MASSES)
    omega = np.sqrt(2500 * value)
    shapes = vector[measured_masses(N_MASSES, n_channels)]
    return Truth(omega / (2 * np.pi), 2.5 * value / (2 * omega), shapes / np.linalg.norm(shapes, axis=0))


def owners(poles: Poles, truth: Truth):
    """The true mode of each pole, -1 for none."""
    shapes = poles.shapes / np.linalg.norm(poles.shapes, axis=0)
    mac = np.abs(shapes.conj().T @ truth.shapes) ** 2  # (n_poles, n_modes)
    near = np.abs(poles.frequency_hz[:, None] / truth.frequency_hz - 1) < 0.01
    mac = np.where(near, mac, 0)
    return np.where(np.max(mac, axis=1) >= 0.9, np.argmax(mac, axis=1), -1)


def estimates(poles: Poles, truth: Truth):
    """Frequency and damping ratio of each true mode, NaN where fewer than five poles are its own, shape (2, n_modes)."""
    owner = owners(poles, truth)
    found = np.full((2, N_MASSES), np.nan)
    for k in range(N_MASSES):
        own = owner == k
        if np.sum(own) >= 5:
            found[:, k] = np.mean(poles.frequency_hz[own]), np.mean(poles.damping_ratio[own])
    return found


def lab_poles(found) -> Poles:
    """Poles of the lab that resemble one of the next lower order."""
    agree = np.isin(found.label, ("stable", "cluster too small"))
    return Poles(found.frequency_hz[agree], found.damping_ratio[agree], found.shapes[:, agree])


def pyoma2_poles(found) -> Poles:
    """The same of pyoma2."""
    agree = found.Lab == 1
    return Poles(found.Fn_poles[agree], found.Xi_poles[agree], found.Phi_poles[agree].T)


def main() -> None:
    """Print how many modes each finds, and how well, on all modes and on those that both find."""
    n_seeds = int(sys.argv[1]) if len(sys.argv) > 1 else 3
    channels, n_samples, n_rows, highest = CASES["chain100"]
    truth = true_modes(channels)
    for seed in range(n_seeds):
        clean = chain_response(N_MASSES, n_samples, channels, seed=seed)
        noise = np.random.default_rng([seed, 1]).standard_normal(clean.shape)
        recording = recording_of(clean + 0.05 * np.std(clean, axis=1, keepdims=True) * noise)
        lab = lab_ssi(recording, n_rows, highest)()
        found = {"lab": estimates(lab_poles(lab), truth)}
        if importlib.util.find_spec("pyoma2"):
            found["pyoma2"] = estimates(
                pyoma2_poles(pyoma2_ssi(recording, n_rows, highest, sc=TOLERANCES)()), truth
            )
        both = np.all([np.isfinite(each[0]) for each in found.values()], axis=0)
        named = owners(Poles(lab.modes.frequency_hz, lab.modes.damping_ratio, lab.modes.shapes), truth)
        print(
            f"seed {seed}: {int(np.sum(both))} modes found by all; the lab names {len(named)} modes, "
            f"{int(np.sum(named < 0))} of them not true"
        )
        for name, each in found.items():
            error = np.abs(each / np.stack([truth.frequency_hz, truth.damping_ratio]) - 1)
            own = np.isfinite(each[0])
            print(
                f"  {name:8}{int(np.sum(own)):4d} modes{summary(error[:, own])} | common{summary(error[:, both])}"
            )


def summary(error) -> str:
    """Median and largest error of frequency and damping."""
    return ",".join(
        f" {what} {100 * np.median(row):.3f} % (worst {100 * np.max(row):.2f} %)"
        for row, what in zip(error, ("frequency", "damping"), strict=True)
    )


if __name__ == "__main__":
    main()
