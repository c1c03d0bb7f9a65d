"""How often each check finds what was put into a recording, and how often it speaks without cause.

    python benchmarks/checks.py [--seeds 20]

Recordings are made from seeds: chains of four masses under every kind of excitation, with 1 % noise or none. Spoilt ones
have one flaw on one channel; found means a remark of the right check on that channel, besides means any other remark.
With a model, which is 5 % off in every mass and stiffness, channels are exchanged, turned and scaled. Last, the time for
30 channels of a million samples.
"""

from __future__ import annotations

import argparse
import sys
import time
from collections import Counter
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

import numpy as np

import lab
from identification.recording import Channel, Record, Recording
from tests.lab.checks.benches import KINDS, SPOIL, clean, spoilt
from tests.lab.checks.rigs import measured, mistakes


def alone(seeds: int) -> None:
    """Found and false remarks without a model."""
    print(
        f"{'kind':14}{'false / channels':>18}   found of {seeds}: "
        + " ".join(f"{name:>12}" for name in SPOIL)
    )
    everything: Counter[str] = Counter()
    for kind in KINDS:
        false, channels = Counter(), 0
        for seed in range(seeds):
            for noise in (0.01, 0.0):
                recording = clean(kind, seed, noise=noise)
                channels += len(recording.inputs) + len(recording.outputs)
                false.update(remark.check for remark in lab.check(recording))
        everything += false
        found = Counter()
        for name, spoil in SPOIL.items():
            for seed in range(seeds):
                made, row = clean(kind, 1000 + seed), seed % 4
                remarks = lab.check(spoilt(made, row, spoil(np.random.default_rng(seed))))
                found[name] += any(r.check == name and r.channel == made.outputs[row].name for r in remarks)
        counts = " ".join(f"{found[name]:>12}" for name in SPOIL)
        print(
            f"{kind:14}{false.total():>7} / {channels:<8}   {'':{len(str(seeds)) + 11}}{counts}", flush=True
        )
    print(f"false remarks by check: {dict(everything) or 'none'}\n")


def with_model(seeds: int) -> None:
    """Found and other remarks with a model."""
    for kind in ("random", "ambient", "pulse", "free_decay"):
        found, besides, tries = Counter(), Counter(), Counter()
        for seed in range(seeds):
            recording, rig = measured(kind, seed)
            for name, (made, expected) in mistakes(recording, np.random.default_rng(seed)).items():
                told = {(remark.check, remark.channel) for remark in lab.check(made, rig)}
                tries[name] += 1
                found[name] += expected <= told
                besides.update(check for check, _ in told - expected)
        text = ", ".join(f"{name} {found[name]}/{tries[name]}" for name in tries)
        print(f"{kind:12} {text}; besides: {dict(besides) or 'nothing'}", flush=True)


def speed() -> None:
    """Seconds for 30 channels of a million samples."""
    y = np.random.default_rng(0).standard_normal((30, 1_000_000))
    channels = tuple(Channel(f"acc{k}", "m/s^2") for k in range(30))
    recording = Recording((Record("ambient", np.zeros((0, y.shape[1])), y),), (), channels, 1000.0)
    start, cpu = time.perf_counter(), time.process_time()
    n = len(lab.check(recording))
    wall, cpu = time.perf_counter() - start, time.process_time() - cpu
    print(f"\n30 channels x 1e6 samples: {wall:.1f} s, {cpu:.1f} s of CPU, {n} remarks on white noise")


if __name__ == "__main__":
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--seeds", type=int, default=20)
    asked = parser.parse_args()
    alone(asked.seeds)
    with_model(asked.seeds)
    speed()
