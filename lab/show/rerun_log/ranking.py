"""Causes weighed by a diagnosis in the viewer: a bar for each, as long as the logarithm of its evidence."""

from __future__ import annotations

import numpy as np
import rerun as rr
import rerun.blueprint as rrb

from lab.diagnosis.outcome import Diagnosis
from lab.show.drawing import SERIES, rgb
from lab.show.findings import Weighed, evidence, weighed_causes
from lab.show.rerun_log.plot import log_texts

ORIGIN = "/causes"
WIDTH, STEP = 200.0, 20.0
"""Longest bar, and from bar to bar, in canvas units."""


def log_ranking(stream: rr.RecordingStream, diagnosis: Diagnosis) -> list[rrb.View]:
    """Logs the bars, findings first; one view, or none where no cause was weighed."""
    ranked = weighed_causes(diagnosis)
    if not ranked:
        return []
    length = _lengths(ranked)
    top = STEP * np.arange(len(ranked))
    bars = [
        np.array([[0.0, y + 0.7 * STEP], [max(x, 0.5), y + 0.7 * STEP]])
        for x, y in zip(length, top, strict=True)
    ]
    colors = [rgb(SERIES[0] if each.found else SERIES[7]) for each in ranked]
    stream.log(ORIGIN, rr.LineStrips2D(bars, colors=colors, radii=-5.0), static=True)
    texts = [
        f"{'found' if each.found else 'instead of the first'}: {each.text}, {evidence(each.log_evidence_gain)}"
        for each in ranked
    ]
    log_texts(
        stream, f"{ORIGIN}/names", np.stack([np.full(len(ranked), WIDTH / 2), top + 0.05 * STEP], 1), texts
    )
    bounds = rrb.VisualBounds2D(
        x_range=(-0.05 * WIDTH, 1.05 * WIDTH), y_range=(-0.3 * STEP, STEP * (len(ranked) + 0.2))
    )
    name = "Causes by evidence (bars on a logarithmic scale)"
    return [rrb.Spatial2DView(origin=ORIGIN, name=name, visual_bounds=bounds)]


def _lengths(ranked: tuple[Weighed, ...]) -> np.ndarray:
    """Length of each bar: evidence spans many powers of ten, so its logarithm is drawn."""
    gain = np.array([each.log_evidence_gain for each in ranked])
    level = np.log10(1 + np.maximum(np.nan_to_num(gain, posinf=1e300), 0.0))
    return WIDTH * level / max(float(np.max(level)), 1e-12)
