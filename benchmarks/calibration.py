"""Prints how well and how fast 15 parameters of chain3 are calibrated from 600 samples, here and by mujoco.sysid.

All see the same recordings (1 % of noise) and the same wrong model. MuJoCo's own integrator is given its best case: RK4 with
one step per sample, fine enough for these slow modes. "calibrated" is what a diagnosis does, robust to models that are badly
off; "fitted" is its last step alone, which like mujoco.sysid trusts the start. A fit that returns its start counts as failed:
mujoco.sysid divides by the RMS of every axis of an accelerometer, also of those that never move. The other side needs the
extras of `mujoco[sysid]`.

Run `python benchmarks/calibration.py [SEEDS]`.
"""

from __future__ import annotations

import sys
import time

import numpy as np

from identification.recording import Recording
from lab.diagnosis.calibrate import calibrate, parameters_of
from lab.diagnosis.conclude import calibrated_rig
from lab.diagnosis.fit import fit
from lab.diagnosis.misfit import Misfit
from lab.excitation import Random
from lab.instruments import instrument
from lab.rig import Rig
from lab.simulate import simulate
from lab.twin import twin

RATE, N_SAMPLES, NOISE = 5.0, 600, 1.0
CHANNELS = {
    "displacements": ["pos1", "pos2", "pos3"],
    "velocities": ["vel1", "vel2", "vel3"],
    "accelerations": ["acc1.x", "acc2.x", "acc3.x"],
}
INPUTS = ["force1", "force2", "force3"]
WARMING_UP = -1
JITTER = {"mass": 0.005, "stiffness": 0.02, "damping": 0.25}


def wrong_model(true: Rig, seed: int) -> Rig:
    """The model with every parameter off by a draw from its tolerance."""
    model = twin(true)
    parameters = parameters_of(model, JITTER)
    misfit = Misfit(model, parameters, (), 1 / RATE, ())
    return calibrated_rig(misfit, np.random.default_rng(seed).standard_normal(parameters.n), true)


def values_of(rig: Rig) -> np.ndarray:
    """All 15 parameters: masses, stiffnesses, dampings."""
    model = twin(rig)
    return np.concatenate([model.body_mass, model.stiffness, model.damping])


def by_the_lab(recording: Recording, nominal: Rig) -> np.ndarray:
    """Parameters by maximum a posteriori of the simulation error."""
    model = twin(nominal)
    misfit = Misfit.of(recording, model, parameters_of(model), share=1.0)
    theta = calibrate(misfit, nominal).fit.theta
    return values_of(nominal) * np.exp(theta[:15] * misfit.parameters.widths[:15])


def by_a_fit(recording: Recording, nominal: Rig) -> np.ndarray:
    """Parameters by the simulation error from the nominal values on, without the robust stages."""
    model = twin(nominal)
    misfit = Misfit.of(recording, model, parameters_of(model), share=1.0)
    theta = fit(misfit, np.zeros(misfit.parameters.n)).theta
    return values_of(nominal) * np.exp(theta[:15] * misfit.parameters.widths[:15])


