"""Accuracy and cost of the simulation, side by side in one run.

First, for each linear model: the largest error of its readings under random held forces, relative to the largest value of
each channel, against the exact zero-order-hold response, for rising numbers of substeps per sample; plain Runge-Kutta steps,
and three runs extrapolated. Then, the CPU time of a step: a bare loop of `mj_step` in C and one in Python, MuJoCo's rollout,
and the lab's stepper around it, which also cuts, checks and sorts signals. Medians over interleaved repeats.

    python benchmarks/simulation.py [--models chain3_coupled chain7 truss] [--samples 400] [--substeps 7] [--steps 20000]
                                    [--repeats 5]
"""

from __future__ import annotations

import argparse
import copy
import os
import sys
import time
from collections.abc import Callable
from pathlib import Path

# Matrices here are small: threads would cost more than they bring.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

import mujoco
import numpy as np
from mujoco import rollout

from lab import catalogue, stepping
from lab.rig import Rig
from lab.stepping import Plan, Stepper

RATES = {"chain3_uncoupled": 20.0, "chain3_coupled": 20.0, "chain7": 1 / 0.027, "truss": 50.0}
"""Sample rates of the papers [Hz]."""


def errors(rig: Rig, rate: float, counts: list[int], n_samples: int) -> list[tuple[int, float, float | None]]:
    """Substeps, error of plain steps, and error extrapolated from as many, half and a quarter as many."""
    u = np.random.default_rng(0).standard_normal((len(rig.inputs), n_samples))
    exact = rig.state_space().sampled(1 / rate).simulate(u)
    largest = np.max(np.abs(exact), axis=1)
    rows = [rig.row_of(channel.name) for channel in rig.outputs]
    found = {}
    for count in counts:
        readings, _ = stepper(rig, 1 / rate, count).advance(np.repeat(u[None], count, axis=2), None)
        found[count] = readings[0, rows, ::count]

    def error(values: np.ndarray) -> float:
        return float(np.max(np.max(np.abs(values - exact), axis=1) / largest))

    table = []
    for count in counts:
        plan = Plan(count, (4, 5))
        enough = all(run in found for run in plan.runs) and count % 4 == 0
        combined = error(plan.combined([found[run] for run in plan.runs])) if enough else None
        table.append((count, error(found[count]), combined))
    return table


def stepper(rig: Rig, dt: float, substeps: int) -> Stepper:
    """A stepper of one copy at rest."""
    still = np.zeros((1, len(rig.dofs)))
    return Stepper(rig, dt, substeps, still, still, 1.0)


def costs(rig: Rig, dt: float, n_steps: int, repeats: int) -> dict[str, float]:
    """Median CPU time of a step [µs], by way of stepping."""
    u = np.random.default_rng(0).standard_normal((n_steps, len(rig.inputs)))
    model = copy.copy(rig.model)
    model.opt.timestep, model.opt.integrator = dt, mujoco.mjtIntegrator.mjINT_RK4
    data = mujoco.MjData(model)
    state = np.zeros((1, mujoco.mj_stateSize(model, stepping.STATE)))
    lab_stepper = stepper(rig, dt, 1)

    def in_c() -> None:
        mujoco.mj_step(model, data, nstep=n_steps)

    def in_python() -> None:
        for force in u:
            data.ctrl[:] = force
            mujoco.mj_step(model, data)

    def rolled_out() -> None:
        with rollout.Rollout(nthread=1) as pool:
            pool.rollout(model, data, state, u[None])

    def by_the_lab() -> None:
        lab_stepper.advance(u.T[None], None)

    ways: dict[str, Callable[[], None]] = {
        "mj_step in C": in_c,
        "mj_step in Python": in_python,
        "rollout": rolled_out,
        "lab": by_the_lab,
    }
    times: dict[str, list[float]] = {name: [] for name in ways}
    for _ in range(repeats):
        for name, way in ways.items():
            mujoco.mj_resetData(model, data)
            start = time.process_time()
            way()
            times[name].append((time.process_time() - start) / n_steps * 1e6)
    return {name: float(np.median(values)) for name, values in times.items()}


def main(arguments: list[str] | None = None) -> None:
    """Prints both tables."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--models", nargs="+", default=list(RATES), help="names in the catalogue")
    parser.add_argument("--samples", type=int, default=400, help="per record of the errors")
    parser.add_argument("--substeps", type=int, default=7, help="how often substeps double")
    parser.add_argument("--steps", type=int, default=20_000, help="per timing")
    parser.add_argument("--repeats", type=int, default=5, help="of each timing")
    options = parser.parse_args(arguments)

    rigs = {}
    for name in options.models:
        rig = Rig.load(catalogue.find("models", name))
        rigs[name] = rig.connected(outputs=rig.responding)

    print("Largest relative error against the exact zero-order-hold response\n")
    print(f"{'model':18}{'substeps':>9}{'ω h':>9}{'plain':>11}{'extrapolated':>14}")
    for name, rig in rigs.items():
        rate = RATES.get(name, 8 * stepping.highest_frequency(rig) / (2 * np.pi))
        phase = stepping.highest_frequency(rig) / rate
        # The coarsest run must be stable: ω h up to 2.78 for Runge and Kutta.
        first = max(1, int(np.ceil(phase / 2)))
        for count, plain, combined in errors(
            rig, rate, [first * 2**k for k in range(options.substeps)], options.samples
        ):
            shown = "" if combined is None else f"{combined:14.1e}"
            print(f"{name:18}{count:9d}{phase / count:9.3f}{plain:11.1e}{shown}")

    print("\nCPU time of a step [µs], and the lab's over that of the bare loop in C and in Python\n")
    print(
        f"{'model':18}{'DOFs':>5}{'C loop':>9}{'Python':>9}{'rollout':>9}{'lab':>9}{'lab/C':>8}{'lab/Python':>12}"
    )
    for name, rig in rigs.items():
        rate = RATES.get(name, 8 * stepping.highest_frequency(rig) / (2 * np.pi))
        t = costs(rig, 0.1 / rate, options.steps, options.repeats)
        ratios = f"{t['lab'] / t['mj_step in C']:8.2f}{t['lab'] / t['mj_step in Python']:12.2f}"
        print(f"{name:18}{len(rig.dofs):5d}" + "".join(f"{value:9.2f}" for value in t.values()) + ratios)


if __name__ == "__main__":
    main()
