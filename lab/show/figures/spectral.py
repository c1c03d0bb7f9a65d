"""Figure of a diagnosis in the frequency domain: measured spectra or responses, and those of the three models."""

from __future__ import annotations

from matplotlib.figure import Figure

from lab.diagnosis.outcome import Diagnosis, SpectralPrediction
from lab.show.figures.canvas import Drawing, drawing, logarithmic, plain, stacked
from lab.show.figures.diagnosis import LOOKS, MEASURED
from lab.show.residuals import LABELS, shown_models, worst_rows


def draw_spectra(diagnosis: Diagnosis, spectra: SpectralPrediction) -> Drawing:
    """Data kept aside and the models' predictions, for the rows that the calibrated model misses most."""
    rows, models = worst_rows(spectra), shown_models(diagnosis)

    def paint(figure: Figure) -> None:
        frames = stacked(figure, len(rows))[:, 0]
        for axes, row in zip(frames, rows, strict=True):
            axes.plot(spectra.frequency_hz, spectra.measured[row], label="measured", **MEASURED)
            for model in models:
                axes.plot(
                    spectra.frequency_hz, getattr(spectra, model)[row], label=LABELS[model], **LOOKS[model]
                )
            unit = spectra.units[row].replace("^2", "²")
            axes.set_ylabel(f"{plain(spectra.names[row], 24)}\n[{unit}]", rotation=0, ha="right", va="center")
            logarithmic(axes)
        frames[-1].set_xlabel("frequency [Hz]")
        figure.legend(*frames[0].get_legend_handles_labels(), loc="outside upper center", ncols=4)

    left_out = len(spectra.names) - len(rows)
    caption = (
        "Data kept out of every fit (grey) and what the models predict of them: power spectral densities of outputs, or "
        "magnitudes of frequency responses."
        + (f" {len(rows)} of {len(spectra.names)} shown, those with the largest errors." if left_out else "")
    )
    return drawing("spectra", 0.7 + 1.2 * len(rows), caption, paint)
