"""Motion: how strongly unknown forces move the model, as the proposals of causes want to know it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from identification.recording import Array
from lab.diagnosis.spectral.transfer import plant_response
from lab.effects.survey import Survey
from lab.plant import Path, Plant
from lab.rig import Rig
from lab.twin import Twin


def survey_of(
    rig: Rig,
    twin: Twin,
    plant: Plant,
    power: Array,
    *,
    dt: float,
    duration: float,
    output_rms: Array,
    top_hz: float | None = None,
    n_lines: int = 4096,
) -> Survey:
    """Covariances of motion under white forces of given power in the plant's inputs and then its tones.

    Args:
        rig: as the engineer believes it to be.
        twin: its arrays.
        plant: at the parameters of the day.
        power: variance of every input and tone, (n_inputs + n_tones,).
        dt: sample time [s]; zero for forces that vary continuously.
        top_hz: highest frequency of the forces [Hz]; half the sample rate when None.
        duration: of the longest record [s].
        output_rms: of each recorded output.
        n_lines: frequencies over which spectra are summed.
    """
    n = plant.n_dofs
    eye, zero = np.eye(n), np.zeros((n, n))
    probe = replace(
        plant,
        displacement=np.vstack([eye, zero, zero]),
        velocity=np.vstack([zero, eye, zero]),
        acceleration=np.vstack([zero, zero, eye]),
        outputs=tuple(plant.outputs[:1]) * (3 * n),
        output_paths=(Path(),) * (3 * n),
        order=(),
    )
    # Denser where the resonances of slow structures are.
    top = 0.5 / dt if top_hz is None else top_hz
    edges = top * np.linspace(0, 1, n_lines + 1) ** 2
    f, width = (edges[1:] + edges[:-1]) / 2, np.diff(edges)
    H = plant_response(probe, f, dt=dt) * np.sqrt(power)

    def covariance(rows: slice) -> Array:
        X = H[:, rows].transpose(1, 0, 2).reshape(n, -1) * np.repeat(np.sqrt(width / top), power.size)
        return np.asarray((X @ X.conj().T).real)

    acceleration = covariance(slice(2 * n, 3 * n))
    forces = plant.mass @ acceleration @ plant.mass
    none = ((),) * len(plant.outputs)
    return Survey(
        rig,
        twin,
        covariance(slice(0, n)),
        covariance(slice(n, 2 * n)),
        np.sqrt(np.diag(forces)),
        output_rms,
        np.full(output_rms.size, 4.0) * output_rms,
        np.sqrt(power[: len(plant.inputs)]),
        4 * np.sqrt(power[: len(plant.inputs)]),
        none,
        (),
        0.5 / top,
        duration,
    )
