"""Figures of the modes: shapes, stabilization diagram, MAC, singular values, matrices too large to print."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from identification.modes import mac
from identification.stability import NAMES, RULES, STABLE
from identification.systems import SecondOrder
from lab.result import Result
from lab.show.drawing import SERIES
from lab.show.figures.canvas import Drawing, drawing, logarithmic, mark_modes, plain
from lab.show.shapes import shape_table, shown_modes, within_reach
from lab.show.signals import Spectra, mean_density, upper_frequency

MAX_SHAPES = 12
"""Mode shapes shown."""
MAX_NAMED = 12
"""Points of a shape, or rows of a table, that carry names; more carry numbers."""
REJECTED = ("x", "+", "^", "v", "s", "d", "1", "2", "3", "4")
"""A mark for each reason to reject a pole."""


def mode_shapes(result: Result) -> Drawing | None:
    """Displacement shapes as stems, the true ones beside them."""
    table = shape_table(result)
    n_points, n_modes = table.estimate.shape
    if not n_points or not n_modes:
        return None
    rows = shown_modes(result, MAX_SHAPES)
    n_shown = len(rows)
    n_columns = min(4 if n_points <= 8 else 2, n_shown)
    n_rows = -(-n_shown // n_columns)
    with_truth = bool(np.isfinite(table.truth).any())

    def paint(figure: Figure) -> None:
        frames = figure.subplots(n_rows, n_columns, sharex=True, sharey=True, squeeze=False)
        for number, axes in enumerate(frames.ravel()):
            if number >= n_shown:
                axes.set_visible(False)
                continue
            row = rows[number]
            _stems(axes, table.estimate[:, row], table.truth[:, row])
            f, z = result.modes.frequency_hz[row], result.modes.damping_ratio[row]
            axes.set_title(f"{row + 1}: {f:.4g} Hz, {100 * z:.3g} %")
            axes.set_ylim(-1.2, 1.2)
            axes.set_yticks([-1, 0, 1])
        bottom = frames[-1]
        if n_points <= MAX_NAMED:
            names = [plain(label, 16) for label in table.labels]
            bottom[0].set_xticks(range(1, n_points + 1), names, rotation=90)
            for axes in bottom[1:]:
                axes.tick_params(axis="x", labelrotation=90)
        else:
            bottom[0].xaxis.set_major_locator(MaxNLocator(integer=True))

    points = "degrees of freedom" if result.second_order is not None else "output channels"
    caption = f"Mode shapes: displacement at the {points}, largest 1. Bars: real part, dots: imaginary part"
    caption += ", diamonds: true real part." if with_truth else "."
    if n_modes > n_shown:
        caption += f" {n_shown} of {n_modes} modes, those first that stay put over the model orders."
    if n_points > MAX_NAMED:
        caption += (
            f" 1 is {table.labels[0]}, {n_points} is {table.labels[-1]}, in the order of the recording."
        )
    longest = min(16, max(len(label) for label in table.labels))
    return drawing("shapes", 0.4 + 0.06 * longest + 1.3 * n_rows, caption, paint)


def _stems(axes: Axes, shape: np.ndarray, truth: np.ndarray) -> None:
    x = np.arange(1, shape.size + 1)
    axes.axhline(0, color="0.5", linewidth=0.6)
    axes.bar(x, shape.real, width=0.5, color=SERIES[0], edgecolor="black", linewidth=0.4)
    axes.plot(x, shape.imag, linestyle="", marker=".", markersize=3.5, color="black")
    axes.plot(x, truth.real, linestyle="", marker="D", markersize=4.5, markerfacecolor="none", color="black")


def stabilization_diagram(result: Result, spectrum: Spectra | None) -> Drawing | None:
    """Poles of every order, rejected ones by reason, over the spectrum; None for a single order."""
    diagram = result.stabilization
    if diagram is None or not diagram.frequency_hz.size:
        return None
    top = upper_frequency(result.sample_rate, result.modes.frequency_hz)
    labels = np.array(diagram.label)
    reasons = [rule for rule in NAMES if rule in set(diagram.label) - {STABLE}]

    def paint(figure: Figure) -> None:
        axes = figure.subplots()
        for reason, marker in zip(reasons, REJECTED * (1 + len(reasons) // len(REJECTED)), strict=False):
            own = labels == reason
            text = f"{reason} ({int(own.sum())})"
            place = diagram.frequency_hz[own], diagram.orders[own]
            axes.plot(
                *place,
                marker,
                markersize=3,
                color="0.5",
                markerfacecolor="none",
                markeredgewidth=0.7,
                label=text,
            )
        own = labels == STABLE
        place = diagram.frequency_hz[own], diagram.orders[own]
        axes.plot(*place, "o", markersize=2.8, color=SERIES[0], label=f"stable ({int(own.sum())})")
        axes.set_xlim(0, top)
        axes.set_ylim(0, 1.05 * float(np.max(diagram.orders)))
        axes.set_xlabel("frequency [Hz]")
        axes.set_ylabel("model order")
        mark_modes(axes, result.modes.frequency_hz)
        if spectrum is not None:
            _backdrop(axes, spectrum, top)
        handles, texts = axes.get_legend_handles_labels()
        stable_first = [*handles[-1:], *handles[:-1]], [*texts[-1:], *texts[:-1]]
        figure.legend(*stable_first, loc="outside lower center", ncols=3, markerscale=1.4)

    beyond = int(np.sum(diagram.frequency_hz > top))
    caption = "Stabilization diagram. Dotted: the modes accepted; grey line: mean spectrum of the outputs."
    if beyond:
        caption += f" {beyond} poles lie above {top:.4g} Hz."
    if reasons:
        caption += " Why poles were rejected. " + " ".join(f"{r}: {RULES[r]}" for r in reasons)
    return drawing("stabilization", 3.6, caption, paint)


def _backdrop(axes: Axes, spectrum: Spectra, top: float) -> None:
    density = mean_density(spectrum)
    shown = (spectrum.frequency_hz <= top) & (density > 0)
    if not shown.any():
        return
    behind = axes.twinx()
    behind.plot(spectrum.frequency_hz[shown], density[shown], color="0.75", linewidth=0.8)
    logarithmic(behind)
    behind.axis("off")
    axes.set_zorder(behind.get_zorder() + 1)
    axes.patch.set_visible(False)


def mac_table(result: Result) -> Drawing | None:
    """MAC of the identified modes against the true ones, or among themselves where there is no truth."""
    if not len(result.modes):
        return None
    truth = result.truth_modes
    other = within_reach(truth, result.modes) if truth is not None and len(truth) else result.modes
    value = mac(result.modes.shapes, other.shapes)
    rows, columns = ([f"{f:.4g}" for f in modes.frequency_hz] for modes in (result.modes, other))
    against = "identified" if other is result.modes else "true"

    def paint(figure: Figure) -> None:
        axes = figure.subplots()
        axes.imshow(
            value, cmap="Greys", vmin=0, vmax=1, extent=(0.5, len(columns) + 0.5, len(rows) + 0.5, 0.5)
        )
        named = max(value.shape) <= MAX_NAMED
        axes.set_ylabel("identified [Hz]" if named else "identified mode")
        axes.set_xlabel(f"{against} [Hz]" if named else f"{against} mode")
        axes.xaxis.set_major_locator(MaxNLocator(integer=True))
        axes.yaxis.set_major_locator(MaxNLocator(integer=True))
        if named:
            axes.set_yticks(range(1, len(rows) + 1), rows)
            axes.set_xticks(range(1, len(columns) + 1), columns, rotation=90 if len(columns) > 6 else 0)
            for (i, j), entry in np.ndenumerate(value):
                ink = "white" if entry > 0.5 else "black"
                axes.text(j + 1, i + 1, f"{entry:.2f}", ha="center", va="center", color=ink)

    whose = (
        "of the identified modes among themselves"
        if other is result.modes
        else "identified against true modes"
    )
    caption = f"Modal assurance criterion (MAC), {whose}: white 0, black 1."
    if truth is not None and other is not result.modes and len(other) < len(truth):
        caption += f" {len(truth) - len(other)} true modes above the highest identified one are left out."
    return drawing("mac", min(5.0, 1.0 + 0.42 * len(rows)), caption, paint)


def singular_values(result: Result) -> Drawing | None:
    """Singular values that the order was judged by."""
    values, order = result.realization.singular_values, result.realization.order
    values = values[: max(4 * order, 40)]
    if not np.any(values > 0):
        return None

    def paint(figure: Figure) -> None:
        axes = figure.subplots()
        number = np.arange(1, values.size + 1)
        axes.plot(number, np.where(values > 0, values, np.nan), ".", color="black", markersize=4)
        axes.axvline(order + 0.5, color=SERIES[1], linestyle="--")
        axes.set_yscale("log")
        axes.annotate(f" order {order}", (order + 0.5, 1), xycoords=("data", "axes fraction"), va="top")
        logarithmic_full(axes)
        axes.set_xlabel("number")
        axes.set_ylabel("singular value")

    caption = (
        f"Singular values of {result.realization.method}; the dashed line marks the order chosen, {order}."
    )
    return drawing("singular", 1.9, caption, paint)


def logarithmic_full(axes: Axes) -> None:
    """A logarithmic axis over all that was drawn."""
    low, high = axes.get_ylim()
    logarithmic(axes)
    axes.set_ylim(low, high)


def matrix_maps(found: SecondOrder, truth: SecondOrder | None) -> Drawing:
    """M, C, K as pictures, with the truth and the difference where known."""
    what = ["recovered"] if truth is None else ["recovered", "true", "difference"]

    def paint(figure: Figure) -> None:
        frames = figure.subplots(3, len(what), squeeze=False)
        for row, (letter, name) in enumerate((("M", "mass"), ("C", "damping"), ("K", "stiffness"))):
            value = getattr(found, name)
            matrices = [value]
            if truth is not None:
                matrices += [getattr(truth, name), value - getattr(truth, name)]
            for axes, matrix, kind in zip(frames[row], matrices, what, strict=True):
                limit = float(np.max(np.abs(matrix))) or 1.0
                axes.imshow(matrix, cmap="RdBu_r", vmin=-limit, vmax=limit)
                axes.set_title(f"{letter} {kind}, up to {limit:.2g}")
                axes.xaxis.set_major_locator(MaxNLocator(integer=True))
                axes.yaxis.set_major_locator(MaxNLocator(integer=True))

    caption = (
        "Mass, damping and stiffness: white 0, blue negative, red positive, full colour at the number given."
    )
    return drawing("matrices", 6.0 if len(what) > 1 else 7.0, caption, paint)
