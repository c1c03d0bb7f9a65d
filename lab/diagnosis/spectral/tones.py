"""Tones: sines that stand out of the spectrum, as hum of one channel or as a force on a body."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
import scipy.fft
import scipy.optimize

from identification.recording import Array
from lab.diagnosis.outcome import Quantity
from lab.diagnosis.spectral.ambient import Ambient
from lab.diagnosis.spectral.fit import SpectralFit
from lab.diagnosis.spectral.lines import Complex, taper
from lab.diagnosis.spectral.transfer import plant_response
from lab.effects.effect import Effect
from lab.effects.line_hum import LineHum
from lab.effects.unmeasured_force import UnmeasuredForce
from lab.plant import Tone

PRICE = 3
"""Variables of a tone: frequency, sine and cosine."""


@dataclass(frozen=True, eq=False)
class FoundTone:
    """A tone with the evidence for it.

    Attributes:
        effect: hum or force, with its size.
        parameters: with error bars.
        gain: 2 log evidence gained, its price paid.
        frequency_hz: [Hz].
        phasor: complex amplitude of each output, y = Re(phasor e^{2πi f t}) with t from the start of the record.
    """

    effect: Effect
    parameters: Mapping[str, Quantity]
    gain: float
    frequency_hz: float
    phasor: Complex

    @property
    def cause(self) -> str:
        """Name of the cause."""
        return self.effect.cause

    @property
    def location(self) -> str:
        """Where it acts."""
        return self.effect.location

    def removed(self, outputs: Array, dt: float) -> Array:
        """Outputs without the tone."""
        t = np.arange(outputs.shape[1]) * dt
        wave = np.exp(2j * np.pi * self.frequency_hz * t)
        return np.asarray(outputs - (self.phasor[:, None] * wave).real)


@dataclass(frozen=True, eq=False)
class _Source:
    """A place a tone may come from: complex readings of every output per unit of it, at any frequency."""

    kind: type[Effect]
    location: str
    dof: str | None
    column: int


def find_tones(
    likelihood: Ambient,
    found: SpectralFit,
    outputs: Sequence[Array],
    effects: Mapping[str, type[Effect]],
    *,
    band: tuple[float, float] | None = None,
) -> tuple[list[FoundTone], int]:
    """Tones that explain more than chance would, best first, and at how many places they were looked for.

    Around the largest line of each place the frequency is refined until the likelihood is greatest. Everything else in
    the spectrum counts as noise of known spectrum.

    Args:
        likelihood: model and spectra.
        found: with the model's parameters, forces and noise.
        outputs: training samples of every record, (n_outputs, n) each; NaN where missing.
        effects: causes that may be named.
        band: lowest and highest frequency looked at [Hz]; all when None.

    Source: Rife and Boorstyn (1974), IEEE Trans. Inf. Theory 20(5), for one channel in white noise.
    """
    sources = _sources(likelihood, effects)
    if not sources:
        return [], 0
    longest = max(outputs, key=lambda y: y.shape[1])
    n, dt = longest.shape[1], likelihood.dt
    f = np.arange(1, (n + 1) // 2) / (n * dt)
    low, high = band or (0.0, np.inf)
    f = f[(f >= max(low, 2 / (n * dt))) & (f <= high)]
    Y = [_transformed(y, n)[:, np.round(f * n * dt).astype(int)] for y in outputs]
    directions, inverse = _directions(likelihood, found, sources, f), _precision(likelihood, found, f)
    gains = np.sum([_gain(directions, inverse, each) for each in Y], axis=0)  # (n_f, n_sources)
    tones = []
    for j, source in enumerate(sources):
        k = int(np.argmax(gains[:, j]))
        if gains[k, j] < 20:
            continue
        tones.append(_refined(likelihood, found, source, outputs, float(f[k]), 1 / (n * dt)))
    return sorted(tones, key=lambda tone: -tone.gain), len(sources)


def _sources(likelihood: Ambient, effects: Mapping[str, type[Effect]]) -> list[_Source]:
    rig, found = likelihood.survey.rig, []
    if "line_hum" in effects:
        found += [_Source(LineHum, c.name, None, i) for i, c in enumerate(rig.outputs)]
    if "unmeasured_force" in effects:
        for body in rig.bodies:
            for dof in UnmeasuredForce._at(rig, body):
                found.append(_Source(UnmeasuredForce, body, dof, rig.dofs.index(dof)))
    return found


def _directions(likelihood: Ambient, found: SpectralFit, sources: Sequence[_Source], f: Array) -> Complex:
    """Readings per unit of every source, in units of the likelihood's scale, (n_f, n_outputs, n_sources)."""
    plant = likelihood.plant(found.theta, found.causes)
    eye = np.eye(len(likelihood.survey.rig.dofs), plant.n_dofs)
    probe = replace(plant, tones=tuple(Tone(row, 0.0, 0.0, 0.0) for row in eye))
    H = plant_response(probe, f, dt=likelihood.dt)[:, :, len(plant.inputs) :]
    hum = np.broadcast_to(
        np.eye(likelihood.scale.size), (f.size, likelihood.scale.size, likelihood.scale.size)
    )
    columns = [(hum if s.kind is LineHum else H)[:, :, s.column] for s in sources]
    return np.asarray(np.stack(columns, axis=2) / likelihood.scale[:, None])


