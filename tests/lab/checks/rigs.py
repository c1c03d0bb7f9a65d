"""Chains whose model is only nominal, and recordings of them, exact between samples."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from identification.recording import Array, Record, Recording
from lab.rig import Rig
from tests.lab.checks.benches import N_SAMPLES, states
from tests.lab.structures import chain_xml

OUTPUTS = ("acc{}.x", "vel{}", "pos{}")
JITTER = 0.05
"""By how much nominal masses and stiffnesses are off, relative."""


def rigs(seed: int, n: int) -> tuple[Rig, Rig, np.random.Generator]:
    """The true rig, its nominal model and a generator for what follows."""
    rng = np.random.default_rng(seed)
    mass, k = rng.uniform(0.7, 1.5, n), rng.uniform(1500, 4000, n)

    def rig(m: Array, k: Array) -> Rig:
        ground = [(float(k[0]), float(2e-4 * k[0])), *[(0.0, 0.05)] * (n - 1)]
        joined = {(i - 1, i): (float(k[i]), float(2e-4 * k[i])) for i in range(1, n)}
        return Rig.from_xml(chain_xml([float(each) for each in m], ground, joined))

    true = rig(*(x * np.exp(JITTER * rng.standard_normal(n)) for x in (mass, k)))
    return true, rig(mass, k), rng


def measured(kind: str, seed: int) -> tuple[Recording, Rig]:
    """A recording with 2 % noise of a chain of 3 to 6 masses, and its nominal model."""
    n = 3 + seed % 4
    true, nominal, rng = rigs(seed, n)
    outputs = [OUTPUTS[seed % 3].format(i) for i in range(n)]
    system = true.connected(outputs=outputs).state_space().sampled(0.01)
    u, x0 = np.zeros((n, N_SAMPLES)), np.zeros(system.n_states)
    if kind == "ambient":
        u = rng.standard_normal(u.shape)
    elif kind == "random":
        u[-1] = rng.standard_normal(N_SAMPLES)
    elif kind == "pulse":
        u[-1, 0] = 100.0
    else:
        x0[:n] = 0.01 * rng.standard_normal(n)
    y = system.C @ states(system.A, system.B @ u, x0) + system.D @ u
    y += 0.02 * np.std(y, axis=1, keepdims=True) * rng.standard_normal(y.shape)
    known = kind in ("random", "pulse")
    record = Record(kind, u[-1:] if known else np.zeros((0, N_SAMPLES)), y)
    return Recording((record,), system.inputs[-1:] if known else (), system.outputs, 100.0), nominal


def changed(recording: Recording, *, inputs: Array | float = 1.0, outputs: Array | float = 1.0) -> Recording:
    """The recording with factors on its channels."""
    record = recording.records[0]
    made = replace(
        record, inputs=np.asarray(record.inputs) * inputs, outputs=np.asarray(record.outputs) * outputs
    )
    return replace(recording, records=(made,))


def swapped(recording: Recording, i: int, j: int) -> Recording:
    """The recording with two outputs exchanged, names staying where they are."""
    record = recording.records[0]
    y = np.array(record.outputs)
    y[[i, j]] = y[[j, i]]
    return replace(recording, records=(replace(record, outputs=y),))


def mistakes(
    recording: Recording, rng: np.random.Generator
) -> dict[str, tuple[Recording, set[tuple[str, str]]]]:
    """Spoilt recordings by name, each with the check and channel that must be told."""
    names = [channel.name for channel in recording.outputs]
    n = len(names)
    i, j = sorted(int(k) for k in rng.choice(n, 2, replace=False))
    flip, factor = np.ones((n, 1)), np.ones((n, 1))
    flip[i], factor[j] = -1, 9.80665
    made = {
        "none": (recording, set()),
        "order": (swapped(recording, i, j), {("order", f"{names[i]}|{names[j]}")}),
        "sign": (changed(recording, outputs=flip), {("sign", names[i])}),
        "scale": (changed(recording, outputs=factor), {("scale", names[j])}),
        "rate": (replace(recording, sample_rate=2 * recording.sample_rate), {("rate", "")}),
    }
    if recording.inputs:
        force = recording.inputs[0].name
        made["input sign"] = (changed(recording, inputs=-1.0), {("sign", force)})
        made["input scale"] = (changed(recording, inputs=1 / 4.4482), {("scale", force)})
    return made
