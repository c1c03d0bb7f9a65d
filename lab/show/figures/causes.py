"""Figures of what a diagnosis weighed: causes by their evidence, and how far the calibration moved each parameter."""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, NullFormatter

from lab.diagnosis.outcome import Diagnosis
from lab.show.drawing import SERIES
from lab.show.figures.canvas import Drawing, drawing, plain, power_of_ten
from lab.show.findings import evidence, weighed_causes
from lab.validation import COVERAGE

DECISIVE = 5.0
"""Evidence beyond which a cause is hardly chance: 150 to 1."""


def causes_figure(diagnosis: Diagnosis) -> Drawing | None:
    """A bar for each cause weighed, the findings first; None where none was."""
    ranked = weighed_causes(diagnosis)
    if not ranked:
        return None
    gain = np.array([each.log_evidence_gain for each in ranked])
    length = np.where(np.isfinite(gain), np.maximum(gain, 1.0), 1.0)

    def paint(figure: Figure) -> None:
        axes = figure.subplots()
        rows = np.arange(len(ranked))
        for row, each in enumerate(ranked):
            axes.barh(
                row,
                length[row] - 0.5,
                left=0.5,
                height=0.6,
                color=SERIES[0] if each.found else "0.85",
                hatch="" if each.found else "///",
                edgecolor="0.4",
            )
            axes.annotate(
                evidence(each.log_evidence_gain),
                (length[row], row),
                xytext=(3, 0),
                textcoords="offset points",
                va="center",
                ha="left",
            )
        axes.set_xscale("log")
        axes.xaxis.set_major_formatter(FuncFormatter(power_of_ten))
        axes.xaxis.set_minor_formatter(NullFormatter())
        axes.set_xlim(0.5, 4 * float(length.max()))
        axes.axvline(DECISIVE, color="black", linestyle=":", linewidth=0.8)
        axes.set_yticks(rows, [plain(each.text, 48) for each in ranked])
        axes.invert_yaxis()
        axes.set_xlabel("evidence (natural logarithm of how much likelier the cause makes the data)")

    caption = (
        "Causes weighed. Full bars: the findings; hatched: other explanations of the first finding. Right of the dotted line "
        f"(evidence of {DECISIVE:g}) a cause is hardly chance."
    )
    return drawing("causes", 0.8 + 0.26 * len(ranked), caption, paint)


def calibration_figure(diagnosis: Diagnosis) -> Drawing | None:
    """Change of every parameter of the model with its error bar; None where nothing has a nominal value to compare with."""
    moved = {name: each for name, each in diagnosis.calibration.items() if each.nominal}
    if not moved:
        return None
    change = np.array([100 * (each.value / each.nominal - 1) for each in moved.values()])
    bar = np.array([100 * COVERAGE * abs(each.std / each.nominal) for each in moved.values()])

    def paint(figure: Figure) -> None:
        axes = figure.subplots()
        rows = np.arange(len(moved))
        axes.axvline(0, color="0.4", linestyle="--", linewidth=0.8)
        axes.errorbar(
            change,
            rows,
            xerr=np.nan_to_num(bar),
            linestyle="",
            marker="o",
            markersize=3.5,
            color=SERIES[0],
            ecolor="black",
            elinewidth=0.9,
            capsize=2.5,
        )
        axes.set_yticks(rows, [plain(name, 40) for name in moved])
        axes.invert_yaxis()
        axes.set_xlabel("change by calibration [%]")

    caption = (
        f"Calibrated less nominal value of every parameter of the model, in percent of the nominal one, ± {COVERAGE:g} "
        "standard deviations; the dashed line is the model as given."
    )
    return drawing("calibration", 0.7 + 0.17 * len(moved), caption, paint)
