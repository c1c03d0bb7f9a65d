"""Restoring force: what a guilty spring does, taken from the measurements and not from the law that was fitted.

The calibrated model without the law leaves a residual e. Were the force f of the law known over time, the outputs would move
by -h * f, h their response to a force along the spring, so f is the least-squares solution of e = -h * f over all outputs,
each in units of its noise. The idea is the restoring force method of Masri and Caughey (1979), J. Appl. Mech. 46(2), 433-447;
here no motion has to be measured at the spring itself.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
import scipy.fft
import scipy.sparse.linalg

from identification.recording import Array, Channel, Recording
from lab.diagnosis.outcome import Diagnosis, Finding
from lab.errors import LabError
from lab.paths import Path
from lab.plant import Plant
from lab.responder import ready
from lab.twin import spring_rows, twin

OVER = {
    "cubic_stiffness": "extension",
    "bilinear_stiffness": "extension",
    "freeplay": "extension",
    "gap_contact": "extension",
    "hysteresis": "extension",
    "stiffness_drift": "extension",
    "coulomb_friction": "rate",
    "quadratic_damping": "rate",
}
"""Laws of a spring, and what their force is drawn over."""
MOST_SAMPLES = 2048
FINE = 8
"""Steps per sample in which the force runs straight from one sample to the next."""
LAW_SUBSTEPS = 24


@dataclass(frozen=True, eq=False)
class Restoring:
    """Force of a spring over its extension or rate of extension.

    Attributes:
        location: the spring.
        over: "extension" [m] or "rate" [m/s].
        x: extension or rate, from the measurements, (n,).
        force: elastic (over extension) or dissipative (over rate) force at those, from the measurements, (n,) [N].
        law_x, law_force: the same of the extended model.
        linear: stiffness [N/m] or damping [N s/m] of the spring in the calibrated model.
    """

    location: str
    over: str
    x: Array
    force: Array
    law_x: Array
    law_force: Array
    linear: float


def restoring_force(diagnosis: Diagnosis, recording: Recording) -> Restoring | None:
    """The first finding that is a law of a spring, seen in the first record that is driven from rest.

    None where there is no such finding or record, or no linear rest.
    """
    named = [f for f in diagnosis.findings if f.effect.cause in OVER]
    driven = [i for i, record in enumerate(recording.records) if record.inputs.shape[0]]
    if not named or not diagnosis.predictions or not driven:
        return None
    finding = named[0]
    try:
        plant, row, linear = _without(diagnosis, finding)
    except LabError:
        # A force that the fast twin does not know is no reason to lose a report.
        return None
    if plant is None:
        return None
    over = OVER[finding.effect.cause]
    dt = recording.dt
    predicted = diagnosis.predictions[driven[0]]
    y = predicted.measured[:, :MOST_SAMPLES]
    n = y.shape[1]
    u = np.asarray(recording.records[driven[0]].inputs[:, :n])
    law_motion, law_force = _law(diagnosis, plant, row, u, dt)
    e = y - ready(plant, dt).outputs(u, n)
    noise = np.array([diagnosis.noise[c.name].value for c in recording.outputs if c.name in diagnosis.noise])
    if noise.size != len(y) or not np.all(noise > 0):
        noise = np.nanstd(y - predicted.extended[:, :n], axis=1)
    weight = np.where(np.isnan(e), 0.0, 1 / np.where(noise > 0, noise, 1.0)[:, None])
    force = _deconvolved(-_kernel(plant, row, dt, n), np.nan_to_num(e), weight, float(np.std(law_force)))
    pushed = _moving(plant, row)
    motion = ready(pushed, dt).outputs(u, n)
    motion -= _convolved(_kernel(pushed, row, dt, n), force)
    which = 0 if over == "extension" else 1
    x, law_x = motion[which], law_motion[which]
    coefficient = linear[which]
    return Restoring(
        finding.effect.location,
        over,
        x,
        coefficient * x + force,
        law_x,
        coefficient * law_x + law_force,
        coefficient,
    )


def _without(diagnosis: Diagnosis, finding: Finding) -> tuple[Plant | None, Array, tuple[float, float]]:
    """The calibrated plant with every finding but one, the row of that one's spring, and its linear coefficients."""
    rig = diagnosis.nominal
    own = {"mass_change", "stiffness_change", "damping_change"}  # in the calibration already
    for other in diagnosis.findings:
        if other is not finding and other.effect.cause not in own:
            rig = other.effect.apply(rig)
    model = twin(rig)
    ratios = {name: c.value / c.nominal for name, c in diagnosis.calibration.items() if c.nominal}
    mass = np.array([ratios.get(f"mass {body}", 1.0) for body in model.bodies])
    stiffness, damping = (
        np.array([ratios.get(f"{group} {spring}", 1.0) for spring in model.springs])
        for group in ("stiffness", "damping")
    )
    plant = model.changed(mass, stiffness, damping)
    row, coefficients = _spring(plant, rig.dofs, model.springs, spring_rows(rig), finding.effect.location)
    bent = plant.laws or plant.tones or any(p.hum or math.isfinite(p.limit) for p in plant.output_paths)
    return (None if bent else plant), row, coefficients


