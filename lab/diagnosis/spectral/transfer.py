"""Transfer: the frequency response of a plant between recorded samples, forces held over each as the kernel holds them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from identification.recording import Array
from lab import forces
from lab.diagnosis.spectral.continuous import behind_limits, continuous_response
from lab.diagnosis.spectral.modal_sum import modal_sum
from lab.plant import Plant
from lab.responder import ready

Complex = NDArray[np.complex128]


def plant_response(plant: Plant, frequency_hz: Array | Complex, *, dt: float) -> Complex:
    """Frequency response of the plant's linear part to its inputs and then its tones, (n_f, n_outputs, n_inputs + n_tones).

    It is that between samples, z = exp(2πi f dt), with every force held over its sample, whole and broken delays, lags,
    gains and exchanged cables included; so aliasing is in it, and nothing is approximated. Stiffness that drifts counts
    as at the start of the record; saturation and the other laws are left out.

    Args:
        plant: structure and chain.
        frequency_hz: shape (n_f,) [Hz]; complex for responses under an exponential window.
        dt: sample time [s]; zero for forces that vary continuously (`continuous_response`).

    Source: Åström and Wittenmark (1997), Computer-Controlled Systems, eq. (2.6): H(z) = C (z I - F)⁻¹ G + D.
    """
    s = np.asarray(2j * np.pi * frequency_hz, dtype=np.complex128)
    linear = replace(plant, laws=())
    if not dt:
        return continuous_response(linear, s)
    F, G, *_, C, D, _ = ready(linear, dt).matrices
    z = np.exp(s * dt)
    H = modal_sum(z, F, G[0], C) + D
    n_in = len(plant.inputs)
    late = [i for i, path in enumerate(plant.input_paths) if path.parts(dt)[1]]
    sources = [*range(n_in), *late]
    driven = np.zeros((z.size, H.shape[1], n_in + len(plant.tones)), dtype=complex)
    for column, i in enumerate(sources):
        whole, part = plant.input_paths[i].parts(dt)
        # A late force comes as two columns: what acts before it changes within the sample, and after.
        samples = whole + (part > 0) if column < n_in else whole
        driven[:, :, i] += H[:, :, column] * (_before(plant, i, z, dt) * z**-samples)[:, None]
    driven[:, :, n_in:] = H[:, :, len(sources) :]
    return behind_limits(plant, _recorded(plant, driven, z, dt), s)


def at_time(plant: Plant, share: float) -> Plant:
    """The plant as it is when that share of a record has passed: drifting springs have the stiffness of then."""
    K = plant.stiffness
    for law in plant.laws:
        if law.kind == forces.DRIFT:
            K = K + share * law.parameters[0] * np.outer(law.row, law.row)
    return replace(plant, stiffness=K, laws=tuple(law for law in plant.laws if law.kind != forces.DRIFT))


def drifts(plant: Plant) -> bool:
    """Whether a spring of the plant changes over the record."""
    return any(law.kind == forces.DRIFT for law in plant.laws)


def _before(plant: Plant, channel: int, z: Complex, dt: float) -> Complex:
    """What an actuator's gain and its held lag do to an input."""
    path = plant.input_paths[channel]
    factor = np.full(z.size, path.gain, dtype=complex)
    if path.held_lag:
        share = -np.expm1(-dt / path.held_lag)
        factor *= share / (1 + (share - 1) / z)
    return factor


def _recorded(plant: Plant, H: Complex, z: Complex, dt: float) -> Complex:
    """Readings behind gains, delays and exchanged cables."""
    factors = np.empty((z.size, len(plant.outputs)), dtype=complex)
    for i, path in enumerate(plant.output_paths):
        whole, part = path.parts(dt)
        factors[:, i] = path.gain * z ** -(whole + (part > 0))
    H = factors[:, :, None] * H
    return H[:, list(plant.order)] if plant.order else H
