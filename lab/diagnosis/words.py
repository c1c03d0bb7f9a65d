"""Words: what was found, in sentences for an engineer."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from identification.recording import Array, Recording
from lab.diagnosis.outcome import Alternative, Errors, Quantity
from lab.diagnosis.whiteness import Whiteness
from lab.effects.effect import EVERYWHERE, Effect

FURTHER = {1: "second", 2: "third", 3: "fourth"}
ALIKE = {
    frozenset({"hysteresis", "coulomb_friction"}): "repeat the test at two other levels",
    frozenset({"hysteresis", "quadratic_damping"}): "repeat the test at two other levels",
    frozenset({"coulomb_friction", "quadratic_damping"}): "repeat the test at two other levels",
    frozenset({"cubic_stiffness", "gap_contact"}): "repeat the test at a higher level",
    frozenset(
        {"bilinear_stiffness", "gap_contact"}
    ): "repeat the test at a lower level: a gap opens up, a bilinear spring does not",
    frozenset({"sensor_lag", "sensor_delay"}): "sample faster and excite a wider band",
    frozenset({"actuator_lag", "actuator_delay"}): "sample faster and excite a wider band",
    frozenset({"attached_oscillator", "mass_change"}): "excite a band beyond the oscillator's resonance",
    frozenset({"sensor_gain", "mass_change"}): "calibrate the sensor, or weigh the body",
    frozenset({"actuator_gain", "mass_change"}): "calibrate the load cell, or weigh one body",
    frozenset({"actuator_gain", "stiffness_change"}): "calibrate the load cell, or weigh one body",
    frozenset({"actuator_gain", "sensor_gain"}): "calibrate the load cell, or weigh one body",
    frozenset(
        {"actuator_gain"}
    ): "calibrate one load cell: with several shakers only the ratio of their gains shows",
    frozenset({"unmeasured_force", "line_hum"}): "listen to the channel with its sensor taken off",
}
"""Causes that look alike, and the measurement that tells them apart."""


def says(effect: Effect, quantities: Mapping[str, Quantity]) -> str:
    """One sentence: what is wrong, where, and how much."""
    where = "everywhere" if effect.location == EVERYWHERE else f"at {effect.location.replace('|', ' and ')}"
    kind = " ".join((type(effect).__doc__ or "").split("\n\n")[0].split()).rstrip(".")
    sizes = ", ".join(
        f"{name.removesuffix('_hz').replace('_', ' ')} = {q.value:.4g} ± {q.std:.2g}{'' if q.unit == '1' else ' ' + q.unit}"
        for name, q in quantities.items()
        if name != "phase"
    )
    named = f"{effect.cause.replace('_', ' ').capitalize()} {where}{': ' + sizes if sizes else ''}"
    return f"{named} ({kind[:1].lower()}{kind[1:]})."


def advice(told: str, other: str, gap: float, chance: float = 0.0) -> str:
    """Which measurement tells two causes apart, when the data hardly do: their evidence within e⁵, or within chance."""
    if gap > max(5, chance):
        return ""
    measurement = ALIKE.get(
        frozenset({told, other}), "repeat the test with another input, level or one more sensor"
    )
    it = "it from the same elsewhere" if told == other else f"it from {told.replace('_', ' ')}"
    return f"these data cannot separate {it}: {measurement}"


def inseparable(alternatives: Sequence[Alternative]) -> list[str]:
    """A warning for each alternative that the data hardly tell from the first finding."""
    return [
        f"{other.cause.replace('_', ' ')} at {other.location.replace('|', ' and ')} would explain the first finding about as "
        f"well: {other.advice}"
        for other in alternatives
        if other.advice
    ]


def not_to_be_named(cause: str, location: str) -> str:
    """What the data ask for, where it is not among the causes that may be named."""
    where = "everywhere" if location == EVERYWHERE else f"at {location}"
    return (
        f"the data ask for a {cause.replace('_', ' ')} {where} that is out of the model's tolerance, and {cause} is not among "
        "the causes that may be named; let it be named, or widen the tolerance"
    )


def shared(name: str, std: float) -> str:
    """What the uncertain gain of an input means for all that was found beside a baseline."""
    return (
        f"the gain of {name} stays what the baseline made of it, known to {100 * std:.2g} %: changes in kg, N/m and N s/m "
        "share this error with the model itself; relative changes do not"
    )


def as_in_the_baseline(power: Array, recording: Recording) -> str:
    """What is left, where that is no more than the baseline leaves."""
    shares = ", ".join(
        f"{100 * share:.2g} % of {channel.name}"
        for channel, share in zip(recording.outputs, np.sqrt(power), strict=True)
    )
    return (
        f"the model errs in the baseline too ({shares}, RMS), and no more is left here; the evidence counts samples with alike "
        "errors as one"
    )


def no_gain(errors: Errors) -> str:
    """What was named makes predictions worse."""
    return (
        f"what was named does not predict the data kept aside: the extended model errs by {100 * errors.extended:.3g} % of the "
        f"signal there, the calibrated one by {100 * errors.calibrated:.3g} %; the cause may be another, or one of several"
    )


def left_over(left: Whiteness, recording: Recording) -> str:
    """Where something is left that no cause in the catalogue explains."""
    channel = recording.outputs[left.channel].name
    time = left.lag / recording.sample_rate
    source = "its own past" if left.with_input is None else f"input {left.with_input + 1}"
    source = f"{source} at a lag of {time:.4g} s"
    if left.of_signal:
        source = f"the {'square' if left.of_signal == 2 else 'cube'} of what it should read"
    return (
        f"something is left that no cause in the catalogue explains: the residual of {channel} correlates with {source}, "
        f"{left.largest:.1f} standard deviations where noise stays below {left.limit:.1f}"
    )