def _spring(
    plant: Plant, dofs: tuple[str, ...], springs: tuple[str, ...], rows: Array, location: str
) -> tuple[Array, tuple[float, float]]:
    """Extension per displacement, stiffness and damping; a joint without any has neither."""
    if location in springs:
        i = springs.index(location)
        return rows[i], (float(plant.spring_stiffness[i]), float(plant.spring_damping[i]))
    return np.eye(len(dofs))[dofs.index(location)], (0.0, 0.0)


def _law(diagnosis: Diagnosis, plant: Plant, row: Array, u: Array, dt: float) -> tuple[Array, Array]:
    """Extension and rate (2, n), and the force along the row that the linear plant lacks, (n,), of the extended model."""
    extended = twin(diagnosis.extended).plant
    n = extended.n_dofs
    eye, zero = np.eye(n), np.zeros((n, n))
    whole = _reading(
        extended, np.vstack([eye, zero, zero]), np.vstack([zero, eye, zero]), np.vstack([zero, zero, eye])
    )
    q, v, a = np.split(ready(whole, dt, substeps=LAW_SUBSTEPS).outputs(u, u.shape[1]), 3)
    # M a + C v + K q + rᵀ f = B u
    left = plant.forces @ u - plant.mass @ a - plant.damping @ v - plant.stiffness @ q
    return np.stack([row @ q, row @ v]), np.asarray(row @ left / (row @ row))


def _reading(plant: Plant, displacement: Array, velocity: Array, acceleration: Array) -> Plant:
    """The plant with other, ideal sensors."""
    n = len(displacement)
    return replace(
        plant,
        displacement=displacement,
        velocity=velocity,
        acceleration=acceleration,
        outputs=tuple(Channel(f"reading{i}", "m") for i in range(n)),
        output_paths=(Path(),) * n,
        order=(),
    )


def _moving(plant: Plant, row: Array) -> Plant:
    """The plant whose outputs are extension and rate along a row."""
    zero = np.zeros_like(row)
    return _reading(plant, np.stack([row, zero]), np.stack([zero, row]), np.stack([zero, zero]))


def _kernel(plant: Plant, row: Array, dt: float, n: int) -> Array:
    """Outputs (n_outputs, n) under a force along the row that rises to 1 N and falls to nothing within a sample each way."""
    probe = replace(
        plant, forces=row[:, None], inputs=(Channel("push", "N"),), input_paths=(Path(),), tones=()
    )
    rise = np.arange(FINE) / FINE
    push = np.zeros((1, (n + 1) * FINE))
    push[0, : 2 * FINE] = np.concatenate([rise, 1 - rise])
    # The first sample lies before the summit.
    return ready(probe, dt / FINE).outputs(push, push.shape[1])[:, FINE::FINE]


def _convolved(h: Array, f: Array) -> Array:
    """Responses (n_outputs, n) to a force over time."""
    n = f.size
    size = scipy.fft.next_fast_len(2 * n, real=True)
    return np.asarray(
        scipy.fft.irfft(scipy.fft.rfft(h, size, axis=1) * scipy.fft.rfft(f, size), size, axis=1)[:, :n]
    )


def _deconvolved(h: Array, e: Array, weight: Array, scale: float) -> Array:
    """The force f that explains e as h * f: least squares, with a prior of white force of RMS `scale` [N]."""
    n = e.shape[1]
    if not scale > 0:
        return np.zeros(n)
    size = scipy.fft.next_fast_len(2 * n, real=True)
    H = scipy.fft.rfft(h, size, axis=1)

    def response(f: Array) -> Array:
        return np.asarray(scipy.fft.irfft(H * scipy.fft.rfft(f, size), size, axis=1)[:, :n])

    def adjoint(r: Array) -> Array:
        back = np.conj(H) * scipy.fft.rfft(r, size, axis=1)
        return np.asarray(scipy.fft.irfft(back.sum(axis=0), size)[:n])

    prior = 1 / scale**2
    # The normal equations of an endless record with nothing missing are diagonal in frequency, and close to these.
    endless = (np.mean(weight**2, axis=1) @ np.abs(H) ** 2) + prior

    def nearly(r: Array) -> Array:
        return np.asarray(scipy.fft.irfft(scipy.fft.rfft(r.ravel(), size) / endless, size)[:n])

    normal = scipy.sparse.linalg.LinearOperator(
        (n, n), matvec=lambda f: adjoint(weight**2 * response(f.ravel())) + prior * f.ravel(), dtype=float
    )
    start = scipy.sparse.linalg.LinearOperator((n, n), matvec=nearly, dtype=float)
    found, _ = scipy.sparse.linalg.cg(normal, adjoint(weight**2 * e), rtol=1e-8, maxiter=2000, M=start)
    return np.asarray(found)
