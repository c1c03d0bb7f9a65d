"""Figures of the measured signals: time histories and spectra."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from identification.recording import Channel, Recording
from lab.result import Result
from lab.show.drawing import SERIES
from lab.show.figures.canvas import (
    DASHES,
    Drawing,
    decibel_axis,
    drawing,
    few_ticks,
    logarithmic,
    mark_modes,
    plain,
    stacked,
)
from lab.show.signals import Spectra, envelope, measured_inputs, upper_frequency

MAX_INPUTS, MAX_OUTPUTS = 4, 8
"""Time histories shown."""
FEW_LINES = 60
"""Spectra of up to so many lines show each of them."""
MAX_LINES = 6
"""Spectra drawn one by one in one frame; of more, all are drawn alike with their mean."""


def time_histories(recording: Recording) -> Drawing:
    """One strip per channel, the records one after the other."""
    parts = [envelope(record, recording.sample_rate, n_bins=400) for record in recording.records]
    lengths = [record.n_samples / recording.sample_rate for record in recording.records]
    starts = np.concatenate([[0.0], np.cumsum(lengths)])
    inputs = measured_inputs(recording)
    strips = [("inputs", row, c) for row, c in enumerate(inputs[:MAX_INPUTS])]
    strips += [("outputs", row, c) for row, c in enumerate(recording.outputs[:MAX_OUTPUTS])]

    def paint(figure: Figure) -> None:
        frames = stacked(figure, len(strips))[:, 0]
        for axes, (side, row, channel) in zip(frames, strips, strict=True):
            for start, part in zip(starts, parts, strict=False):
                signals = getattr(part, side)
                if not signals.shape[0]:
                    continue
                _strip(axes, start + part.time, signals[row], part.samples_per_bin, held=side == "inputs")
                if start:
                    axes.axvline(start, color="0.5", linestyle=":", linewidth=0.8)
            axes.set_ylabel(
                f"{plain(channel.name, 16)}\n[{upright(channel.unit)}]", rotation=0, ha="right", va="center"
            )
            few_ticks(axes, 2)
        frames[-1].set_xlabel("time [s]")
        frames[-1].set_xlim(0, starts[-1])

    caption = "Time histories."
    if len(parts) > 1:
        caption += " Dotted lines: where the next record begins."
    if max(part.samples_per_bin for part in parts) > 1:
        caption += " The band runs from the smallest to the largest sample around each instant."
    return drawing("time", 0.4 + 0.55 * len(strips), caption + _left_out(inputs, recording.outputs), paint)


def _strip(axes: Axes, time: np.ndarray, signal: np.ndarray, samples_per_bin: int, *, held: bool) -> None:
    if samples_per_bin > 1:
        axes.fill_between(time[::2], signal[::2], signal[1::2], color="0.15", linewidth=0.3)
    else:
        axes.plot(time, signal, color="0.15", linewidth=0.7, drawstyle="steps-post" if held else "default")


def _left_out(inputs: Sequence[Channel], outputs: Sequence[Channel]) -> str:
    more = [
        f"{len(channels) - limit} of {len(channels)} {side}"
        for side, channels, limit in (
            ("inputs", inputs, MAX_INPUTS),
            ("outputs", outputs, MAX_OUTPUTS),
        )
        if len(channels) > limit
    ]
    return f" Not shown: {' and '.join(more)}." if more else ""


def output_spectra(recording: Recording, spectrum: Spectra, result: Result) -> Drawing:
    """Spectral densities of the outputs, one frame per unit, with the identified modes."""
    units = list(dict.fromkeys(channel.unit for channel in recording.outputs))
    top = upper_frequency(recording.sample_rate, result.modes.frequency_hz)
    shown = (spectrum.frequency_hz <= top) & (spectrum.frequency_hz > 0)

    def paint(figure: Figure) -> None:
        frames = stacked(figure, len(units))[:, 0]
        for number, (axes, unit) in enumerate(zip(frames, units, strict=True)):
            rows = [row for row, channel in enumerate(recording.outputs) if channel.unit == unit]
            names = [recording.outputs[row].name for row in rows]
            _densities(axes, spectrum.frequency_hz[shown], spectrum.output_density[rows][:, shown], names)
            axes.set_xlim(0, top)
            axes.set_ylabel(f"[({upright(unit)})²/Hz]")
            mark_modes(axes, result.modes.frequency_hz, numbered=number == 0)
            if axes.get_yscale() == "log":
                decibel_axis(axes, f"dB re 1 ({upright(unit)})²/Hz", factor=10.0)
        frames[-1].set_xlabel("frequency [Hz]")

    window = "whole records" if spectrum.window == "none" else "Hann windows"
    caption = (
        f"Power spectral density of the outputs, mean of {spectrum.n_averages} {window}, "
        f"lines {spectrum.frequency_hz[1]:.3g} Hz apart. Dotted: identified modes."
    )
    if any(sum(channel.unit == unit for channel in recording.outputs) > MAX_LINES for unit in units):
        caption += " Grey: single channels; black: their mean."
    return drawing("spectra", 0.4 + 1.9 * len(units), caption, paint)


def _densities(axes: Axes, frequency: np.ndarray, density: np.ndarray, names: Sequence[str]) -> None:
    positive = np.where(density > 0, density, np.nan)
    if len(names) <= MAX_LINES:
        for i, name in enumerate(names):
            marker = "." if frequency.size <= FEW_LINES else ""
            look = {"color": SERIES[i], "linestyle": DASHES[i], "marker": marker}
            axes.plot(frequency, positive[i], label=plain(name, 20), **look)
        axes.legend(loc="best")
    else:
        axes.plot(frequency, positive.T, color="0.7", linewidth=0.5)
        axes.plot(frequency, np.mean(density, axis=0), color="black")
    if np.isfinite(positive).any():
        logarithmic(axes)


def upright(unit: str) -> str:
    """The unit as printed: m/s² for m/s^2."""
    return unit.replace("^2", "²")
