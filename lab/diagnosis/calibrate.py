"""Calibrate: the model's own parameters, robustly even when the model is badly off, and a survey of what moves."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from identification.progress import UNHEARD, Work
from identification.recording import Array
from lab.diagnosis.fit import Fit, fit
from lab.diagnosis.misfit import Misfit
from lab.diagnosis.observer import kalman_gain
from lab.diagnosis.parameters import Parameters
from lab.diagnosis.starts import best_starts, moving, starts_of, with_starts
from lab.diagnosis.whiteness import whiteness
from lab.effects.survey import Survey
from lab.plant import Path
from lab.responder import ready
from lab.rig import Rig
from lab.twin import Twin

WIDTHS = {"mass": 0.005, "stiffness": 0.02, "damping": 0.25}
"""Default prior: relative tolerance of nominal masses, stiffnesses and dampings, one standard deviation."""
SHARES = (0.3, 0.1, 0.03, 0.01, 0.003)
"""Trust in the measurements, from a model that is badly off to one that is nearly right."""


@dataclass(frozen=True, eq=False)
class Calibration:
    """The calibrated model.

    Attributes:
        misfit: with its survey.
        fit: by simulation error alone.
        guided: by prediction error with the gain that suits how wrong the model still is.
        share: of unknown force in that gain.
    """

    misfit: Misfit
    fit: Fit
    guided: Fit
    share: float

    @property
    def observer(self) -> Array:
        """The gain of the guided fit."""
        return kalman_gain(self.misfit, self.guided.theta, self.share)


def parameters_of(twin: Twin, widths: Mapping[str, float] | None = None) -> Parameters:
    """The model's own parameters with their priors; `widths` by group or by name ("stiffness spring2_3").

    The gain of an input is a parameter where it has a width ("gain", "gain motor"); else it is known exactly.
    """
    given = {**WIDTHS, **(widths or {})}

    def width(name: str) -> float:
        return given.get(name, given.get(name.partition(" ")[0], 0.0))

    names = [f"mass {b}" for b in twin.bodies]
    names += [f"{group} {s}" for group in ("stiffness", "damping") for s in twin.springs]
    gains = gain_names(twin)
    inputs = tuple(i for i, name in enumerate(gains) if width(name))
    names += [gains[i] for i in inputs]
    values = np.array([width(name) for name in names])
    sizes = len(twin.bodies), len(twin.springs)
    return Parameters(tuple(names), values, *sizes, np.eye(len(names)), inputs=inputs)


def gain_names(twin: Twin) -> list[str]:
    """Name of the gain of each input, as a parameter."""
    return [f"gain {channel.name}" for channel in twin.plant.inputs]


def calibrate(misfit: Misfit, rig: Rig, work: Work = UNHEARD) -> Calibration:
    """The most likely parameters of the model as it is, without any cause."""
    theta = np.zeros(misfit.parameters.n)
    direct = fit(misfit, theta, iterations=20)
    if whiteness(direct.residual, misfit.driven, missing=np.isnan(misfit.measured)).white:
        # Where nothing but noise is left, no detour would end anywhere better.
        misfit = replace(misfit, survey=survey_of(misfit, rig, direct.theta, direct.residual))
        return Calibration(misfit, direct, direct, 0.0)
    misfit = replace(misfit, survey=survey_of(misfit, rig, theta))
    rough = fit(misfit, theta, observer=kalman_gain(misfit, theta, SHARES[0]), iterations=4)
    theta = rough.theta
    levels = {}
    for share in work.each(SHARES):
        gain = kalman_gain(misfit, theta, share)
        levels[share] = fit(misfit, theta, observer=gain, iterations=2, tolerance=5).objective
    plain = fit(misfit, theta, iterations=20)
    late = moving(misfit, plain)
    if late:
        misfit = with_starts(misfit, late)
        theta, begun = (np.append(t, np.zeros(misfit.parameters.n - t.size)) for t in (theta, plain.theta))
        plain = fit(misfit, begun, iterations=20)
    levels[0.0] = plain.objective
    share = min(levels, key=lambda s: levels[s])
    start_theta = theta if share else plain.theta
    guided = fit(misfit, start_theta, observer=kalman_gain(misfit, start_theta, share), iterations=5)
    again = fit(misfit, guided.theta, iterations=20)
    best = min(plain, again, *(() if late else (direct,)), key=lambda f: f.objective)
    misfit = replace(misfit, survey=survey_of(misfit, rig, best.theta, best.residual))
    return Calibration(misfit, best, guided, share)


def survey_of(misfit: Misfit, rig: Rig, theta: Array, residual: Array | None = None) -> Survey:
    """How strongly the test moves the model, and where its residual has tones."""
    plant = misfit.plant(theta)
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
    responder = ready(probe, misfit.dt)
    # Before any fit, a free decay begins as suits the model as given.
    starts = starts_of(misfit, theta) if np.any(theta) else best_starts(misfit)
    motion = np.concatenate(
        [
            responder.outputs(u, y.shape[1], initial=start)
            for (u, y), start in zip(misfit.records, starts, strict=True)
        ],
        axis=1,
    )
    q, v, a = motion[:n], motion[n : 2 * n], motion[2 * n :]
    outputs = np.concatenate([y for _, y in misfit.records], axis=1)
    inputs = np.concatenate([u for u, _ in misfit.records], axis=1)
    peaks = tone_peaks(residual, misfit.dt) if residual is not None else ([()] * outputs.shape[0], ())
    return Survey(
        rig,
        misfit.twin,
        q @ q.T / q.shape[1],
        v @ v.T / v.shape[1],
        np.sqrt(np.mean((plant.mass @ a) ** 2, axis=1)),
        np.sqrt(np.nanmean(outputs**2, axis=1)),
        # Peaks that fits see: a limit beyond them would do nothing.
        np.nanmax(np.abs(misfit.measured), axis=1),
        np.sqrt(np.nanmean(inputs**2, axis=1)),
        np.nanmax(np.abs(misfit.driven), axis=1, initial=0.0),
        tuple(peaks[0]),
        tuple(peaks[1]),
        misfit.dt,
        max(y.shape[1] for _, y in misfit.records) * misfit.dt,
    )


def tone_peaks(residual: Array, dt: float) -> tuple[list[tuple[float, ...]], tuple[float, ...]]:
    """The frequency at which each residual, and all of them together, stand out most over their neighbourhood."""
    n = residual.shape[1]
    size = 4 * n
    spectrum = (
        np.abs(np.fft.rfft(residual / residual.std(axis=1, keepdims=True) * np.hanning(n), size, axis=1)) ** 2
    )
    frequency = np.fft.rfftfreq(size, dt)
    width = min(201, frequency.size)

    def peak(power: Array) -> tuple[float, ...]:
        log = np.log(power + 1e-12)
        height = log - np.convolve(log, np.ones(width) / width, "same")
        height[:40] = height[-40:] = -np.inf
        return (float(frequency[int(np.argmax(height))]),)

    return [peak(row) for row in spectrum], peak(spectrum.mean(axis=0))
