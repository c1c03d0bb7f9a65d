"""Evidence: how far two fits that both err can be told apart."""

import numpy as np
import pytest
import scipy.signal

from lab.diagnosis.candidate import Candidate
from lab.diagnosis.conclude import _alternatives, predicts
from lab.diagnosis.evidence import undecided
from lab.diagnosis.fit import Fit
from lab.diagnosis.outcome import Errors

A, REPEATS = 0.8, 400
COLOUR = (1 + A**2) / (1 - A**2)
"""Of first-order noise with correlations A^|k|: the sum of their squares."""


def fit_with(residual):
    nothing = np.zeros(0)
    square = np.zeros((0, 0))
    return Fit(nothing, (), residual, 0.0, square, square, square, 0)


def pairs(n, common=0.0):
    """Residuals of two fits, (REPEATS, 2 channels, n) each, of errors that stay alike and are partly the same."""
    e = np.random.default_rng(1).standard_normal((3, REPEATS, 2, n + 100))
    e = scipy.signal.lfilter([1], [1, -A], e)[..., 100:]
    return e[0] + common * e[2], e[1] + common * e[2]


def ratio(told, other):
    """Log likelihood ratio of two residuals, samples that count as one taken as one."""
    power = np.mean(other**2, axis=-1) / np.mean(told**2, axis=-1)
    return 0.5 * told.shape[-1] / COLOUR * np.sum(np.log(power), axis=-1)


@pytest.mark.parametrize("common", [0.0, 3.0])
@pytest.mark.parametrize("n", [80, 300, 4000])
def test_fits_that_err_alike_are_told_apart_once_in_twenty_tests(n, common):
    told, other = pairs(n, common)
    chance = [undecided(fit_with(a), fit_with(b), COLOUR) for a, b in zip(told, other, strict=True)]
    # Of 400 repeats 20 ± 4.4; stretches of correlated samples miss a little at their ends.
    assert 2 <= np.sum(np.abs(ratio(told, other)) > chance) <= 40


def test_errors_that_fall_all_along_are_told():
    told, other = pairs(4000)
    better = 0.5 * told[0]
    assert ratio(better, other[0]) > 2 * undecided(fit_with(better), fit_with(other[0]), COLOUR)


def test_alternatives_are_close_where_errors_decide_and_not_where_noise_does():
    (told, *_), (other, *_) = pairs(4000)
    first = Candidate("mass_change", "block1", fit_with(told), 60.0)
    second = Candidate("mass_change", "block2", fit_with(other), 60.0 - 12.0)
    (noisy,), (erring,) = (_alternatives([first, second], colour) for colour in (1.0, COLOUR))
    # Odds of e⁶ where the errors are noise; chance alone makes twice that of errors which stay alike.
    assert noisy.advice == ""
    assert "the same elsewhere" in erring.advice


@pytest.mark.parametrize(
    ("calibrated", "extended", "said"),
    [(0.5, 0.1, True), (0.5, 0.5, False), (0.5, 0.6, False), (1.5, 1.1, False), (0.5, np.nan, False)],
)
def test_what_was_named_must_predict_better(calibrated, extended, said):
    assert predicts(Errors(0.01, 2.0, calibrated, extended)) is said
