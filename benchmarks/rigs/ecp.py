"""ECP carts: loads, springs, motor and dry friction, from free releases and motor-driven tests."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

import lab
from benchmarks.rigs.row import RIGS, Row, measured, told
from identification.recording import Array, Record, Recording
from lab.effects.edits import with_law, with_mass
from lab.rig import Rig

FOLDER = "ecp_carts"
DETACHED, ATTACHED = "free_release_motor_detached", "free_release_motor_attached"
RELEASED = {"mass": 0.025, "stiffness": 0.05, "damping": 0.3}
"""How well the documented values are known, relative: the cart to 0.014 kg, springs as two estimates differ."""
DRIVEN = {"mass": 0.13, "stiffness": 0.1, "damping": 0.3, "gain": 0.14}
"""The same with the motor, whose own mass and force per ampere are known to 13 and 14 %; a baseline keeps the latter."""
LOAD = 0.986
SPRINGS = {"low": 175.3, "med": 315.5, "high": 712.6}
SILENT = ("unmeasured_force", "line_hum", "attached_oscillator")
"""What a cart let go by hand cannot have: nothing pushes it, nothing hangs on it, and encoders do not hum."""
SOFTER = "the authors, too, found the high spring softer in extension"
BEFORE = 40
"""Samples that a recording of pulses keeps of the standing cart."""
STILL = 4e-5
"""A cart that moves less than two counts of the encoder in a quarter of a second stands [m]."""


def releases(position: Array, dt: float) -> list[tuple[int, int]]:
    """First and last sample of every free decay: from the first swing through zero until the cart stands."""
    speed = np.abs(np.gradient(position, dt))
    fast = speed[:-1] > 0.5 * np.max(speed)
    crossings = np.flatnonzero((position[:-1] * position[1:] <= 0) & fast)
    begins = [c for i, c in enumerate(crossings) if i == 0 or c - crossings[i - 1] > 2 / dt]
    window = int(0.25 / dt)
    spread = np.ptp(np.lib.stride_tricks.sliding_window_view(position, window), axis=1)
    still = np.append(np.flatnonzero(spread < STILL), position.size)
    return [(int(a), int(still[np.searchsorted(still, a)])) for a in begins]


def released(*names: str, folder: str = DETACHED) -> Recording:
    """The free decays of several recordings, one record each."""
    records = []
    for name in names:
        whole = measured(f"{FOLDER}/{folder}/{name}", "ecp_carts/free_release.toml")
        position = np.asarray(whole.records[0].outputs[0])
        for a, b in releases(position, whole.dt):
            records.append(Record("free_decay", np.zeros((0, b - a)), position[None, a:b]))
    return replace(whole, records=tuple(records))


def driven(
    name: str, recipe: str = "random_one_cart", start: float = 4.5, stop: float | None = None
) -> Recording:
    """A motor-driven test from the instant its motor is switched on [s]."""
    folder = recipe if recipe.startswith(("random", "pulses")) else ""
    whole = measured(f"{FOLDER}/{folder}/{name}", f"ecp_carts/{recipe}.toml")
    record, a, b = whole.records[0], int(start / whole.dt), None if stop is None else int(stop / whole.dt)
    part = Record(record.kind, record.inputs[:, a:b], record.outputs[:, a:b])
    return replace(whole, records=(part,))


def cart(spring: str, load: float = 0.0) -> Rig:
    """One cart without motor, on a spring, with a load."""
    rig = Rig.load(RIGS / FOLDER / "one_cart_detached.xml")
    rig = with_law(rig, "spring1", stiffness=[SPRINGS[spring], 0, 0], damping=[0.9, 0, 0])
    return with_mass(rig, "cart1", (0.5685 + load) / 0.5685)


def free(recording: Recording, rig: Rig, baseline: Recording | None = None) -> lab.Diagnosis:
    """What the lab says of free releases."""
    possible = {name: kind for name, kind in lab.EFFECTS.items() if name not in SILENT}
    return lab.diagnose(recording, rig, baseline=baseline, widths=RELEASED, effects=possible)


FREE = {
    ("low", 0.0): ("Klow_Hand_Nomass", "Klow_Hand_Nomass2", "Klow_hand_Nomass3"),
    ("med", 0.0): ("Kmed_hand_Nomass", "Kmed_hand_Nomass2", "Kmed_hand_Nomass3"),
    ("high", 0.0): ("Khigh_hand_Nomass", "Khigh_hand_Nomass2"),
    ("low", LOAD): ("Klow_Hand_2mass", "Klow_hand_2mass2"),
    ("high", LOAD): ("Khigh_hand_2mass", "Khigh_hand_2mass2"),
}


def levels(diagnosis: lab.Diagnosis) -> list[str]:
    """Where the force of each spring with a memory levels off."""
    found = [f.parameters for f in diagnosis.findings if f.effect.cause == "hysteresis"]
    return [f"level {p['stiffness'].value * p['yield_displacement'].value:.3f} N" for p in found]


def friction() -> Iterator[Row]:
    """Dry friction or more viscous damping?"""
    for (spring, load), names in FREE.items():
        diagnosis = free(released(*names), cart(spring, load))
        yield told(
            "ECP, 1 cart, released",
            f"What stops it ({spring} spring, {load:g} kg on it)?",
            "dry friction of 0.04 to 0.08 N",
            diagnosis,
            show=["damping spring1"],
            remark="; ".join(levels(diagnosis)),
        )


def repeats() -> Iterator[Row]:
    """The same state once more."""
    for (spring, load), names in FREE.items():
        known = free(released(*names[:-1]), cart(spring, load)).extended
        again = free(released(names[-1]), known, released(*names[:-1]))
        question = f"Same state again ({spring} spring, {load:g} kg on it)?"
        yield told("ECP, 1 cart, released", question, "nothing changed", again)
    for name, middle in (("KhNoM", 17.5), ("KmNoM", 17.0), ("Kh2M", 21.0), ("Kl2M", 18.0)):
        rig = Rig.load(RIGS / FOLDER / "one_cart.xml")
        first, second = driven(name, stop=middle), driven(name, start=middle)
        diagnosis = lab.diagnose(second, rig, baseline=first, widths=DRIVEN)
        yield told("ECP, 1 cart, motor", f"Same state, second half ({name})?", "nothing changed", diagnosis)


def changed_when_released() -> Iterator[Row]:
    """Loads, springs and the motor, from free releases."""
    plain = {
        state: free(released(*names), cart(*state)).extended for state, names in FREE.items() if not state[1]
    }
    for state, base, known in (
        (("high", LOAD), ("high", 0.0), "+0.986 kg on cart 1"),
        (("low", LOAD), ("low", 0.0), "+0.986 kg on cart 1"),
        (("high", 0.0), ("med", 0.0), "spring 2.26 times as stiff"),
        (("low", 0.0), ("med", 0.0), "spring 0.556 times as stiff"),
    ):
        diagnosis = free(released(*FREE[state]), plain[base], released(*FREE[base]))
        question = f"What changed from {base[0]} spring, {base[1]:g} kg?"
        yield told("ECP, 1 cart, released", question, known, diagnosis)
    yield from motor_attached(plain["high", 0.0])


def motor_attached(plain: Rig) -> Iterator[Row]:
    """What the motor adds to a released cart, and loads and springs with it."""
    attached = released("Hard_nomass", folder=ATTACHED)
    open_ = {"mass": 0.5, "stiffness": 0.01, "damping": 2.0}
    possible = {name: lab.EFFECTS[name] for name in ("coulomb_friction", "hysteresis", "quadratic_damping")}
    viscous = lab.diagnose(attached, plain, widths=open_, effects={})
    diagnosis = lab.diagnose(attached, plain, widths=open_, effects=possible)
    mass = diagnosis.calibration["mass cart1"]
    drag, with_drag = (d.calibration["damping spring1"] for d in (viscous, diagnosis))
    level = "; ".join(levels(diagnosis))
    yield told(
        "ECP, 1 cart, released",
        "What changed when the motor was attached (high spring; mass and damping left open)?",
        "+0.322 kg (cart and motor 0.891 ± 0.115 kg), 8 to 10 N s/m instead of 0.7 to 1.1",
        diagnosis,
        remark=f"mass {mass.nominal:.3g} → {mass.value:.3g} ± {mass.std:.1g} kg; drag: {level}, "
        f"and {with_drag.value:.2g} N s/m. Viscous drag alone would be {drag.value:.2g} ± {drag.std:.1g} N s/m and leaves "
        f"{viscous.errors.noise_floor:.2f} of the signal that was fitted, the level {diagnosis.errors.noise_floor:.2f}",
    )
    both = "two changes at once; a release tells the frequency, which one alone may give"
    for name, known, remark in (
        ("Hard_2mass", "+0.986 kg on cart 1", ""),
        (
            "Low_nomass",
            "spring 0.25 times as stiff",
            "right, but the small last swings, kept aside, are not predicted",
        ),
        ("Med_2mass", "+0.986 kg, spring 0.44 times as stiff", both),
    ):
        changed = free(released(name, folder=ATTACHED), diagnosis.extended, attached)
        question = f"What changed from Hard_nomass to {name} (motor attached, unpowered)?"
        yield told("ECP, 1 cart, released", question, known, changed, remark=remark)


def changed_when_driven() -> Iterator[Row]:
    """Loads and springs, from motor-driven tests."""
    rig = Rig.load(RIGS / FOLDER / "one_cart.xml")
    for name, base, known in (
        ("Kh2M", "KhNoM", "+0.986 kg on cart 1"),
        ("KmNoM", "KhNoM", "spring 0.47 times as stiff"),
        ("KhNoM", "KmNoM", "spring 2.12 times as stiff"),
        ("KhNoM", "Kh2M", "-0.986 kg on cart 1"),
        ("Kl2M", "Kh2M", "spring 0.25 times as stiff"),
        ("Kh2M", "Kl2M", "spring 4.1 times as stiff"),
        ("Kl2M", "KmNoM", "+0.986 kg, spring 0.64 times as stiff"),
        ("Kl2M", "KhNoM", "+0.986 kg, spring 0.25 times as stiff"),
    ):
        diagnosis = lab.diagnose(driven(name), rig, baseline=driven(base), widths=DRIVEN)
        yield told("ECP, 1 cart, motor", f"What changed from {base} to {name}?", known, diagnosis)


def pulsed(name: str, folder: str = "pulses_steps_one_cart") -> Recording:
    """A test with pulses, steps or noise of motor voltage, from just before the cart first moves."""
    whole = measured(f"{FOLDER}/{folder}/{name}", "ecp_carts/pulses_steps_one_cart.toml")
    record = whole.records[0]
    inputs, outputs = np.asarray(record.inputs[:, :]), np.asarray(record.outputs[:, :])
    first = max(int(np.argmax(np.abs(outputs[0] - outputs[0, 0]) > STILL)) - BEFORE, 0)
    return replace(whole, records=(Record(record.kind, inputs[:, first:], outputs[:, first:]),))


def changed_under_pulses() -> Iterator[Row]:
    """Loads, springs and levels, from pulses and steps."""
    series = "amplitude_series_one_cart"
    held = "dry friction, which the model lacks, holds the cart at this level"
    lacks = "dry friction and play, which the model lacks, weigh less at this level"
    for name, base, spring, known, remark, *folder in (
        ("pulse_kbig_2mass", "pulse_kbig_nomass", "high", "+0.986 kg on cart 1", ""),
        ("pulse_kbig_nomass", "pulse_kbig_2mass", "high", "-0.986 kg on cart 1", ""),
        ("steps_kmed_2mass", "steps_kmed_nomass", "med", "+0.986 kg on cart 1", ""),
        ("steps_kmed_nomass", "steps_kmed_2mass", "med", "-0.986 kg on cart 1", ""),
        ("pulse_kmed_nomass", "pulse_kbig_nomass", "high", "spring 0.47 times as stiff", ""),
        ("pulse_kbig_nomass", "pulse_kmed_nomass", "med", "spring 2.12 times as stiff", SOFTER),
        ("pulse_klow_2mass", "pulse_kbig_2mass", "high", "spring 0.25 to 0.3 times as stiff", ""),
        ("pulse_kbig_2mass", "pulse_klow_2mass", "low", "spring 3.3 to 4.1 times as stiff", ""),
        (
            "steps_kmed_2mass_compression",
            "steps_kmed_2mass",
            "med",
            "nothing but the direction of the steps",
            "",
        ),
        (
            *("steps_kbig_2mass_compression", "steps_kmed_2mass_compression", "med"),
            *("spring 2.12 times as stiff", ""),
        ),
        ("rand_kmed_nomass", "pulse_kmed_nomass", "med", "nothing but the level, a fifth", held),
        ("Kmed_4V_pulses", "Kmed_2V_pulses", "med", "nothing but the level, twice", lacks, series),
        ("Klow_3V_pulses", "Klow_1_5V_pulses", "low", "nothing but the level, twice", lacks, series),
        ("Kmed_1V_pulses", "Kmed_2V_pulses", "med", "nothing but the level, half", held, series),
    ):
        rig = with_law(
            Rig.load(RIGS / FOLDER / "one_cart.xml"),
            "spring1",
            stiffness=[SPRINGS[spring], 0, 0],
            damping=[9.0, 0, 0],
        )
        diagnosis = lab.diagnose(pulsed(name, *folder), rig, baseline=pulsed(base, *folder), widths=DRIVEN)
        yield told(
            "ECP, 1 cart, motor", f"What changed from {base} to {name}?", known, diagnosis, remark=remark
        )


def three_carts() -> Iterator[Row]:
    """Three carts, the last of which is not measured: the second half of a test against the first."""
    name = "PULSE35_KHLM_021M_CURRENT_TO_X1X2X3"
    whole = measured(f"{FOLDER}/three_carts/{name}", "ecp_carts/three_carts.toml")
    record, middle = whole.records[0], whole.records[0].n_samples // 2
    halves = [
        replace(whole, records=(Record(record.kind, record.inputs[:, part], record.outputs[:, part]),))
        for part in (slice(middle), slice(middle, None))
    ]
    rig = Rig.load(RIGS / FOLDER / "three_carts.xml")
    diagnosis = lab.diagnose(halves[1], rig, baseline=halves[0], widths=DRIVEN)
    cart = diagnosis.calibration["mass cart3"]
    yield told(
        "ECP, 3 carts, motor",
        "Same state, second half?",
        "nothing changed",
        diagnosis,
        remark=f"cart 3, never measured: {cart.value:.3g} ± {cart.std:.1g} kg, documented 1.06 kg",
    )


def changed_on_two_carts() -> Iterator[Row]:
    """Loads on two carts; dry friction, which the model lacks, is found in the known state first."""
    rubbing = {"coulomb_friction": lab.EFFECTS["coulomb_friction"]}
    possible = {name: kind for name, kind in lab.EFFECTS.items() if name not in SILENT}
    for name, base, springs, known in (
        ("KlKh-noM-2M", "KlKh-noM-noM", ("low", "high"), "+0.986 kg on cart 2"),
        ("KhKm-1M-1M", "KhKm-noM-noM", ("high", "med"), "+0.493 kg on each cart"),
    ):
        rig = Rig.load(RIGS / FOLDER / "two_carts.xml")
        for place, spring, drag in zip(("spring1", "spring2"), springs, (9.0, 0.0), strict=True):
            rig = with_law(rig, place, stiffness=[SPRINGS[spring], 0, 0], damping=[drag, 0, 0])
        first, second = (driven(n, "random_two_carts", start=5.0) for n in (base, name))
        model = lab.diagnose(first, rig, widths=DRIVEN, effects=rubbing).extended
        diagnosis = lab.diagnose(second, model, baseline=first, widths=DRIVEN, effects=possible)
        carts = [diagnosis.calibration[f"mass {n}"] for n in ("cart1", "cart2")]
        masses = "; ".join(f"{c.nominal:.3g} → {c.value:.3g} kg" for c in carts)
        masses = f"cart 1 and 2: {masses}; together {sum(c.value - c.nominal for c in carts):+.2f} kg"
        yield told(
            "ECP, 2 carts, motor", f"What changed from {base} to {name}?", known, diagnosis, remark=masses
        )


def checked() -> Iterator[Row]:
    """What the check says of damaged channels and of wrong units."""
    pulses = measured(
        f"{FOLDER}/pulses_steps_one_cart/pulse_kmed_nomass", "ecp_carts/pulses_steps_one_cart.toml"
    )
    record = pulses.records[0]
    raw = replace(pulses, records=(Record(record.kind, record.inputs, 560 * np.asarray(record.outputs)),))
    rig = Rig.load(RIGS / FOLDER / "one_cart.xml")
    bent = "the record stays near +4.2 and -5.1 A, where the published limits are those of other records"
    series = measured(
        f"{FOLDER}/amplitude_series_one_cart/Klow_3V_pulses", "ecp_carts/pulses_steps_one_cart.toml"
    )
    # Sorted by name, the last block, data0010, comes before the one of 3000 samples that is called data009.
    one = series.records[0]
    n = one.n_samples
    order = np.r_[0 : n - 3200, n - 200 : n, n - 3200 : n - 200]
    inputs, outputs = np.asarray(one.inputs)[:, order], np.asarray(one.outputs)[:, order]
    by_name = replace(series, records=(Record(one.kind, inputs, outputs),))
    cases = (
        ("current_sensor_saturation/Positive_saturation", None, "current saturates near +4.4 A", bent),
        ("current_sensor_saturation/Negative_saturation1", None, "current saturates near -10 A", bent),
        (
            "amplitude_series_one_cart/Klow_3V_pulses, blocks sorted by name",
            by_name,
            "1320 counts (0.0236 m) off for a second",
            "stacked by their numbers, as the recipe does, the blocks join without a step",
        ),
        (
            "pulses_steps_one_cart/pulse_kmed_nomass as counts",
            raw,
            "counts, 560 per cm",
            "held against the model",
        ),
    )
    for place, recording, known, remark in cases:
        found = recording or measured(f"{FOLDER}/{place}", "ecp_carts/current_sensor_saturation.toml")
        remarks = lab.check(found, rig if recording is raw else None)
        says = "; ".join(f"{r.channel or 'all'}: {r.says} ({r.check})" for r in remarks)
        yield Row("ECP, check", f"What is wrong in {place}?", known, says or "nothing", remark=remark)


def rows() -> Iterator[Row]:
    """All rows of this rig."""
    parts = (
        friction,
        repeats,
        changed_when_released,
        changed_when_driven,
        changed_under_pulses,
        changed_on_two_carts,
        three_carts,
        checked,
    )
    for part in parts:
        yield from part()
