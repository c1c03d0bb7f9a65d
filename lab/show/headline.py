"""A diagnosis in one sentence for a reader who knows nothing of it, and the words that its page uses."""

from __future__ import annotations

from lab.diagnosis.outcome import CONSISTENT, EXPLAINED, Diagnosis
from lab.show.findings import place, share, words
from lab.show.verdict import FAILED, FOUND, PASSED, Verdict

NOTABLE = 1.5
"""Errors of a consistent model, in noise floors, that a reader will ask about."""
GLOSSARY = (
    ("as given", "the model file, unchanged"),
    (
        "calibrated",
        "the same model, its masses, stiffnesses and dampings moved within their tolerances to fit the recording; nothing "
        "added",
    ),
    (
        "extended",
        "calibrated together with the findings; the file extended.xml beside this page, which MuJoCo loads",
    ),
    ("data kept aside", "the end of every record, or some lines of the spectra, which no fit has seen"),
    (
        "noise floor",
        "the error that noise in the measurements makes by itself; a right model errs as much, none errs less",
    ),
    (
        "evidence",
        "natural logarithm of how much more probable the data are with the cause than without, its freedom to fit "
        "accounted for; above 5 it is very strong (Kass and Raftery 1995)",
    ),
    (
        "gain",
        "share of the calibrated model's error above the noise floor that the cause removes, on data kept aside",
    ),
)
"""Terms and what they mean."""


def headline(diagnosis: Diagnosis) -> Verdict:
    """What the diagnosis comes to in one sentence."""
    e = diagnosis.errors
    named = " and ".join(
        f"{words(finding.effect.cause)} at {place(finding.effect.location)}" for finding in diagnosis.findings
    )
    noise = f"noise alone makes {share(e.noise_floor)}"
    if diagnosis.verdict == CONSISTENT:
        error = f"it misses {share(e.calibrated)} of the signal on data kept aside"
        more = e.calibrated > NOTABLE * e.noise_floor and diagnosis.warnings
        why = "; why the difference is no finding is said under warnings" if more else ""
        return Verdict(PASSED, f"Consistent: the model describes this test; {error}, and {noise}{why}.")
    if diagnosis.verdict == EXPLAINED:
        n = len(diagnosis.findings)
        count = "one thing is" if n == 1 else f"{n} things are"
        fall = (
            f"the model misses {share(e.extended)} of the signal instead of {share(e.nominal)}, and {noise}"
        )
        return Verdict(
            FOUND, f"Explained: {count} wrong with the model, {named}; with that put right {fall}."
        )
    rest = "no known cause accounts for all of it"
    if named:
        rest = f"{named} accounts for part of it, and no known cause for the rest"
    best = e.extended if diagnosis.findings else e.calibrated
    return Verdict(
        FAILED,
        f"Unexplained: the model is wrong (at its best it misses {share(best)} of the signal, where {noise}), and {rest}.",
    )
