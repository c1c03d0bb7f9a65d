"""Error bars from redrawn noise against the variance of a linear estimate, which is known."""

from dataclasses import replace

import numpy as np
import pytest

from identification.errors import TooShortError
from identification.recording import Record
from identification.residual_scatter import DRAWS, NEARBY, redrawn, residual_scatter
from tests.systems import paper_chain3, recorded


def test_a_linear_estimate_scatters_as_its_weights_say():
    rng = np.random.default_rng(0)
    recording = recorded(paper_chain3(), [rng.standard_normal((2, 400))])
    noise = 0.1 * rng.standard_normal((2, 400))
    noisy = replace(
        recording, records=(replace(recording.records[0], outputs=recording.records[0].outputs + noise),)
    )
    weights = rng.standard_normal((30, 2, 400))
    std = residual_scatter(noisy, [noise], lambda r: np.tensordot(weights, r.records[0].outputs, 2)).std
    expected = 0.1 * np.linalg.norm(weights.reshape(30, -1), axis=1)
    # Each is good to 1/√(2 · 23); thirty together are five times better.
    assert np.sqrt(np.mean((std / expected) ** 2)) == pytest.approx(1, abs=4 / np.sqrt(2 * (DRAWS - 1) * 30))


@pytest.mark.parametrize("n", [64, 65])
def test_drawn_noise_has_the_power_of_the_lines_nearby(n):
    rng = np.random.default_rng(4)
    noise = rng.standard_normal((1, n))
    E = np.fft.rfft(noise[0])
    reach, last = int(np.ceil(NEARBY * E.size)), E.size - 1
    power = np.zeros(E.size)
    for k in range(E.size):
        nearby = [abs(k + step) for step in range(-reach, reach + 1)]
        power[k] = np.mean([abs(E[j if j <= last else 2 * last - j]) ** 2 for j in nearby])
    drawn = np.array([np.fft.rfft(redrawn(np.vstack([noise, 2 * noise]), rng)) for _ in range(4000)])
    # Each line is a power of one of five, with a phase: the mean of 4000 is good to some 2 %, two lines without a phase
    # to 4 %; four of that.
    np.testing.assert_allclose(np.mean(np.abs(drawn[:, 0]) ** 2, axis=0), power, rtol=0.16)
    np.testing.assert_allclose(drawn[:, 1], 2 * drawn[:, 0], atol=1e-11)  # rounding


def test_coloured_noise_keeps_its_colour_and_its_share_at_each_output():
    rng = np.random.default_rng(1)
    white = rng.standard_normal(1001)
    slow = np.convolve(white, np.ones(20) / np.sqrt(20), mode="valid")[:982]
    noise = np.stack([slow, slow])
    record = Record("random", np.zeros((2, 982)), noise)
    recording = replace(recorded(paper_chain3(), [np.zeros((2, 4))]), records=(record,))

    def estimate(part):
        y = part.records[0].outputs
        return np.array([np.mean(y[0]), y[0, 500] - y[1, 500]])

    std = residual_scatter(recording, [noise], estimate).std
    # The mean of n values scatters by √(S(0) / n) with S(0) = 20, as their spectrum is sinc² with its first zero at the
    # line n / 20, of which the lines nearby reach half: its mean there is 0.77. The power of some 25 lines is known
    # to 20 %, so the deviation to 10 %, and to 15 % for the draws: three of both. White noise has 1 / √20 = 0.22.
    assert std[0] == pytest.approx(np.sqrt(0.77 * 20 / 982), rel=0.54)
    assert std[1] < 1e-12


def test_noise_that_the_fit_has_absorbed_at_a_resonance_is_drawn_all_the_same():
    rng = np.random.default_rng(3)
    spectrum = np.fft.rfft(rng.standard_normal((2, 1000)))
    spectrum[:, 98:103] = 0
    noise = np.fft.irfft(spectrum, 1000)
    record = Record("random", np.zeros((2, 1000)), noise)
    recording = replace(recorded(paper_chain3(), [np.zeros((2, 4))]), records=(record,))
    wave = np.cos(2 * np.pi * 100 * np.arange(1000) / 1000)
    std = residual_scatter(recording, [noise], lambda r: r.records[0].outputs @ wave).std
    # Of 51 lines nearby 46 are left. Fifty of them tell the deviation to 7 %, the draws to 15 %: three of both.
    np.testing.assert_allclose(std, np.linalg.norm(wave) * np.sqrt(46 / 51), rtol=0.5)


def test_what_often_fails_has_no_finite_error_bar_and_short_records_none():
    record = Record("random", np.zeros((2, 50)), np.ones((2, 50)))
    recording = replace(recorded(paper_chain3(), [np.zeros((2, 4))]), records=(record,))
    rng = np.random.default_rng(2)
    noise = rng.standard_normal((2, 50))

    def fails(part):
        return np.array([np.nan if part.records[0].outputs[0, 3] > 1 else 1.0, 2.0])

    std = residual_scatter(recording, [noise], fails).std
    assert std[0] == np.inf
    assert std[1] == 0
    with pytest.raises(TooShortError, match="beyond 100 unknowns"):
        residual_scatter(recording, [noise], fails, n_unknowns=100)
