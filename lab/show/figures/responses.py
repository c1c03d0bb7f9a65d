"""Figures of the frequency responses: magnitude and phase, Nyquist plots, coherence."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from identification.recording import Channel, Recording
from identification.response import FrequencyResponse
from identification.systems import StateSpace
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
)
from lab.show.figures.signals import FEW_LINES, MAX_LINES, upright
from lab.show.signals import Spectra, coherence, frequency_response, upper_frequency

MAX_RESPONSES = 4
"""Frequency responses shown."""
Look = dict[str, Any]
MEASURED: Look = {"color": "0.6", "linewidth": 2.0}
IDENTIFIED: Look = {"color": SERIES[0], "linestyle": (0, (4, 2)), "linewidth": 1.0}
FINE = 1000
"""Evenly spaced points of a Nyquist curve."""


def responses(recording: Recording | FrequencyResponse, spectrum: Spectra, result: Result) -> Drawing | None:
    """Magnitude and phase of a few responses, measured and of the identified model; None without inputs."""
    measured = frequency_response(spectrum)
    if measured is None:
        return None
    pairs = chosen_pairs(recording.inputs, recording.outputs)
    top = upper_frequency(result.sample_rate, result.modes.frequency_hz)
    shown = (spectrum.frequency_hz <= top) & (spectrum.frequency_hz > 0)
    frequency = spectrum.frequency_hz[shown]
    system, fine = result.realization.system, np.linspace(frequency[0], frequency[-1], 400)
    n_columns = min(2, len(pairs))
    n_rows = -(-len(pairs) // n_columns)

    def paint(figure: Figure) -> None:
        heights = [2.2, 1.0] * n_rows
        frames = figure.subplots(2 * n_rows, n_columns, sharex=True, squeeze=False, height_ratios=heights)
        for number, (i, j) in enumerate(pairs):
            upper, lower = frames[
                2 * (number // n_columns) : 2 * (number // n_columns) + 2, number % n_columns
            ]
            _response(upper, lower, frequency, measured[shown, i, j], "measured", MEASURED)
            model = _model_response(system, recording.outputs[i], recording.inputs[j], fine)
            if model is not None:
                _response(upper, lower, fine, model, "identified", IDENTIFIED)
            logarithmic(upper)
            unit = f"{upright(recording.outputs[i].unit)} / {upright(recording.inputs[j].unit)}"
            upper.set_title(f"{plain(recording.outputs[i].name, 20)} / {plain(recording.inputs[j].name, 20)}")
            upper.set_ylabel(f"[{unit}]")
            decibel_axis(upper, f"dB re 1 {unit}", factor=20.0)
            lower.set_ylabel("phase [°]")
            lower.set_ylim(-190, 190)
            lower.set_yticks([-180, 0, 180])
            upper.set_xlim(0, top)
        for axes in frames[
            2 * ((len(pairs) - 1) // n_columns) :: 2, len(pairs) % n_columns or n_columns :
        ].ravel():
            axes.set_visible(False)
        for axes in frames[-1]:
            axes.set_xlabel("frequency [Hz]")
        frames[0, 0].legend(loc="best")

    total = len(recording.inputs) * len(recording.outputs)
    kind = " (H1)" if isinstance(recording, Recording) else ""
    caption = (
        f"Frequency responses{kind}, magnitude (left in units, right in decibels) and phase: grey measured, dashed the "
        "identified model."
    )
    if spectrum.window == "none" and spectrum.remainder > 0.01:
        caption += " The records end before the motion has died down, which blunts the measured peaks."
    if total > len(pairs):
        caption += f" {len(pairs)} of {total} shown, driving points first."
    return drawing("frf", 0.3 + 2.7 * n_rows, caption, paint)


def nyquist(recording: Recording | FrequencyResponse, spectrum: Spectra, result: Result) -> Drawing | None:
    """Imaginary over real part of the same responses, with the identified modes on them; None without inputs."""
    measured = frequency_response(spectrum)
    if measured is None:
        return None
    pairs = chosen_pairs(recording.inputs, recording.outputs)
    # Beyond the modes to be trusted noise would fill the picture.
    stable = result.modes.frequency_hz[np.array(result.stable, dtype=bool)]
    marked = stable if stable.size else result.modes.frequency_hz
    top = min(result.sample_rate / 2, 1.1 * float(np.max(marked, initial=0.0)) or result.sample_rate / 2)
    shown = (spectrum.frequency_hz <= top) & (spectrum.frequency_hz > 0)
    if not shown.any():
        return None
    system, fine = result.realization.system, _fine(result, spectrum.frequency_hz[1], top)
    numbers = [int(np.flatnonzero(result.modes.frequency_hz == f)[0]) + 1 for f in marked]

    def paint(figure: Figure) -> None:
        frames = figure.subplots(-(-len(pairs) // 2), min(2, len(pairs)), squeeze=False)
        for axes, (i, j) in zip(frames.ravel(), pairs, strict=False):
            H = measured[shown, i, j]
            axes.plot(H.real, H.imag, linestyle="", marker=".", markersize=3.0, color="0.6", label="measured")
            model = _model_response(system, recording.outputs[i], recording.inputs[j], fine)
            if model is not None:
                axes.plot(model.real, model.imag, label="identified", **{**IDENTIFIED, "linestyle": "-"})
                _mark_on(
                    axes, _model_response(system, recording.outputs[i], recording.inputs[j], marked), numbers
                )
            axes.axhline(0, color="0.8", linewidth=0.6, zorder=0)
            axes.axvline(0, color="0.8", linewidth=0.6, zorder=0)
            axes.set_aspect("equal", adjustable="datalim")
            unit = f"{upright(recording.outputs[i].unit)} / {upright(recording.inputs[j].unit)}"
            axes.set_title(
                f"{plain(recording.outputs[i].name, 20)} / {plain(recording.inputs[j].name, 20)} [{unit}]"
            )
            axes.set_xlabel("real part")
            axes.set_ylabel("imaginary part")
            few_ticks(axes, 4)
        for axes in frames.ravel()[len(pairs) :]:
            axes.set_visible(False)
        frames[0, 0].legend(loc="best")

    caption = (
        f"Nyquist plots up to {top:.4g} Hz: dots measured, line the identified model, circles its natural frequencies with "
        "the numbers of the modes. A mode that stands alone draws a circle."
    )
    return drawing("nyquist", 0.3 + 2.8 * -(-len(pairs) // 2), caption, paint)


def _fine(result: Result, low: float, high: float) -> np.ndarray:
    """Frequencies [Hz] that leave no corner in a Nyquist plot: even ones, and even angles on the circle of each mode."""
    even = np.tan(np.linspace(-1.5, 1.5, 120))
    around = result.modes.frequency_hz[:, None] * (1 + np.abs(result.modes.damping_ratio)[:, None] * even)
    whole = np.concatenate([np.linspace(low, high, FINE), around.ravel()])
    return np.unique(whole[(whole >= low) & (whole <= high)])


def _mark_on(axes: Axes, H: np.ndarray | None, numbers: Sequence[int]) -> None:
    """Circles where the curve passes the natural frequencies, numbered where there are few."""
    if H is None or not H.size:
        return
    axes.plot(H.real, H.imag, linestyle="", marker="o", markersize=4.5, markerfacecolor="none", color="black")
    for number, point in zip(numbers, H, strict=True) if len(numbers) <= MAX_LINES else ():
        axes.annotate(
            str(number), (point.real, point.imag), xytext=(3, 3), textcoords="offset points", fontsize=7.0
        )


def coherences(recording: Recording, spectrum: Spectra, result: Result) -> Drawing | None:
    """Multiple coherence of the outputs with all inputs; None without inputs or averages enough to tell."""
    explained = coherence(spectrum)
    if explained is None:
        return None
    top = upper_frequency(recording.sample_rate, result.modes.frequency_hz)
    shown = (spectrum.frequency_hz <= top) & (spectrum.frequency_hz > 0)
    names = [channel.name for channel in recording.outputs]

    def paint(figure: Figure) -> None:
        axes = figure.subplots()
        f, values = spectrum.frequency_hz[shown], explained[:, shown]
        if len(names) <= MAX_LINES:
            for i, name in enumerate(names):
                axes.plot(
                    f, values[i], color=SERIES[i], linestyle=DASHES[i], label=plain(name, 20), linewidth=0.8
                )
            figure.legend(loc="outside upper center", ncols=MAX_LINES)
        else:
            axes.plot(f, values.T, color="0.7", linewidth=0.5)
            axes.plot(f, np.mean(values, axis=0), color="black")
        axes.set_xlim(0, top)
        axes.set_ylim(0, 1.05)
        axes.set_ylabel("coherence")
        axes.set_xlabel("frequency [Hz]")
        mark_modes(axes, result.modes.frequency_hz)

    n = spectrum.input_density.shape[1]
    caption = (
        f"Multiple coherence: share of each output's power that the inputs explain, {spectrum.n_averages} averages; pure "
        f"noise would show about {n / spectrum.n_averages:.2g}. Dips at resonances speak of too coarse lines, a low level "
        "of noise or of a nonlinear structure. Dotted: identified modes."
    )
    if len(names) > MAX_LINES:
        caption += " Grey: single channels; black: their mean."
    return drawing("coherence", 2.0, caption, paint)


def chosen_pairs(inputs: Sequence[Channel], outputs: Sequence[Channel]) -> list[tuple[int, int]]:
    """Positions (output, input) of the responses to show: driving points first, then others of each input."""
    everything = [(i, j) for i in range(len(outputs)) for j in range(len(inputs))]

    def rank(pair: tuple[int, int]) -> tuple[bool, int, int]:
        i, j = pair
        driving = bool(outputs[i].dof) and outputs[i].dof == inputs[j].dof
        return (not driving, (i - j) % len(outputs), j)

    return sorted(sorted(everything, key=rank)[:MAX_RESPONSES], key=lambda pair: (pair[1], pair[0]))


def _model_response(
    system: StateSpace, output: Channel, drive: Channel, frequency: np.ndarray
) -> np.ndarray | None:
    """Of the identified model, from one input to one output; None when it has no such input."""
    names_in, names_out = ([c.name for c in channels] for channels in (system.inputs, system.outputs))
    if drive.name not in names_in or output.name not in names_out:
        return None
    i, j = names_out.index(output.name), names_in.index(drive.name)
    return np.asarray(system.frequency_response(frequency)[:, i, j])


def _response(upper: Axes, lower: Axes, frequency: np.ndarray, H: np.ndarray, label: str, look: Look) -> None:
    if frequency.size <= FEW_LINES:
        look = {**look, "marker": ".", "linestyle": ""}
    upper.plot(frequency, np.where(np.abs(H) > 0, np.abs(H), np.nan), label=label, **look)
    phase = np.degrees(np.angle(H))
    # A jump from -180 to 180 is no motion: break the line there.
    cut = np.flatnonzero(np.abs(np.diff(phase)) > 180) + 1
    lower.plot(np.insert(frequency, cut, np.nan), np.insert(phase, cut, np.nan), **look)
