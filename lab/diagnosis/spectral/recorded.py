"""Recorded: a recording without measured forces, as an experiment in the frequency domain."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from identification.recording import Array, Recording
from lab.diagnosis.outcome import SpectralPrediction
from lab.diagnosis.parameters import Parameters
from lab.diagnosis.spectral.ambient import Ambient, pushed, started
from lab.diagnosis.spectral.fit import SpectralFit
from lab.diagnosis.spectral.goodness import averaged, goodness, grouped
from lab.diagnosis.spectral.lines import (
    Averages,
    Bands,
    averages,
    bands_for,
    half_bandwidth,
    piece_length,
    pieces_of,
)
from lab.diagnosis.spectral.motion import survey_of
from lab.diagnosis.spectral.tones import FoundTone, find_tones
from lab.diagnosis.spectral.transfer import Complex
from lab.effects.effect import Effect
from lab.effects.survey import Survey
from lab.errors import LabError
from lab.rig import Rig
from lab.twin import Twin

TRAIN = 0.7
"""Share of every record, from its start, that fits may see."""
PARTS = (4, 2)
"""Parts of a record that are compared to see a spring drift, those that are tried first."""
LINES = 100.0
"""Lines averaged for one held-out error, per channel."""
VISIBLE = (
    "mass_change",
    "stiffness_change",
    "damping_change",
    "missing_spring",
    "attached_oscillator",
    "stiffness_drift",
    "unmeasured_force",
    "sensor_gain",
    "sensor_delay",
    "sensor_lag",
    "sensor_swap",
    "line_hum",
)
"""Causes that show in the spectra of outputs."""


@dataclass(frozen=True, eq=False)
class Recorded:
    """Outputs of every record, training samples first.

    Attributes:
        outputs: (n_outputs, n_samples) each; NaN where missing.
        share: of every record that fits may see.
        dt: sample time [s].
        scale: RMS of every channel.
        rows: direction of every unknown force, (n_forces, n_dofs).
        band: lowest and highest frequency used [Hz]; all when None.
        units: of the channels.
        names: likewise.
    """

    outputs: tuple[Array, ...]
    share: float
    dt: float
    scale: Array
    rows: Array
    band: tuple[float, float] | None
    units: tuple[str, ...]
    names: tuple[str, ...]

    visible = VISIBLE

    @classmethod
    def of(
        cls,
        recording: Recording,
        rig: Rig,
        twin: Twin,
        *,
        band: tuple[float, float] | None,
        share: float = TRAIN,
    ) -> Recorded:
        """The experiment of a recording whose channels are those of the rig.

        Forces act on every degree of freedom, or where the recording's input channels say if it names any.
        """
        outputs = tuple(np.asarray(record.outputs[:, :], dtype=float) for record in recording.records)
        whole = np.concatenate(outputs, axis=1)
        with np.errstate(invalid="ignore"):
            known = np.sum(np.isfinite(whole), axis=1)
        if not np.all(known):
            name = recording.outputs[int(np.argmin(known))].name
            raise LabError(f"output {name!r} has no sample; leave the channel out")
        scale = np.nanstd(whole, axis=1)
        if not np.all(scale > 0):
            name = recording.outputs[int(np.argmin(scale))].name
            raise LabError(f"output {name!r} never changes; leave the dead channel out")
        rows = twin.plant.forces.T if recording.inputs else np.eye(twin.plant.n_dofs)
        units = tuple(channel.unit for channel in recording.outputs)
        names = tuple(channel.name for channel in recording.outputs)
        return cls(outputs, share, recording.dt, scale, rows, band, units, names)

    @property
    def training(self) -> list[Array]:
        """Samples that fits may see."""
        return [y[:, : int(self.share * y.shape[1])] for y in self.outputs]

    def likelihood(self, twin: Twin, parameters: Parameters, rig: Rig) -> Ambient:
        """The likelihood of the training samples, forces and noise not fitted yet."""
        twin = pushed(twin, self.rows)
        length = piece_length(self.training)
        bands = bands_for(twin.plant, length, self.dt, band=self.band)
        data = self._averages(self.training, bands)
        survey = self._survey(rig, twin, np.ones(len(self.rows)))
        found = started(twin, parameters, survey, [data], shares=[0.5 * self.share], scale=self.scale)
        return self.surveyed(found, found.nuisance_mean)

    def surveyed(self, likelihood: Ambient, nuisance: Array) -> Ambient:
        """The likelihood that knows how strongly the fitted forces move the structure."""
        power = np.exp(nuisance[: likelihood.n_forces])
        return replace(likelihood, survey=self._survey(likelihood.survey.rig, likelihood.twin, power))

    def weighted(self, likelihood: Ambient, predicted: Complex) -> Recorded:
        """The same: how spectra scatter is known."""
        return self

    def lesson_of(self, likelihood: Ambient, predicted: Complex) -> None:
        """None: errors of a model in spectra are not told from those of the data."""

    def after(self, lesson: None) -> Recorded:
        """The same."""
        return self

    def again(self, likelihood: Ambient) -> Ambient:
        """The likelihood of the training samples as they are now, with tones taken out."""
        first = likelihood.data[0].bands
        low = (first.first[0] - 0.5) / (first.length * first.dt)
        return likelihood.with_data(self._stretches(likelihood, len(likelihood.data), low), likelihood.shares)

    def in_parts(self, likelihood: Ambient) -> Ambient | None:
        """The likelihood of consecutive parts of the records, at the frequencies whose resonances they resolve.

        None where they are too short for most of them. Two parts resolve more than four, and tell three quarters of what
        the record tells about a change along it.
        """
        for parts in PARTS:
            low = self._resolved_from(likelihood, parts)
            if low is not None:
                shares = [self.share * (k + 0.5) / parts for k in range(parts)]
                return likelihood.with_data(self._stretches(likelihood, parts, low), shares)
        return None

    def _resolved_from(self, likelihood: Ambient, parts: int) -> float | None:
        """Frequency above which parts resolve all resonances [Hz]; None where that is less than half of all lines."""
        try:
            length = piece_length([y[:, : y.shape[1] // parts] for y in self.training])
        except LabError:
            return None
        f = likelihood.data[0].bands.frequency_hz
        blurred = f[half_bandwidth(likelihood.twin.plant, f) * length * self.dt < 1]
        if not blurred.size:
            return 0.0
        return float(blurred[-1]) if blurred[-1] < 0.5 * (f[0] + f[-1]) else None

    def held_out(self, likelihood: Ambient) -> Ambient:
        """The likelihood of samples that no fit has seen."""
        rest = [y[:, int(self.share * y.shape[1]) :] for y in self.outputs]
        bands = bands_for(likelihood.twin.plant, piece_length(rest), self.dt, band=self.band)
        return likelihood.with_data([self._averages(rest, bands)], [(1 + self.share) / 2])

    def error(self, held_out: Ambient, predicted: Complex) -> float:
        """Relative error of the spectral matrix, RMS over frequency: that of L⁻¹ Ŝ L⁻ᴴ against the identity."""
        Z, _ = self._grouped(held_out, predicted)
        return float(
            np.sqrt(np.mean(np.sum(np.abs(Z - np.eye(Z.shape[-1])) ** 2, axis=(1, 2)) / Z.shape[-1]))
        )

    def floor(self, held_out: Ambient, predicted: Complex) -> float:
        """The error that a true model has, since spectra scatter: E ‖Z - I‖² = n_outputs² / ν."""
        Z, n = self._grouped(held_out, predicted)
        return float(np.sqrt(np.mean(Z.shape[-1] / n)))

    def left(self, likelihood: Ambient, predicted: Complex) -> str:
        """Where something is left that chance does not explain, in a sentence; empty where nothing is."""
        found = goodness(likelihood, predicted)
        if found.passed:
            return ""
        where = " and ".join(self.names[i] for i in found.channels)
        what = (
            f"the power of {where} is {found.ratio:.3g} times what the other channels leave to be expected"
            if len(found.channels) == 1
            else f"a squared coherence of {found.ratio:.2g} is left between {where}"
        )
        return (
            f"something is left that no cause in the catalogue explains: between {found.band[0]:.4g} and "
            f"{found.band[1]:.4g} Hz {what}, which chance brings with a probability of {found.probability:.1g} only"
        )

    def tones(
        self, likelihood: Ambient, found: SpectralFit, effects: Mapping[str, type[Effect]]
    ) -> tuple[list[FoundTone], int]:
        """Tones in the training samples, best first, and at how many places they were looked for."""
        return find_tones(likelihood, found, self.training, effects, band=self.band)

    def without(self, tone: FoundTone) -> Recorded:
        """The recording with a tone taken out."""
        return replace(self, outputs=tuple(tone.removed(y, self.dt) for y in self.outputs))

    def shown(self, held_out: Ambient, predicted: tuple[Complex, Complex, Complex]) -> SpectralPrediction:
        """Power spectral densities of held-out samples, one-sided, and those of three models."""
        factor = 2 * self.dt * self.scale[:, None] ** 2
        measured, nominal, calibrated, extended = (
            factor * np.diagonal(S[0], axis1=1, axis2=2).real.T for S in (held_out.measured, *predicted)
        )
        units = tuple(f"({unit})^2/Hz" for unit in self.units)
        f = held_out.data[0].bands.frequency_hz
        return SpectralPrediction(f, measured, nominal, calibrated, extended, self.names, units)

    def warnings(self, likelihood: Ambient, nominal: Ambient) -> list[str]:
        """What these data cannot tell."""
        said = [
            "no force was measured: all masses, stiffnesses and dampings together, and the gains of all sensors together, are "
            "known only as well as before; weigh a body or measure one force to know their scale"
        ]
        where = "every degree of freedom" if self.rows.shape[0] == self.rows.shape[1] else "the named inputs"
        said.append(
            f"the unknown forces are taken for white noise of unknown intensity at {where}; "
            "name a narrower band if they are not"
        )
        bands: Bands = nominal.data[0].bands
        sharpest = half_bandwidth(nominal.twin.plant, bands.frequency_hz)
        k = int(np.argmin(sharpest))
        spacing = 1 / (bands.length * bands.dt)
        if sharpest[k] < 2 * spacing:
            said.append(
                f"pieces of {bands.length} samples have lines every {spacing:.3g} Hz, too far apart for the resonance near "
                f"{bands.frequency_hz[k]:.4g} Hz, whose half bandwidth is {sharpest[k]:.2g} Hz; record longer"
            )
        return said

    def _stretches(self, likelihood: Ambient, parts: int, low: float) -> list[Averages]:
        cut = [
            [y[:, k * y.shape[1] // parts : (k + 1) * y.shape[1] // parts] for y in self.training]
            for k in range(parts)
        ]
        length = piece_length([y for part in cut for y in part])
        lowest, highest = self.band or (0.0, np.inf)
        bands = bands_for(likelihood.twin.plant, length, self.dt, band=(max(low, lowest), highest))
        return [self._averages(part, bands) for part in cut]

    def _averages(self, outputs: list[Array], bands: Bands) -> Averages:
        return averages(pieces_of([y / self.scale[:, None] for y in outputs], bands.length), bands)

    def _survey(self, rig: Rig, twin: Twin, power: Array) -> Survey:
        longest = max(y.shape[1] for y in self.outputs) * self.dt
        whole = np.concatenate([np.zeros(len(twin.plant.inputs)), power])
        return survey_of(rig, twin, twin.plant, whole, dt=self.dt, duration=longest, output_rms=self.scale)

    def _grouped(self, held_out: Ambient, predicted: Complex) -> tuple[Complex, Array]:
        Z, counts = held_out.normalized(predicted)[0], held_out.counts[0]
        return averaged(Z, counts, grouped(counts, LINES * Z.shape[-1]))