def _precision(likelihood: Ambient, found: SpectralFit, f: Array) -> Complex:
    """S⁻¹ at every frequency, (n_f, n_outputs, n_outputs), in units of the likelihood's scale."""
    plant, n_forces = likelihood.plant(found.theta, found.causes), likelihood.n_forces
    H = plant_response(plant, f, dt=likelihood.dt)[:, :, len(plant.inputs) :][:, :, :n_forces]
    H = H / likelihood.scale[:, None] * np.exp(found.nuisance[:n_forces] / 2)
    S = H @ H.conj().swapaxes(1, 2) + np.diag(np.exp(found.nuisance[n_forces:]))
    return np.asarray(np.linalg.inv(S))


def _transformed(y: Array, n: int) -> Complex:
    """Fourier transform of tapered samples, of unit power in white noise of unit variance; missing ones left out."""
    w = taper(y.shape[1]) * np.all(np.isfinite(y), axis=0)
    centred = np.nan_to_num(y - np.nanmean(y, axis=1, keepdims=True))
    return np.asarray(scipy.fft.rfft(w * centred, n) / np.sqrt(max(np.sum(w**2), 1e-300)))


def _gain(directions: Complex, inverse: Complex, Y: Complex) -> Array:
    """-2 log likelihood gained by a tone at each line from each source, (n_f, n_sources)."""
    weighted = inverse @ directions
    numerator = np.abs(np.einsum("fis,if->fs", weighted.conj(), Y)) ** 2
    return np.asarray(2 * numerator / np.einsum("fis,fis->fs", directions.conj(), weighted).real)


def _refined(
    likelihood: Ambient,
    found: SpectralFit,
    source: _Source,
    outputs: Sequence[Array],
    start: float,
    spacing: float,
) -> FoundTone:
    """The tone of a source near a frequency where the likelihood is greatest, its phase the same in every record."""
    dt = likelihood.dt
    windows = [taper(y.shape[1]) * np.all(np.isfinite(y), axis=0) for y in outputs]
    signals = [
        np.nan_to_num(y - np.nanmean(y, axis=1, keepdims=True)) / likelihood.scale[:, None] for y in outputs
    ]
    times = [np.arange(y.shape[1]) * dt for y in outputs]
    inverse = _precision(likelihood, found, np.array([start]))[0]

    energy = sum(float(np.sum(w)) for w in windows)
    power = sum(float(np.sum(w**2)) for w in windows)

    def direction(f: float) -> Complex:
        return np.asarray(_directions(likelihood, found, [source], np.array([f]))[0, :, 0])

    def fitted(f: float, d: Complex) -> tuple[complex, float, float]:
        """Phasor of the source, gain, and information on it."""
        numerator = 0j
        for y, w, t in zip(signals, windows, times, strict=True):
            numerator += d.conj() @ inverse @ (y @ (w * np.exp(-2j * np.pi * f * t)))
        strength = float((d.conj() @ inverse @ d).real)
        gain = 2 * np.abs(numerator) ** 2 / (strength * power)
        return 2 * numerator / (strength * energy), float(gain), strength

    first = direction(start)
    best = scipy.optimize.minimize_scalar(
        lambda f: -fitted(f, first)[1], bounds=(start - spacing, start + spacing), method="bounded",
        options={"xatol": 1e-6 * spacing},
    )  # fmt: skip
    f = float(best.x)
    d = direction(f)
    phasor, gain, strength = fitted(f, d)
    # Re((c - i s) e^{iωt}) = c cos ωt + s sin ωt
    sine, cosine = -phasor.imag, phasor.real
    effect = source.kind.of(
        source.location,
        {"frequency_hz": f, "sine": sine, "cosine": cosine, **({"dof": source.dof} if source.dof else {})},
    )
    spread = _spread(phasor, strength, times)
    values = effect.parameters
    quantities = {name: Quantity(values[name], spread[name], effect.units[name]) for name in spread}
    n = sum(y.size for y in outputs)
    return FoundTone(effect, quantities, gain - PRICE * math.log(n), f, phasor * d * likelihood.scale)


def _spread(phasor: complex, strength: float, times: Sequence[np.ndarray]) -> dict[str, float]:
    """Standard deviations of frequency, amplitude and phase, by the Cramér-Rao bound."""
    t = np.concatenate(list(times))
    A = abs(phasor)
    # Of phase and angular frequency, half the power of the tone counts per sample.
    information = 0.5 * strength * A**2 * np.array([[t.size, t.sum()], [t.sum(), (t**2).sum()]])
    covariance = np.linalg.inv(information)
    return {
        "frequency_hz": float(np.sqrt(covariance[1, 1]) / (2 * np.pi)),
        "amplitude": float(np.sqrt(2 / (strength * t.size))),
        "phase": float(np.sqrt(covariance[0, 0])),
    }
