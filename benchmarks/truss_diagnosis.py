"""Prints what `lab diagnose` says of the paper's truss when something is hidden in it, and the seconds from command to files.

Truss of De Angelis et al. (2002), section 5.4: 14 bars, 5 sensors, 4 actuators; random forces, 20 000 samples, 1 % of noise.
Hidden in turn: nothing, one bar changed, one bar cubic, one sensor wrong. The nominal model is off by a draw from its
tolerances, and the data come from MuJoCo at high accuracy. The first run of a fresh installation compiles the kernels and is
slower.

Run `python benchmarks/truss_diagnosis.py [SEED]`.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

import numpy as np

from lab.diagnosis.calibrate import parameters_of
from lab.diagnosis.conclude import calibrated_rig
from lab.diagnosis.misfit import Misfit
from lab.effects.cubic_stiffness import CubicStiffness
from lab.effects.effect import Effect
from lab.effects.sensor_gain import SensorGain
from lab.effects.stiffness_change import StiffnessChange
from lab.excitation import Random
from lab.files.recording import save
from lab.instruments import instrument
from lab.rig import Rig
from lab.simulate import simulate
from lab.twin import twin

MODEL = Path(__file__).resolve().parent.parent / "models" / "truss.xml"
INPUTS = ["force_v1", "force_u2", "force_u3", "force_v4"]
OUTPUTS = ["acc1.x", "acc1.z", "acc2.z", "acc3.z", "acc4.x"]
RATE, N_SAMPLES, NOISE, FORCE = 20.0, 20_000, 1.0, 100.0
HIDDEN: dict[str, Effect | None] = {
    "nothing": None,
    "one bar changed": StiffnessChange("bar2_4", relative_change=-0.15),
    "one bar cubic": CubicStiffness("bar1_4", k3=2e5),
    "one sensor wrong": SensorGain("acc3.z", relative_change=-0.08),
}


def wrong_model(true: Rig, seed: int) -> Rig:
    """The model with every parameter off by a draw from its tolerance."""
    model = twin(true)
    parameters = parameters_of(model)
    theta = np.random.default_rng(seed).standard_normal(parameters.n)
    return calibrated_rig(Misfit(model, parameters, (), 1 / RATE, ()), theta, true)


def asked(rig: Rig, nominal: Rig, seed: int, folder: Path) -> tuple[dict[str, Any], float]:
    """The answer of the command line about a recording of the rig, and its seconds."""
    recording = simulate(
        instrument(rig, noise_percent=NOISE),
        Random(rms=FORCE),
        sample_rate=RATE,
        duration=N_SAMPLES / RATE,
        seed=seed,
    )
    save(recording, folder / "recording.h5")
    nominal.save(folder / "model.xml")
    command = [
        *(sys.executable, "-m", "lab", "diagnose", str(folder / "recording.h5")),
        *("--model", str(folder / "model.xml"), "--out", str(folder / "answer"), "--force", "--quiet"),
    ]
    start = time.perf_counter()
    subprocess.run(command, check=True, env={**os.environ, "OPENBLAS_NUM_THREADS": "1"})
    seconds = time.perf_counter() - start
    return json.loads((folder / "answer" / "diagnosis.json").read_text(encoding="utf-8")), seconds


def main(seed: int) -> None:
    """One line per thing hidden."""
    rig = Rig.load(MODEL).connected(inputs=INPUTS, outputs=OUTPUTS)
    nominal = wrong_model(rig, seed)
    for what, effect in HIDDEN.items():
        with tempfile.TemporaryDirectory() as folder:
            answer, seconds = asked(effect.apply(rig) if effect else rig, nominal, seed, Path(folder))
        named = [
            f"{f['cause']}@{f['location']} "
            + ", ".join(f"{n} {p['value']:.4g} ± {p['std']:.1g}" for n, p in f["parameters"].items())
            for f in answer["findings"]
        ]
        print(
            f"{what} ({effect}): {answer['verdict']}, {'; '.join(named) or 'nothing named'}; {seconds:.1f} s",
            flush=True,
        )


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 0)
