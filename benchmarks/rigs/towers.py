"""Two towers: order and signs of channels, and modes with error bars from outputs alone."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import scipy.signal

import lab
from benchmarks.rigs.row import RIGS, Row, measured
from identification.identify import Identification, identify
from identification.recording import Channel, Record, Recording
from lab.rig import Rig

FLOORS = [f"floor{i}.x" for i in range(1, 6)]
BANDS = ((0.2, 0.9), (1.6, 1.9), (2.8, 3.2), (4.1, 4.3), (5.3, 5.4))
"""Where the authors of the Unison test look for modes [Hz]."""
DECIMATED = 16
"""The lattice tower was sampled at 1651 Hz; its lowest modes lie below 45 Hz."""


def modes_of(found: Identification, most: int = 8) -> str:
    """Frequencies and damping ratios with one standard deviation."""
    m = found.modes
    rows = zip(m.frequency_hz, m.frequency_std, m.damping_ratio, m.damping_std, strict=True)
    return "; ".join(
        f"{f:.3f} ± {s:.1g} Hz ({100 * z:.2g} ± {100 * e:.1g} %)" for f, s, z, e in list(rows)[:most]
    )


def ambient(recording: Recording, outputs: list[str] | None = None, step: int = 1) -> Recording:
    """The outputs alone, freed of their means and decimated."""
    chosen = recording if outputs is None else recording.select(outputs=outputs)
    y = np.asarray(chosen.records[0].outputs)
    y = y - y.mean(axis=1, keepdims=True)
    if step > 1:
        y = scipy.signal.decimate(y, step, ftype="fir", axis=1)
    record = Record("ambient", np.zeros((0, y.shape[1])), y)
    return replace(chosen, inputs=(), records=(record,), sample_rate=recording.sample_rate / step)


def unison() -> Iterator[Row]:
    """The five-storey tower."""
    for name in ("wn_01.dat", "wn_02.dat"):
        recording = measured(f"unison_tower/{name}", "unison_tower/wn.toml")
        found = identify(ambient(recording, FLOORS), "plscf")
        f = found.modes.frequency_hz
        hit = sum(bool(np.any((f > low) & (f < high))) for low, high in BANDS)
        yield Row(
            "Unison tower",
            f"Modes ({name}, outputs alone, pLSCF)?",
            "sought in 0.2-0.9, 1.6-1.9, 2.8-3.2, 4.1-4.3, 5.3-5.4 Hz",
            f"{f.size} modes, in {hit} of the five bands",
            modes_of(found),
            remark="the force is left out: it explains little of the outputs",
        )


def wiring() -> Iterator[Row]:
    """Channels taken in the order of the file, none turned: what the check says."""
    rig = Rig.load(RIGS / "unison_tower" / "tower.xml")
    recording = measured("unison_tower/wn_01.dat", "unison_tower/wn.toml")
    order = ["floor5.x", "floor4.x", "floor1.x", "floor2.x", "floor3.x"]
    taken = ambient(recording, order)
    values = np.asarray(taken.records[0].outputs) * np.array([-1, 1, 1, 1, 1])[:, None]
    channels = tuple(Channel(name, "m/s^2") for name in reversed(FLOORS))
    for question, naive in (
        ("Order and signs, as the columns stand?", replace(taken, outputs=channels)),
        ("Sign of floor 5, order known?", taken),
        ("All as the recipe says?", None),
    ):
        if naive is None:
            checked = taken
        else:
            checked = replace(naive, records=(Record("ambient", np.zeros((0, values.shape[1])), values),))
        remarks = [r for r in lab.check(checked, rig) if r.check in ("order", "sign", "layout")]
        yield Row(
            "Unison tower",
            question,
            "columns are floors 5, 4, 1, 2, 3; floor 5 turned" if naive is not None else "nothing wrong",
            "; ".join(f"{r.channel}: {r.says}" for r in remarks) or "no remark",
        )


def lumo() -> Iterator[Row]:
    """The lattice tower."""
    recording = measured("lumo_tower/data_lumo.csv.gz", "lumo_tower/acceleration.toml")
    found = identify(ambient(recording, step=DECIMATED))
    yield Row(
        "LUMO tower",
        "Modes of one minute under wind?",
        "close pairs in x and y; state of this minute not published",
        f"{found.modes.frequency_hz.size} modes, lowest pair {found.modes.frequency_hz[0]:.2f} and "
        f"{found.modes.frequency_hz[1]:.2f} Hz",
        modes_of(found),
        remark="60 s hold 170 periods of the lowest mode: its damping is undecided",
    )


def rows() -> Iterator[Row]:
    """All rows of both towers."""
    for part in (wiring, unison, lumo):
        yield from part()
