"""A diagnosis in words and rows of text, the same for the report, the viewer and the screen."""

from __future__ import annotations

import math
from dataclasses import dataclass

from identification.recording import Recording
from lab.diagnosis.outcome import CONSISTENT, EXPLAINED, Diagnosis, Quantity
from lab.show.diagnosed import Diagnosed
from lab.show.residuals import Leftover, leftover
from lab.show.tables import with_std
from lab.show.verdict import FAILED, FOUND, PASSED, Verdict

UNKNOWN = "not known"
ERRORS = {
    "nominal": "model as given",
    "calibrated": "calibrated",
    "extended": "extended by the findings",
    "noise_floor": "noise floor",
}


@dataclass(frozen=True)
class Table:
    """Heads and rows of a table; the first column names the row."""

    heads: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]


def verdict_of(diagnosis: Diagnosis, recording: Diagnosed) -> Verdict:
    """What the diagnosis comes to, in a few sentences for an engineer."""
    e = diagnosis.errors
    if diagnosis.verdict == CONSISTENT and diagnosis.spectra is not None:
        text = (
            "Consistent: the model agrees with the spectra within scatter and small calibration; on data kept aside it errs by "
            f"{share(e.calibrated)}, and scatter alone makes {share(e.noise_floor)}."
        )
        return Verdict(PASSED, text)
    if diagnosis.verdict == CONSISTENT:
        text = (
            "Consistent: the model agrees with the recording within noise and small calibration; on data kept aside it "
            f"misses {share(e.calibrated)} of the signal, and the noise floor is {share(e.noise_floor)}."
        )
        return Verdict(PASSED, text)
    said = " ".join(f"{finding.says.strip().rstrip('.')}." for finding in diagnosis.findings)
    fall = (
        f"On data kept aside the error falls from {share(e.nominal)} (as given) and {share(e.calibrated)} (calibrated) to "
        f"{share(e.extended)}; the noise floor is {share(e.noise_floor)}."
    )
    if diagnosis.verdict == EXPLAINED:
        return Verdict(FOUND, f"Explained: {said} {fall}")
    if diagnosis.spectra is not None:
        told = diagnosis.warnings[0] if diagnosis.warnings else "something is left"
        return Verdict(
            FAILED, f"Unexplained: {told}.{f' What was explained so far: {said}' if said else ''} {fall}"
        )
    assert isinstance(recording, Recording)  # responses are spectra, told above
    so_far = f" What was explained so far: {said}" if said else ""
    left = "Unexplained: something is left that no cause in the catalogue explains, "
    return Verdict(FAILED, f"{left}{where(leftover(diagnosis, recording))}.{so_far} {fall}")


def where(left: Leftover) -> str:
    """Where an unexplained error sits: channel, time, frequency and amplitude."""
    tone = "" if left.frequency_hz is None else f", strongest near {left.frequency_hz:.3g} Hz"
    amplitude = (
        f"and {left.growth:.2g} times as large in lively motion as in calm"
        if left.growth >= 1.5
        else f"and {1 / left.growth:.2g} times as large in calm motion as in lively"
        if left.growth <= 1 / 1.5
        else "and about as large in calm motion as in lively"
    )
    return (
        f"most of it in channel {left.channel} ({share(left.error)} of its signal), largest in record {left.record} from "
        f"{left.time[0]:.3g} s to {left.time[1]:.3g} s{tone}, {amplitude}"
    )


def finding_table(diagnosis: Diagnosis) -> Table:
    """Cause, place, parameters with their error bars, evidence and gain of every finding."""
    heads = ("Cause", "Location", "Parameters", "Evidence", "Gain")
    rows = tuple(
        (
            words(finding.effect.cause),
            finding.effect.location,
            "; ".join(parameter(name, value) for name, value in finding.parameters.items()) or "none",
            evidence(finding.log_evidence_gain),
            share(finding.holdout_gain),
        )
        for finding in diagnosis.findings
    )
    return Table(heads, rows)


