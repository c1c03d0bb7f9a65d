"""Ambient: spectra of outputs that unmeasured white forces bring about, and their likelihood.

Which white force? One of continuous time would give sampled accelerations an infinite variance, since an accelerometer
reads a force at once. So forces are held over each sample, as everywhere in the lab: the spectrum between samples is then
exact, with all that is folded down from above half the sample rate in it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from identification.recording import Array
from lab.diagnosis.hypothesis import Hypothesis
from lab.diagnosis.parameters import Parameters
from lab.diagnosis.spectral.likelihood import explained
from lab.diagnosis.spectral.lines import Averages, Complex
from lab.diagnosis.spectral.neighbourhood import Neighbourhood, Stepwise
from lab.diagnosis.spectral.transfer import at_time, drifts, plant_response
from lab.effects.survey import Survey
from lab.plant import Plant, Tone
from lab.twin import Twin

FORCE_WIDTH, NOISE_WIDTH = 2.0, 4.0
"""Prior standard deviation of the logarithm of a force's or a noise's power about where it starts."""
NOISE_SHARE = 0.01
"""Noise of each channel at the start, as a share of its RMS."""


@dataclass(frozen=True, eq=False)
class Ambient:
    """Averaged cross-spectra against the twin of a model under white forces of unknown intensity and white noise.

    Nuisances are the logarithms of the power of every force, then of the noise of every channel.

    Attributes:
        twin: of the model; its first tones are the columns of the unknown forces.
        parameters: of the model.
        survey: of rig and data.
        data: spectra of consecutive parts of the records, channels in units of `scale`; one part unless drift is looked for.
        shares: middle of each part, as a share of its record.
        scale: RMS of every channel.
        n_forces: unknown forces.
        nuisance_mean, nuisance_width: prior of the nuisances.
    """

    twin: Twin
    parameters: Parameters
    survey: Survey
    data: tuple[Averages, ...]
    shares: tuple[float, ...]
    scale: Array
    n_forces: int
    nuisance_mean: Array
    nuisance_width: Array

    @property
    def dt(self) -> float:
        """Sample time [s]."""
        return self.data[0].bands.dt

    @property
    def band_hz(self) -> tuple[float, float]:
        """Lowest and highest frequency of the data [Hz]."""
        f = self.data[0].bands.frequency_hz
        return float(f[0]), float(f[-1])

    @property
    def counts(self) -> Array:
        """Lines averaged, (n_parts, n_bands)."""
        return np.stack([part.counts for part in self.data])

    def plant(self, theta: Array, causes: Sequence[Hypothesis] = ()) -> Plant:
        """The plant at parameters `theta` with causes in it."""
        return explained(self.twin.changed(*self.parameters.factors(theta)), causes, self.survey)

    def predict(self, theta: Array, causes: Sequence[Hypothesis], nuisance: Array) -> Complex:
        """S = H Q Hᴴ + R averaged over each band, (n_parts, n_bands, n_outputs, n_outputs)."""
        H = self._responses(theta, causes) * np.exp(nuisance[: self.n_forces] / 2)
        S = 0.5 * (H @ H.conj().swapaxes(-1, -2)).sum(axis=1)
        diagonal = np.arange(self.scale.size)
        S[..., diagonal, diagonal] += np.exp(nuisance[self.n_forces :])
        return np.asarray(S)

    def around(self, theta: Array, causes: Sequence[Hypothesis], nuisance: Array) -> Neighbourhood:
        """Predictions of models near one."""
        return Stepwise(self, theta, causes, nuisance)

    def nuisance_slopes(self, theta: Array, causes: Sequence[Hypothesis], nuisance: Array) -> Complex:
        """Derivative of S by the logarithm of every power, (n_forces + n_outputs, *shape of S)."""
        H = self._responses(theta, causes) * np.exp(nuisance[: self.n_forces] / 2)
        columns = np.moveaxis(H, -1, 0)  # (n_forces, n_parts, 2, n_bands, n_outputs)
        forces = 0.5 * (columns[..., :, None] * columns[..., None, :].conj()).sum(axis=2)
        n = self.scale.size
        noise = np.zeros((n, *forces.shape[1:]), dtype=complex)
        noise[np.arange(n), ..., np.arange(n), np.arange(n)] = np.exp(nuisance[self.n_forces :])[
            :, None, None
        ]
        return np.concatenate([forces, noise])

    def deviance(self, predicted: Complex) -> float:
        """-2 log of the complex Wishart density, 2 Σ ν (log det S + tr S⁻¹ Ŝ).

        Source: Whittle (1953), Ark. Mat. 2, 423-434; Goodman (1963), Ann. Math. Stat. 34, eq. (1.6).
        """
        inverse = _inverse_root(predicted)
        if inverse is None:
            return np.inf
        log_det = -2 * np.log(np.abs(np.diagonal(inverse, axis1=-2, axis2=-1))).sum(axis=-1)
        W = _congruent(inverse, self.measured)
        trace = np.trace(W, axis1=-2, axis2=-1).real
        return float(2 * np.sum(self.counts * (log_det + trace)))

    def whitened(self, predicted: Complex, changes: Complex) -> Array:
        """L⁻¹ ΔS L⁻ᴴ √ν with S = L Lᴴ, as real rows: tr(S⁻¹ ΔS S⁻¹ ΔS') is their product."""
        inverse = _inverse_root(predicted)
        if inverse is None:
            return np.full((len(changes), 1), np.nan)
        W = _congruent(inverse, changes)
        # Real plus imaginary part of a Hermitian matrix keeps its norm, and halves the numbers.
        rows = (W.real + W.imag) * np.sqrt(self.counts)[..., None, None]
        return np.asarray(rows.reshape(len(changes), -1))

    def error(self, predicted: Complex) -> Complex:
        """S less what was measured."""
        return np.asarray(predicted - self.measured)

    def normalized(self, predicted: Complex) -> Complex:
        """L⁻¹ Ŝ L⁻ᴴ, the identity on average where the prediction is true."""
        inverse = _inverse_root(predicted)
        assert inverse is not None
        return _congruent(inverse, self.measured)

    @property
    def measured(self) -> Complex:
        """Ŝ, (n_parts, n_bands, n_outputs, n_outputs)."""
        return np.stack([part.values for part in self.data])

    def with_data(self, data: Sequence[Averages], shares: Sequence[float]) -> Ambient:
        """The same model against other spectra, in the same units."""
        return replace(self, data=tuple(data), shares=tuple(shares))

    def _responses(self, theta: Array, causes: Sequence[Hypothesis]) -> Complex:
        """Responses to the unknown forces at both nodes of every band, (n_parts or 1, 2, n_bands, n_outputs, n_forces)."""
        plant = self.plant(theta, causes)
        found = [self._response(at_time(plant, s)) for s in (self.shares if drifts(plant) else (0.0,))]
        return np.stack(found)

    def _response(self, plant: Plant) -> Complex:
        nodes, n_in = self.data[0].bands.nodes, len(plant.inputs)
        H = plant_response(plant, nodes.ravel(), dt=self.dt)[:, :, n_in : n_in + self.n_forces]
        return (H / self.scale[:, None]).reshape(*nodes.shape, *H.shape[1:])


def pushed(twin: Twin, rows: Array) -> Twin:
    """The twin with a column for an unknown force along each row (n_forces, n_dofs), of no size yet."""
    tones = tuple(Tone(row, 0.0, 0.0, 0.0) for row in rows)
    return replace(twin, plant=replace(twin.plant, tones=tones))


def started(
    twin: Twin,
    parameters: Parameters,
    survey: Survey,
    data: Sequence[Averages],
    *,
    shares: Sequence[float],
    scale: Array,
) -> Ambient:
    """The likelihood with forces that bring about the measured power, all alike, and noise of a percent."""
    n_forces, n = len(twin.plant.tones), scale.size
    mean = np.concatenate([np.zeros(n_forces), np.full(n, 2 * np.log(NOISE_SHARE))])
    width = np.concatenate([np.full(n_forces, FORCE_WIDTH), np.full(n, NOISE_WIDTH)])
    found = Ambient(twin, parameters, survey, tuple(data), tuple(shares), scale, n_forces, mean, width)
    S = found.predict(np.zeros(parameters.n), (), np.where(np.arange(mean.size) < n_forces, 0.0, -np.inf))
    power = [
        np.sum(found.counts[..., None] * np.diagonal(X, axis1=-2, axis2=-1).real) for X in (found.measured, S)
    ]
    mean[:n_forces] = np.log(power[0] / power[1])
    return replace(found, nuisance_mean=mean)


def _inverse_root(S: Complex) -> Complex | None:
    """L⁻¹ of S = L Lᴴ; None where S is no covariance."""
    if not np.all(np.isfinite(S)):
        return None
    try:
        L = np.linalg.cholesky(S)
    except np.linalg.LinAlgError:
        return None
    return np.asarray(np.linalg.inv(L))


def _congruent(A: Complex, X: Complex) -> Complex:
    return np.asarray(A @ X @ A.conj().swapaxes(-1, -2))
