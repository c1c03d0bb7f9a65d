"""A hand-made diagnosis of a small structure: predictions of an exact linear model with known errors."""

from __future__ import annotations

import numpy as np

from identification.recording import Record, Recording
from lab.diagnosis.outcome import (
    EXPLAINED,
    Alternative,
    Calibrated,
    Diagnosis,
    Errors,
    Finding,
    Prediction,
    Quantity,
)
from lab.effects import EFFECTS
from lab.rig import Rig
from tests.lab.structures import chain_xml

RATE = 50.0
N_SAMPLES, FIRST_HELD_OUT = 1200, 840
NOISE, NOMINAL, CALIBRATED = 0.01, 0.3, 0.08
"""Errors of the predictions, relative to the RMS of each channel."""


def two_masses() -> Rig:
    """Two masses on springs, driven at the first, an accelerometer and a position read at each."""
    xml = chain_xml([1.0, 2.0], [(400.0, 1.0), (0.0, 0.0)], {(0, 1): (900.0, 1.5)})
    rig = Rig.from_xml(xml)
    return rig.connected(inputs=["force0"], outputs=["acc0.x", "pos1"])


def recorded(rig: Rig, *, n_records: int = 2, seed: int = 4) -> Recording:
    """Random tests with white noise of 1 % on every output."""
    rng = np.random.default_rng(seed)
    system = rig.state_space().sampled(1 / RATE)
    records = []
    for _ in range(n_records):
        u = rng.standard_normal((len(rig.inputs), N_SAMPLES))
        y = system.simulate(u)
        records.append(
            Record(
                "random",
                u,
                y + NOISE * y.std(axis=1, keepdims=True) * rng.standard_normal(y.shape),
            )
        )
    return Recording(tuple(records), rig.inputs, rig.outputs, RATE, title="Two masses")


def predicted(recording: Recording, seed: int = 8) -> tuple[Prediction, ...]:
    """Predictions that miss the measured outputs by white errors of known size in every channel."""
    rng = np.random.default_rng(seed)

    def off(y, size):
        return y + size * y.std(axis=1, keepdims=True) * rng.standard_normal(y.shape)

    return tuple(
        Prediction(y, off(y, NOMINAL), off(y, CALIBRATED), off(y, NOISE), FIRST_HELD_OUT)
        for y in (record.outputs for record in recording.records)
    )


def explained(rig: Rig, recording: Recording) -> Diagnosis:
    """A cubic spring between the masses, found beyond doubt."""
    effect = EFFECTS["cubic_stiffness"].of("spring0_1", {"k3": 5.0e6})
    finding = Finding(
        effect,
        {"k3": Quantity(5.0e6, 4.0e4, "N/m^3")},
        1234.5,
        0.99,
        "The spring spring0_1 hardens with the cube of its extension.",
    )
    return Diagnosis(
        EXPLAINED,
        (finding,),
        (
            Alternative("bilinear_stiffness", "spring0_1", 800.25),
            Alternative("gap_contact", "spring0_1", -3.0, "A stronger push would tell a stop from a cubic."),
        ),
        {
            "mass mass0": Calibrated(1.0, 1.002, 0.001),
            "stiffness spring0_1": Calibrated(900.0, 884.0, 2.0),
        },
        Errors(NOISE, NOMINAL, CALIBRATED, 0.0102),
        predicted(recording),
        rig,
        effect.apply(rig),
        ("Too short.",),
        noise={"acc0.x": Quantity(0.02, 0.001, "m/s^2")},
        unlearnable=("One shaker cannot tell its gain from a common scale of masses and stiffnesses.",),
    )