def alternative_table(diagnosis: Diagnosis) -> Table:
    """Other explanations of the first finding, how much worse each is, and what would tell them apart."""
    advised = any(other.advice for other in diagnosis.alternatives)
    best = diagnosis.findings[0].log_evidence_gain if diagnosis.findings else math.nan
    rows = tuple(
        (
            words(other.cause),
            other.location,
            evidence(other.log_evidence_gain),
            evidence(best - other.log_evidence_gain),
            *((other.advice,) if advised else ()),
        )
        for other in diagnosis.alternatives
    )
    heads = ("Cause", "Location", "Evidence", "Worse by")
    return Table(heads + (("To tell them apart",) if advised else ()), rows)


@dataclass(frozen=True)
class Weighed:
    """A cause that was weighed, and its evidence.

    Attributes:
        text: cause and place.
        log_evidence_gain: natural logarithm of how much more probable the data are with it than without.
        found: whether it is a finding, or only another explanation of the first one.
    """

    text: str
    log_evidence_gain: float
    found: bool


def weighed_causes(diagnosis: Diagnosis) -> tuple[Weighed, ...]:
    """The findings in their order, then the other explanations of the first one, best first."""
    findings = [
        Weighed(f"{words(f.effect.cause)} at {place(f.effect.location)}", f.log_evidence_gain, True)
        for f in diagnosis.findings
    ]
    others = [
        Weighed(f"{words(a.cause)} at {place(a.location)}", a.log_evidence_gain, False)
        for a in diagnosis.alternatives
    ]
    return (*findings, *others)


def place(location: str) -> str:
    """A location as one reads it."""
    if location == "*":
        return "all places alike"
    return " and ".join("the ground" if part == "world" else part for part in location.split("|"))


def error_table(diagnosis: Diagnosis) -> Table:
    """The four errors, also as multiples of the noise floor."""
    floor = diagnosis.errors.noise_floor
    rows = []
    for name, text in ERRORS.items():
        error = getattr(diagnosis.errors, name)
        rows.append((text, share(error), number(error / floor, 4) if floor > 0 else UNKNOWN))
    return Table(("Model", "RMS error / RMS signal", "Noise floors"), tuple(rows))


def calibration_table(diagnosis: Diagnosis) -> Table:
    """Every parameter that the model has already: nominal, calibrated with its error bar, and the change."""
    rows = tuple(
        (
            name,
            f"{each.nominal:#.6g}",
            with_std(each.value, each.std),
            f"{100 * (each.value / each.nominal - 1):+.2g} %" if each.nominal else UNKNOWN,
        )
        for name, each in diagnosis.calibration.items()
    )
    return Table(("Parameter", "Nominal", "Calibrated", "Change"), rows)


def noise_table(diagnosis: Diagnosis) -> Table:
    """RMS of the noise of every output, with its error bar."""
    rows = tuple(
        (name, f"{with_std(each.value, each.std)} {each.unit.replace('^2', '²')}")
        for name, each in diagnosis.noise.items()
    )
    return Table(("Output", "RMS of the noise"), rows)


def parameter(name: str, quantity: Quantity) -> str:
    """A parameter with one standard deviation and its unit."""
    unit = "" if quantity.unit in ("", "1") else f" {quantity.unit}"
    value = with_std(quantity.value, quantity.std)
    if " ± " in value and unit:
        value = f"({value})"
    return f"{words(name.removesuffix('_hz'))} = {value}{unit}"


def evidence(value: float) -> str:
    """A logarithm of evidence: tenths matter near zero only."""
    if not math.isfinite(value):
        return UNKNOWN
    return f"{value:.1f}" if abs(value) < 1000 else f"{value:.0f}"


def words(cause: str) -> str:
    """A cause as one reads it."""
    return cause.replace("_", " ")


def share(ratio: float) -> str:
    """A share in percent with three digits."""
    return f"{100 * ratio:.3g} %" if math.isfinite(ratio) else UNKNOWN


def number(value: float, digits: int = 4) -> str:
    """A number, or that it is not known."""
    return f"{value:.{digits}g}" if math.isfinite(value) else UNKNOWN
