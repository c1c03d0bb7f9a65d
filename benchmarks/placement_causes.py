"""Layouts for a diagnosis, verified by diagnoses: how often `lab diagnose` names hidden causes rightly, wrongly or not.

    python benchmarks/placement_causes.py [--repeats 1] [--size 0.01]

Nonlinear causes of one size are hidden in three masses, simulated by MuJoCo, measured with noise and diagnosed, through the
best and the worst layout of two accelerometers and one force. The diagnosis may name any of the same causes, or none; a
diagnosis that fails is counted and told.
"""

from __future__ import annotations

import argparse
import os
import sys
from pathlib import Path

# Matrices here are small: threads would cost more than they bring.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

import numpy as np

from lab.diagnosis.diagnose import diagnose
from lab.effects import EFFECTS
from lab.effects.effect import Effect
from lab.instruments import instrument
from lab.placement.arena import arena_of
from lab.placement.outcome import Ranked
from lab.placement.place import place
from lab.placement.plan import Plan, driving
from lab.rig import Rig
from lab.simulate import simulate

ROOT = Path(__file__).resolve().parent.parent
CAUSES = ("cubic_stiffness", "coulomb_friction", "quadratic_damping", "bilinear_stiffness")
NOISE_PERCENT = 2.0


def hidden(rig: Rig, plan: Plan, size: float) -> list[Effect]:
    """Every cause at every place at the size that the placement speaks of."""
    arena = arena_of(rig, plan, size, CAUSES, n_acting=1)
    probes = zip(arena.suspects.probes, arena.sizes, strict=True)
    return [probe.at(probe.values * times).effect for probe, times in probes if not isinstance(probe, int)]


def count(row: Ranked, rig: Rig, plan: Plan, effects: list[Effect], repeats: int) -> np.ndarray:
    """How many of the hidden causes are named rightly, wrongly and not at all through a layout, and how many fail."""
    found = np.zeros(4, dtype=int)
    known = rig.connected(inputs=row.actuators, outputs=row.sensors)
    for effect in effects:
        real = instrument(effect.apply(known), noise_percent=NOISE_PERCENT)
        for seed in range(repeats):
            recording = simulate(
                real, plan.excitation, sample_rate=plan.sample_rate, duration=plan.duration, seed=seed
            )
            try:
                told = diagnose(
                    recording, known, effects={cause: EFFECTS[cause] for cause in CAUSES}
                ).findings
            except np.linalg.LinAlgError as error:
                print(f"  {effect}, seed {seed}, {row.sensors}, {row.actuators}: {error}")
                found[3] += 1
                continue
            named = [(each.effect.cause, each.effect.location) for each in told]
            found[2 if not named else int(named[0] != (effect.cause, effect.location))] += 1
    return found


def main() -> None:
    """Print the figures."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--repeats", type=int, default=1)
    parser.add_argument("--size", type=float, default=0.01)
    options = parser.parse_args()
    rig = Rig.load(ROOT / "models/chain3_uncoupled.xml")
    rig = rig.connected(outputs=[name for name in rig.responding if name.startswith("acc")])
    plan = Plan(driving("random", 1.0, band=(0.05, 0.5)), 3.0, 300.0, noise_percent=NOISE_PERCENT)
    placed = place(rig, 2, n_actuators=1, target="diagnosis", plan=plan, size=options.size, causes=CAUSES)
    effects = hidden(rig, plan, options.size)
    print(
        f"{len(effects)} causes of {100 * options.size:g} %, noise {NOISE_PERCENT:g} %, {options.repeats} repeats"
    )
    for row in placed.ranking:
        if row.name in ("best", "worst"):
            layout = ", ".join((*row.sensors, *row.actuators))
            right, wrong, none, failed = count(row, rig, plan, effects, options.repeats)
            print(
                f"  {row.name:6s} likeliest confusion {100 * row.figure:.1f} %, any {100 * row.details['any']:.1f} %: "
                f"named rightly {right}, wrongly {wrong}, not {none}, failed {failed}  {layout}"
            )


if __name__ == "__main__":
    main()
