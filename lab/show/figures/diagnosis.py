"""Figures of a diagnosis: measured against predicted, and what each model leaves over time, frequency and amplitude."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from identification.recording import Array, Record, Recording
from lab.diagnosis.outcome import Diagnosis, Prediction
from lab.show.diagnosed import Diagnosed
from lab.show.drawing import SERIES
from lab.show.figures.canvas import Drawing, drawing, few_ticks, logarithmic, plain, stacked
from lab.show.residuals import (
    CLOSE_UP,
    LABELS,
    levels,
    relative_errors,
    residual_spectra,
    shown_models,
    signal_rms,
    worst_stretch,
)
from lab.show.signals import envelope, spectra

MAX_OUTPUTS = 6
"""Outputs shown: those with the largest error of the calibrated model."""
MEASURED: dict[str, Any] = {"color": "0.65", "linewidth": 2.2}
LOOKS: dict[str, dict[str, Any]] = {
    "nominal": {"color": SERIES[1], "linestyle": (0, (1, 1))},
    "calibrated": {"color": SERIES[4], "linestyle": (0, (5, 1.5))},
    "extended": {"color": SERIES[0], "linestyle": "-"},
}
FLOOR: dict[str, Any] = {"color": "black", "linestyle": (0, (3, 1, 1, 1)), "linewidth": 0.8}
FLOOR_SAYS = "The noise floor is drawn as the same share of the signal in every channel."


def figures_of(diagnosis: Diagnosis, recording: Diagnosed) -> list[Callable[[], Drawing | None]]:
    """What draws each figure, where the data support it, in the order of the report."""
    if diagnosis.spectra is not None:
        from lab.show.figures.spectral import draw_spectra

        return [partial(draw_spectra, diagnosis, diagnosis.spectra)]
    assert isinstance(recording, Recording)  # responses are spectra, drawn above
    rows = worst_outputs(diagnosis)
    figures = (
        predictions,
        residuals_over_time,
        residuals_over_frequency,
        residuals_over_amplitude,
    )
    return [partial(figure, diagnosis, recording, rows) for figure in figures]


def worst_outputs(diagnosis: Diagnosis) -> list[int]:
    """Outputs to show, in their order: those in which the calibrated model errs most."""
    errors = relative_errors(diagnosis, "calibrated")
    return sorted(int(row) for row in np.argsort(-errors, kind="stable")[:MAX_OUTPUTS])


def predictions(diagnosis: Diagnosis, recording: Recording, rows: list[int]) -> Drawing:
    """Measured and predicted outputs of one record: the whole as bands, and a close-up sample by sample."""
    number, start = worst_stretch(diagnosis, CLOSE_UP)
    prediction, rate = diagnosis.predictions[number], recording.sample_rate
    models = shown_models(diagnosis)
    shown = slice(start, start + CLOSE_UP)
    time = np.arange(prediction.measured.shape[1]) / rate

    def paint(figure: Figure) -> None:
        frames = stacked(figure, len(rows), 2, width_ratios=[1, 1.4])
        for (whole, close), row in zip(frames, rows, strict=True):
            _bands(whole, prediction, row, rate, ("measured", models[0], models[-1]))
            whole.axvspan(time[start], time[shown][-1], color="0.88", zorder=0)
            close.plot(time[shown], prediction.measured[row, shown], label="measured", **MEASURED)
            for model in models:
                close.plot(
                    time[shown], getattr(prediction, model)[row, shown], label=LABELS[model], **LOOKS[model]
                )
            channel = recording.outputs[row]
            whole.set_ylabel(
                f"{plain(channel.name, 16)}\n[{channel.unit.replace('^2', '²')}]",
                rotation=0,
                ha="right",
                va="center",
            )
            for axes in (whole, close):
                few_ticks(axes, 3)
        for axes in frames[-1]:
            axes.set_xlabel("time [s]")
        figure.legend(*frames[0, 1].get_legend_handles_labels(), loc="outside upper center", ncols=4)

    caption = (
        f"Outputs of record {number}, measured and predicted. Left: smallest and largest values over the whole record, of "
        f"the measured signal (grey), the model as given (dotted) and the {models[-1]} model (line). Right: the stretch "
        "kept out of every fit in which the calibrated model errs most (shaded on the left)."
    )
    return drawing("prediction", 0.7 + 0.9 * len(rows), caption + _left_out(rows, recording), paint)


def _bands(axes: Axes, prediction: Prediction, row: int, rate: float, names: tuple[str, ...]) -> None:
    for name in names:
        record = Record("other", np.zeros((0, 0)), getattr(prediction, name)[row : row + 1])
        part = envelope(record, rate, n_bins=250)
        signal = part.outputs[0]
        look = MEASURED if name == "measured" else {**LOOKS[name], "linewidth": 0.6}
        if part.samples_per_bin == 1:
            axes.plot(part.time, signal, **look)
        elif name == "measured":
            axes.fill_between(part.time[::2], signal[::2], signal[1::2], color="0.75", linewidth=0)
        else:
            axes.plot(part.time[::2], signal[::2], **look)
            axes.plot(part.time[::2], signal[1::2], **look)


def residuals_over_time(diagnosis: Diagnosis, recording: Recording, rows: list[int]) -> Drawing:
    """RMS of what each model leaves in short stretches, the records one after the other, and the noise floor."""
    rate, parts = recording.sample_rate, levels(diagnosis, recording.sample_rate)
    lengths = [p.measured.shape[1] / rate for p in diagnosis.predictions]
    starts = np.concatenate([[0.0], np.cumsum(lengths)])
    floor = diagnosis.errors.noise_floor * signal_rms(diagnosis)

    def paint(figure: Figure) -> None:
        frames = stacked(figure, len(rows))[:, 0]
        for axes, row in zip(frames, rows, strict=True):
            for number, (start, part) in enumerate(zip(starts, parts, strict=False)):
                for model in shown_models(diagnosis):
                    label = LABELS[model] if number == 0 else None
                    axes.plot(
                        start + part.time, _positive(part.residual[model][row]), label=label, **LOOKS[model]
                    )
                held_out = diagnosis.predictions[number].first_held_out / rate
                if held_out < lengths[number]:
                    axes.axvspan(start + held_out, start + lengths[number], color="0.93", zorder=0)
                if start:
                    axes.axvline(start, color="0.5", linestyle=":", linewidth=0.8)
            _floor(axes, floor[row])
            _name(axes, recording, row)
        frames[-1].set_xlabel("time [s]")
        frames[-1].set_xlim(0, starts[-1])
        figure.legend(*frames[0].get_legend_handles_labels(), loc="outside upper center", ncols=4)

    caption = "RMS of measured less predicted in short stretches of time. Shaded: kept out of every fit. "
    if len(parts) > 1:
        caption += "Dotted vertical lines: where the next record begins. "
    return drawing(
        "residual-time", 0.7 + 0.85 * len(rows), caption + FLOOR_SAYS + _left_out(rows, recording), paint
    )


def residuals_over_frequency(diagnosis: Diagnosis, recording: Recording, rows: list[int]) -> Drawing | None:
    """Spectral densities of the outputs and of what each model leaves; None when the records are too short."""
    measured = spectra(recording)
    left = {model: residual_spectra(diagnosis, recording, model) for model in shown_models(diagnosis)}
    if measured is None or any(spectrum is None for spectrum in left.values()):
        return None
    white = (diagnosis.errors.noise_floor * signal_rms(diagnosis)) ** 2 * 2 / recording.sample_rate
    f = measured.frequency_hz[1:]

    def paint(figure: Figure) -> None:
        frames = stacked(figure, len(rows))[:, 0]
        for axes, row in zip(frames, rows, strict=True):
            axes.plot(f, _positive(measured.output_density[row, 1:]), label="measured", **MEASURED)
            for model, spectrum in left.items():
                assert spectrum is not None
                axes.plot(
                    f,
                    _positive(spectrum.output_density[row, 1:]),
                    label=f"{LABELS[model]}, residual",
                    **{**LOOKS[model], "linewidth": 0.8},
                )
            _floor(axes, white[row])
            _name(axes, recording, row, density=True)
        frames[-1].set_xlabel("frequency [Hz]")
        frames[-1].set_xlim(0, recording.sample_rate / 2)
        figure.legend(*frames[0].get_legend_handles_labels(), loc="outside upper center", ncols=5)

    caption = (
        "Power spectral density of the outputs (grey) and of measured less predicted. "
        "The noise floor is drawn as white noise that is the same share of the signal in every channel."
    )
    return drawing("residual-frequency", 0.7 + 1.1 * len(rows), caption + _left_out(rows, recording), paint)


def residuals_over_amplitude(diagnosis: Diagnosis, recording: Recording, rows: list[int]) -> Drawing:
    """RMS of what models leave against RMS of the signal, a point for each short stretch of time."""
    parts = levels(diagnosis, recording.sample_rate)
    floor = diagnosis.errors.noise_floor * signal_rms(diagnosis)
    n_columns = min(3, len(rows))
    n_lines = -(-len(rows) // n_columns)
    marks = {"calibrated": "x", "extended": "."}

    def paint(figure: Figure) -> None:
        frames = figure.subplots(n_lines, n_columns, squeeze=False)
        for axes, row in zip(frames.ravel(), rows, strict=False):
            motion = np.concatenate([part.measured[row] for part in parts])
            for model in shown_models(diagnosis)[1:]:
                left = np.concatenate([part.residual[model][row] for part in parts])
                axes.plot(
                    motion,
                    left,
                    linestyle="",
                    marker=marks[model],
                    markersize=3.5,
                    color=LOOKS[model]["color"],
                    label=LABELS[model],
                )
            _floor(axes, floor[row])
            axes.set_xlim(left=0)
            axes.set_ylim(bottom=0)
            unit = recording.outputs[row].unit.replace("^2", "²")
            axes.set_title(f"{plain(recording.outputs[row].name, 20)} [{unit}]")
            few_ticks(axes, 3)
        for axes in frames.ravel()[len(rows) :]:
            axes.set_visible(False)
        for axes in frames[-1]:
            axes.set_xlabel("RMS measured")
        for axes in frames[:, 0]:
            axes.set_ylabel("RMS residual")
        figure.legend(*frames[0, 0].get_legend_handles_labels(), loc="outside upper center", ncols=3)

    caption = (
        "RMS of measured less predicted against RMS measured, a point for each short stretch of time: a rising cloud "
        "speaks of an error that grows with the motion. "
    )
    return drawing(
        "residual-amplitude", 0.5 + 1.8 * n_lines, caption + FLOOR_SAYS + _left_out(rows, recording), paint
    )


def _floor(axes: Axes, level: float) -> None:
    if np.isfinite(level) and level > 0:
        axes.axhline(level, label="noise floor", **FLOOR)


def _name(axes: Axes, recording: Recording, row: int, *, density: bool = False) -> None:
    """Channel and unit beside a logarithmic axis."""
    channel = recording.outputs[row]
    unit = channel.unit.replace("^2", "²")
    unit = f"({unit})²/Hz" if density else unit
    axes.set_ylabel(f"{plain(channel.name, 16)}\n[{unit}]", rotation=0, ha="right", va="center")
    if any(np.any(np.asarray(line.get_ydata(), dtype=float) > 0) for line in axes.get_lines()):
        logarithmic(axes)


def _positive(values: Array) -> Array:
    return np.where(values > 0, values, np.nan)


def _left_out(rows: list[int], recording: Recording) -> str:
    n = len(recording.outputs)
    return f" {len(rows)} of {n} outputs shown, those with the largest errors." if len(rows) < n else ""
