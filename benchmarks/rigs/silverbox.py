"""Silverbox: a linear model fails at high level, the cubic spring is named, and the extended model predicts."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

import lab
from benchmarks.rigs import duffing
from benchmarks.rigs.row import RIGS, Row, measured, told
from identification.recording import Array, Record, Recording
from lab.replay import replay
from lab.rig import Rig

WIDTHS = {"mass": 0.1, "stiffness": 0.1, "damping": 0.5}
QUIET = 8000
"""Samples at the start of the arrow, where its level is a fifth of the highest."""
REALISATION = 8675
"""Samples of one realisation of the multisine, rounded down."""
SETTLED = 1000
"""Samples after which a start that is not at rest is forgotten: 70 time constants."""


def held(inputs: Array, dt: float) -> Array:
    """Values that give the same force when held over a sample as these give when a smooth signal runs through them.

    The circuit was driven by a band-limited signal; holding its samples would delay it by half a sample and lower it by
    sinc(f dt). Both are taken out in the frequency domain.
    """
    f = np.fft.rfftfreq(inputs.shape[1], dt)
    hold = np.sinc(f * dt) * np.exp(-1j * np.pi * f * dt)
    return np.fft.irfft(np.fft.rfft(inputs, axis=1) / hold, inputs.shape[1], axis=1)


def parts() -> tuple[Recording, Recording, Recording, Recording]:
    """The quiet part of the arrow, the whole arrow, two realisations of the multisine, and the last one."""
    whole = measured("silverbox/SNLS80mV.mat", "silverbox/snls80mv.toml")
    arrow, multisine = (
        Record(r.kind, held(np.asarray(r.inputs), whole.dt), np.asarray(r.outputs)) for r in whole.records
    )

    def cut(record: Record, start: int, stop: int | None) -> Recording:
        part = Record(record.kind, record.inputs[:, start:stop], record.outputs[:, start:stop])
        return replace(whole, records=(part,))

    learned, last = (0, 2 * REALISATION), (9 * REALISATION, None)
    return cut(arrow, 0, QUIET), cut(arrow, 0, None), cut(multisine, *learned), cut(multisine, *last)


def millivolts(rig: Rig, recording: Recording) -> float:
    """RMS simulation error [mV], the first samples left out where the record does not begin at rest."""
    (simulated,) = replay(rig, recording, accuracy=1e-4)
    error = simulated - recording.records[0].outputs
    first = SETTLED if recording.records[0].kind == "multisine" else 0
    return 1e3 * float(np.sqrt(np.mean(error[:, first:] ** 2)))


def rows() -> Iterator[Row]:
    """All rows of this rig."""
    quiet, arrow, multisine, last = parts()
    rig = Rig.load(RIGS / "silverbox" / "silverbox.xml")
    low = lab.diagnose(quiet, rig, widths=WIDTHS, effects={})
    yield told(
        "Silverbox",
        "Does a linear model hold at low level?",
        "nearly",
        low,
        show=["mass mass", "damping spring", "stiffness spring"],
    )
    high = lab.diagnose(multisine, low.extended, baseline=quiet, widths=WIDTHS)
    yield told("Silverbox", "What is missing at high level?", "a cubic spring (3.96 to 3.98 elsewhere)", high)
    for name, recording, published in (
        ("multisine, last realisation", last, "none quoted"),
        ("arrow", arrow, "0.26 and 0.96 mV (quoted, see above), 4.1 and 5.8 mV (black boxes)"),
    ):
        errors = [millivolts(r, recording) for r in (low.extended, high.extended)]
        yield Row(
            "Silverbox",
            f"RMS simulation error, {name}",
            f"signal {1e3 * float(np.std(recording.records[0].outputs)):.1f} mV; published: {published}",
            f"linear model {errors[0]:.2f} mV, extended model {errors[1]:.2f} mV",
        )
    yield best_cubic()


def best_cubic() -> Row:
    """What is left when the same equation is fitted for simulation error alone."""
    whole = measured("silverbox/SNLS80mV.mat", "silverbox/snls80mv.toml")
    (u_arrow, y_arrow), (u, y) = (
        (duffing.between(np.asarray(r.inputs[0])), np.asarray(r.outputs[0])) for r in whole.records
    )
    learned, last = slice(0, 2 * REALISATION), slice(9 * REALISATION + SETTLED, None)
    p = duffing.fitted(u[: learned.stop * duffing.FINER], y[learned], whole.dt, skip=SETTLED)
    errors = [
        1e3 * float(np.sqrt(np.mean((duffing.simulated(p, force, whole.dt) - position)[part] ** 2)))
        for force, position, part in ((u, y, last), (u_arrow, y_arrow, slice(None)))
    ]
    return Row(
        "Silverbox",
        "What does the best cubic spring leave?",
        "fitted for simulation error alone, input band-limited, offsets free",
        f"{errors[0]:.2f} mV on the last realisation, {errors[1]:.2f} mV on the arrow",
        f"k3 = {p[3] * duffing.SIZES[3]:.3g} N/m^3",
    )
