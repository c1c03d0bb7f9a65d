"""Beam with nuts: which of six are gone, by a diagnosis of single frequency responses, and by resonances over all samples.

The scale of the responses is stated nowhere: the diagnosis fits an unknown complex factor along. Frequencies need none; those
of each sample in a damaged state are compared with the healthy one with the nuts at the same places.
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import combinations

import numpy as np

import lab
from benchmarks.rigs.row import RIGS, Row, imported, told
from identification.recording import Array
from identification.response import FrequencyResponse
from lab.effects import EFFECTS
from lab.rig import Rig

BANDS = ((18.0, 27.0), (125.0, 155.0), (360.0, 425.0), (715.0, 800.0), (1100.0, 1230.0))
"""Where the five lowest bending modes lie in all states [Hz]."""
SAMPLES = 12
MODEL_ERROR, FLOOR = 0.25, 0.002
"""A shift is predicted to a quarter, since nuts are set to a few millimetres and the clamp is not rigid, and to 0.2 %: a
line is 0.3125 Hz wide and the lowest mode 22 Hz high."""
STATES = {"2.96": "Beam_damage_2.96/P-{}-1.txt", "8.87": "Beam_damage_8.87/P-{}-3.txt"}
WIDTHS = {
    "mass": 0.0,
    "mass accelerometer": 0.3,
    "stiffness": 0.05,
    "stiffness clamp": 0.5,
    "damping": 1.0,
} | {f"mass nut{number}": 0.005 for number in range(1, 7)}
"""How well the model is known, relative: the strip does not lose mass, and clamp and damping are guesses."""
DIAGNOSED = (("2.96", 1), ("2.96", 2), ("2.96", 6), ("2.96", 9), ("8.87", 1))
"""States and samples of which single responses are diagnosed, with the first nut within 5 mm of where the model has it."""


def response(place: str) -> FrequencyResponse:
    """The response of one sample in one state."""
    found = imported(f"beam_masses/{place}", "beam_masses/response.toml").response
    assert found is not None
    return found


def diagnosed() -> Iterator[Row]:
    """Single responses against the healthy one of the same sample; what may be named is a change of mass."""
    rig = Rig.load(RIGS / "beam_masses" / "beam.xml")
    only = {"mass_change": lab.EFFECTS["mass_change"]}
    for state, sample in DIAGNOSED:
        diagnosis = lab.diagnose_spectra(
            response(STATES[state].format(sample)),
            rig,
            baseline=response(f"Beam_healthy/P-{sample}.txt"),
            widths=WIDTHS,
            effects=only,
        )
        many = {"2.96": "1 of six", "8.87": "3 of six"}[state]
        rivals = ", ".join(f"{a.location} ({a.log_evidence_gain:.1f})" for a in diagnosis.alternatives[:3])
        gains = ", ".join(f"{f.log_evidence_gain:.1f}" for f in diagnosis.findings)
        yield told(
            "Beam with nuts, one response",
            f"Which nuts are gone at {state} % (sample {sample})?",
            f"{many} by the mass lost; which is not published",
            diagnosis,
            remark=f"log evidence {gains}; next {rivals}" if gains else "",
        )


def resonances(place: str) -> Array:
    """Frequency of the highest line of every band, by a parabola through its neighbours' levels [Hz]."""
    H = response(place)
    f, level = H.frequency_hz, np.log(np.abs(H.values[:, 0, 0]))
    found = []
    for low, high in BANDS:
        inside = np.flatnonzero((f > low) & (f < high))
        i = inside[np.argmax(level[inside])]
        a, b, c = level[i - 1 : i + 2]
        found.append(f[i] + 0.5 * (a - c) / (a - 2 * b + c) * (f[1] - f[0]))
    return np.array(found)


def shifts(state: str) -> tuple[Array, Array]:
    """Relative shift of every resonance from healthy to damaged, mean over the samples and its standard deviation."""
    each = np.array(
        [
            resonances(STATES[state].format(i)) / resonances(f"Beam_healthy/P-{i}.txt") - 1
            for i in range(1, SAMPLES + 1)
        ]
    )
    # The median is not moved by a sample whose nut was set elsewhere; its scatter is 1.25 times that of the mean.
    return np.median(each, axis=0), 1.25 * np.std(each, axis=0, ddof=1) / np.sqrt(SAMPLES)


def predicted() -> Array:
    """Relative shift of every resonance by each missing nut, (n_nuts, n_modes)."""
    rig = Rig.load(RIGS / "beam_masses" / "beam.xml")
    healthy = rig.second_order().modes().frequency_hz[: len(BANDS)]
    rows = []
    for number in range(1, 7):
        mass = float(rig.model.body(f"nut{number}").mass[0])
        without = EFFECTS["mass_change"](f"nut{number}", delta_mass=-0.999 * mass).apply(rig)
        rows.append(without.second_order().modes().frequency_hz[: len(BANDS)] / healthy - 1)
    return np.array(rows)


def by_frequencies() -> Iterator[Row]:
    """All samples together, by how far their resonances move."""
    effect, known = predicted(), frozenset[int]()
    for state, many in (("2.96", 1), ("8.87", 3)):
        measured, std = shifts(state)
        ranked = []
        # Losses add up: what is gone at 2.96 % is gone at 8.87 % too.
        for gone in (each for each in combinations(range(6), many) if known <= set(each)):
            expected = effect[list(gone)].sum(axis=0)
            variance = std**2 + FLOOR**2 + (MODEL_ERROR * expected) ** 2
            deviance = np.sum((measured - expected) ** 2 / variance + np.log(variance))
            ranked.append((float(deviance), tuple(n + 1 for n in gone)))
        ranked.sort()
        known = frozenset(n - 1 for n in ranked[0][1])
        chances = np.exp(-0.5 * (np.array([d for d, _ in ranked]) - ranked[0][0]))
        chances /= chances.sum()
        listed = [f"{g} ({100 * c:.0f} %)" for c, (_, g) in zip(chances, ranked, strict=True) if c > 0.05]
        yield Row(
            "Beam with nuts",
            f"Which nuts are gone at {state} %?",
            f"{many} of six by the mass lost; which is not published",
            ("" if chances[0] > 0.9 else "undecided: ") + ", ".join(listed[:5]),
            "shifts "
            + ", ".join(f"{100 * m:.2f} ± {100 * s:.2f}" for m, s in zip(measured, std, strict=True))
            + " %",
            "expected "
            + ", ".join(f"{100 * e:.2f}" for e in effect[[n - 1 for n in ranked[0][1]]].sum(axis=0))
            + " %",
            "by frequencies of twelve samples against the lab's model",
        )


def rows() -> Iterator[Row]:
    """All rows of this rig."""
    yield from diagnosed()
    yield from by_frequencies()