def by_sysid(recording: Recording, nominal: Rig) -> np.ndarray:
    """Parameters by mujoco.sysid: bounded least squares, every sensor in units of its RMS."""
    import mujoco
    from mujoco import sysid

    spec = mujoco.MjSpec.from_string(nominal.xml)
    spec.option.timestep = recording.dt
    model = spec.compile()
    u, y = (
        np.asarray(signals[:, :]).T for signals in (recording.records[0].inputs, recording.records[0].outputs)
    )
    t = np.arange(N_SAMPLES) * recording.dt
    names = [channel.name.removesuffix(".x") for channel in recording.outputs]
    # A reading is stored with the time at the end of its step.
    control = sysid.TimeSeries(np.append(t, t[-1] + recording.dt), np.vstack([u, u[-1:]]))
    columns = [int(model.sensor(name).adr[0]) for name in names]
    readings = np.zeros((N_SAMPLES, model.nsensordata))
    readings[:, columns] = y
    everything = sysid.TimeSeries.from_names(t + recording.dt, readings, model)
    parameters = sysid.ParameterDict()
    start = values_of(nominal)
    for name, value in zip(parameters_of(twin(nominal)).names, start, strict=True):
        group, _, place = name.partition(" ")
        wide = 1 + 5 * JITTER[group]
        parameters.add(
            sysid.Parameter(
                name,
                nominal=value,
                min_value=value / wide,
                max_value=value * wide,
                modifier=modifier(group, place),
            )
        )
    data = mujoco.MjData(model)
    rest = sysid.create_initial_state(model, data.qpos, data.qvel, data.act)
    sequences = sysid.ModelSequences("chain3", spec, "test", rest, control, everything)
    kind = everything.signal_mapping[names[0]][0]
    residual = sysid.build_residual_fn(
        models_sequences=[sequences], enabled_observations=[(name, kind) for name in names]
    )
    found, _ = sysid.optimize(
        initial_params=parameters, residual_fn=residual, optimizer="mujoco", verbose=False
    )
    return np.asarray(found.as_vector())


def modifier(group: str, place: str):  # type: ignore[no-untyped-def]
    """How a parameter gets into a specification."""

    def change(spec, parameter) -> None:  # type: ignore[no-untyped-def]
        value = float(parameter.value[0])
        if group == "mass":
            body = spec.body(place)
            body.mass = value
            return
        tendons = {tendon.name: tendon for tendon in spec.tendons}
        spring = tendons.get(place) or spec.joint(place)
        poly = np.array(getattr(spring, group), dtype=float)
        poly[0] = value
        setattr(spring, group, poly)

    return change


def main() -> None:
    """One row per kind of sensor and tool: median and largest relative error, seconds, failures."""
    n_seeds = int(sys.argv[1]) if len(sys.argv) > 1 else 5
    true = Rig.load("models/chain3_coupled.xml")
    tools = {"calibrated": by_the_lab, "fitted": by_a_fit, "mujoco.sysid": by_sysid}
    print(
        f"{'sensors':<14} {'tool':<18} {'median error':>12} {'rms error':>10} {'seconds':>8} {'failures':>8}"
    )
    for kind, outputs in CHANNELS.items():
        errors: dict[str, list[np.ndarray]] = {name: [] for name in tools}
        seconds: dict[str, list[float]] = {name: [] for name in tools}
        reasons: dict[str, str] = {}
        # The first run compiles and loads.
        for seed in range(WARMING_UP, n_seeds):
            rig = true.connected(inputs=INPUTS, outputs=outputs)
            drive = Random(rms=1.0)
            recording = simulate(
                instrument(rig, noise_percent=NOISE),
                drive,
                sample_rate=RATE,
                duration=N_SAMPLES / RATE,
                seed=seed + 1,
            )
            nominal = wrong_model(rig, 100 + seed)
            for name, tool in tools.items():
                began = time.perf_counter()
                try:
                    found = tool(recording, nominal)
                except Exception as failed:
                    reasons[name] = f"{type(failed).__name__}: {failed}".splitlines()[0]
                    continue
                took = time.perf_counter() - began
                if not np.all(np.isfinite(found)) or np.array_equal(found, values_of(nominal)):
                    reasons[name] = "returned its start"
                    continue
                if seed == WARMING_UP:
                    continue
                seconds[name].append(took)
                errors[name].append(found / values_of(true) - 1)
        for name in tools:
            e = np.abs(np.array(errors[name]))
            failures = n_seeds - len(e)
            shown = (
                f"{np.median(e):>12.2e} {np.sqrt(np.mean(e**2)):>10.2e} {np.median(seconds[name]):>8.2f}"
                if e.size
                else " " * 32
            )
            print(f"{kind:<14} {name:<18} {shown} {failures:>8} {reasons.get(name, '')}", flush=True)


if __name__ == "__main__":
    main()
