"""Error bars against derivatives taken by differences, plain loops, classical formulas and repeated tests."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from benchmarks.error_bars import CASES, calibrate
from identification.covariance_scatter import Influence, _series
from identification.era import era
from identification.error_bars import modes_with_std
from identification.errors import IdentificationError, TooShortError
from identification.hankel_perturbation import hankel_tangent
from identification.identify import identify
from identification.matrix_scatter import matrix_move
from identification.parameterizations import Tangent
from identification.pulse import markov_parameters
from identification.recording import Recording
from identification.resampling import jackknife_std, without_part
from identification.second_order import second_order
from identification.series_scatter import std_of_sum
from tests.ambient import ambient, output_record
from tests.systems import paper_chain3, pulse_recording, recorded, with_noise


def one(tangent: Tangent, k: int) -> Tangent:
    return Tangent(tangent.system, *(getattr(tangent, f"{name}_theta")[k : k + 1] for name in "ABCD"))


def test_the_model_moves_as_the_realization_of_moved_markov_parameters_does():
    markov = markov_parameters(pulse_recording(paper_chain3(), 200))
    size = {"n_rows": 60, "n_columns": 80}
    system = era(markov, 6, **size).system
    changes = np.random.default_rng(0).standard_normal((3, *markov.values.shape))
    tangent = hankel_tangent(system, changes, **size)
    h = 1e-7  # truncation errs by h over the last singular value, 1e-5; rounding by less
    for k, change in enumerate(changes):
        ahead, behind = (
            era(replace(markov, values=markov.values + s * h * change), 6, **size).system for s in (1, -1)
        )
        found = modes_with_std(one(tangent, k), np.eye(1))
        for name, std in (("frequency_hz", "frequency_std"), ("damping_ratio", "damping_std")):
            slope = (getattr(ahead.modes(), name) - getattr(behind.modes(), name)) / (2 * h)
            assert_allclose(getattr(found, std), np.abs(slope), rtol=1e-4)
        dofs = second_order(system).dofs
        M1, M0 = second_order(ahead, dofs=dofs), second_order(behind, dofs=dofs)
        for move, name in zip(
            matrix_move(one(tangent, k), dofs), ("mass", "damping", "stiffness"), strict=True
        ):
            slope = (getattr(M1, name) - getattr(M0, name)) / (2 * h)
            assert_allclose(move, slope, atol=1e-4 * np.max(np.abs(slope)))


def test_the_sum_of_a_correlated_series_scatters_with_its_long_run_variance():
    rng = np.random.default_rng(1)
    n, phi = 4000, 0.9
    x = rng.standard_normal((200, n + 200))
    for k in range(1, x.shape[1]):
        x[:, k] += phi * x[:, k - 1]
    std = std_of_sum(x[:, 200:], 1 / (1 - phi))
    # The variance of the sum of an autoregression tends to n / (1 - φ)². 200 x 40 cosines tell it to 1.6 %
    # of the variance, and the spectrum falls by less than 2 % over them.
    assert_allclose(np.mean(std**2), n / (1 - phi) ** 2, rtol=0.07)


def test_a_short_series_is_refused():
    with pytest.raises(TooShortError, match="record for longer"):
        std_of_sum(np.ones(100), 30)


def test_the_influence_of_the_record_is_that_of_a_plain_loop():
    rng = np.random.default_rng(2)
    n, n_poles = 300, 2
    y = rng.standard_normal((3, n))
    y -= y.mean(axis=1, keepdims=True)
    rows = np.array([2, 0])

    def complex_(*shape):
        return rng.standard_normal(shape) + 1j * rng.standard_normal(shape)

    influence = Influence(complex_(n_poles), complex_(n_poles, 5, 3), complex_(n_poles, 7, 2))
    alpha = [
        np.einsum("pio,oi->p", influence.future, y[:, t : t + 5]) if t + 5 <= n else None for t in range(n)
    ]
    expected = [
        (alpha[t + 1] - influence.z * alpha[t])
        * np.einsum("pjr,rj->p", influence.past, y[rows][:, t - 7 : t][:, ::-1])
        for t in range(7, n - 5)
    ]
    found = np.concatenate(list(_series(output_record(y), rows, influence)), axis=1)
    assert_allclose(found.T, expected, atol=1e-11)  # rounding of sums of about 30 terms of size 1


def test_the_jackknife_of_a_mean_is_the_standard_error_of_the_part_means():
    y = np.random.default_rng(6).standard_normal((1, 1000))
    recording = Recording((output_record(y[:, :350]), output_record(y[:, 350:])), (), CHANNELS, 1.0)

    def mean(part):
        return np.array([sum(np.sum(r.outputs) for r in part.records) / part.n_samples])

    std = jackknife_std(recording, mean, n_parts=10)
    parts = y.reshape(10, 100).mean(axis=1)
    assert_allclose(std, np.std(parts, ddof=1) / np.sqrt(10), rtol=1e-10)


def test_leaving_out_a_part_keeps_all_other_samples_in_order():
    y = np.arange(100.0)[None]
    recording = Recording((output_record(y[:, :35]), output_record(y[:, 35:])), (), CHANNELS, 1.0)
    for part in range(10):
        left = np.concatenate([r.outputs[0] for r in without_part(recording, part, 10).records])
        assert left.tolist() == [k for k in range(100) if k // 10 != part]


CHANNELS = ambient(10, 0).outputs[:1]


def test_an_estimate_that_is_lost_without_a_part_has_no_finite_error_bar():
    recording = Recording((output_record(np.zeros((1, 100))),), (), CHANNELS, 1.0)
    assert jackknife_std(recording, lambda part: np.array([np.nan, 1.0])).tolist() == [np.inf, 0.0]


def test_a_transient_cannot_spare_a_part():
    with pytest.raises(IdentificationError, match="free_decay"):
        jackknife_std(
            Recording((output_record(np.zeros((1, 100)), "free_decay"),), (), CHANNELS, 1.0),
            lambda _: np.zeros(1),
        )


def test_error_bars_can_be_left_out():
    found = identify(with_noise(pulse_recording(paper_chain3(), 200), 0.05, 0), order=6, uncertainty=False)
    assert found.modes.frequency_std is None
    assert found.second_order is not None
    assert found.second_order.mass_std is None


def test_data_without_noise_have_error_bars_of_the_size_of_rounding():
    system = paper_chain3()
    forces = np.random.default_rng(7).standard_normal((2, 1000))
    for recording in (pulse_recording(system, 200), recorded(system, [forces])):
        found = identify(recording)
        assert found.modes.frequency_std is not None
        assert found.second_order is not None
        # Rounding is 1e-16 of the outputs, and the weakest state 1e-5 of the strongest.
        assert np.max(found.modes.damping_std) < 1e-9
        assert np.max(found.second_order.mass_std) < 1e-8


def test_error_bars_grow_with_the_noise():
    recording = pulse_recording(paper_chain3(), 200)
    # The same noise pattern: to first order everything doubles; 2 % of noise leaves second-order terms of some percent.
    low, high = (identify(with_noise(recording, level, 8), order=6) for level in (0.01, 0.02))
    assert_allclose(high.modes.damping_std, 2 * low.modes.damping_std, rtol=0.15)
    assert_allclose(high.second_order.mass_std, 2 * low.second_order.mass_std, rtol=0.15)


def test_ambient_error_bars_do_not_depend_on_the_unit():
    recording = ambient(5000, 9, noise=0.05)
    scaled = replace(recording, records=tuple(output_record(7 * r.outputs) for r in recording.records))
    a, b = (identify(each, order=14) for each in (recording, scaled))
    assert_allclose(a.modes.damping_std, b.modes.damping_std, rtol=1e-6)


def test_too_short_a_record_says_so_and_has_none():
    found = identify(ambient(400, 10), "ssi_cov", order=4, n_rows=40)
    assert found.modes.frequency_std is None
    assert any("no error bars" in note and "record for longer" in note for note in found.notes)


@pytest.mark.slow
@pytest.mark.parametrize(
    "name", [name for name in CASES if "short" not in name]
)  # those have tests of their own
def test_error_bars_are_as_long_as_the_scatter_of_repeated_tests(name):
    n = 16
    found = calibrate(CASES[name], n, seed=1)
    assert found.n_tests >= 0.9 * n
    # A ratio is known to 1/√(2 n) = 18 %, and the draws of the noise know it to 4 %, as each test draws anew: three of both
    # together beyond the range of 0.8 to 1.25 that is asked for; the median of some three that are independent, to less.
    slack = 3 * np.hypot(1 / np.sqrt(2 * n), 0.04)
    assert np.abs(np.log(np.median(found.ratio))) < np.log(1.25) + slack / np.sqrt(3)
    assert np.all(np.abs(np.log(found.ratio)) < np.log(1.25) + slack)
    # 95 % hold the truth; the modes of one test are far from independent.
    assert np.mean(found.coverage) > 0.95 - 3 * np.sqrt(0.95 * 0.05 / n)
