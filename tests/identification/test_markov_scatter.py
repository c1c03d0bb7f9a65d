"""Error bars of the methods that realize pulse responses, against those of ERA and of repeated tests."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from benchmarks.error_bars import Case, calibrate
from identification.era import era_dc
from identification.errors import IdentificationError
from identification.identify import identify
from identification.markov_methods import MARKOV_METHODS
from identification.markov_scatter import markov_scatter, with_best_inputs
from identification.methods import METHODS
from identification.pulse import markov_parameters
from identification.pulse_scatter import residual_std
from identification.residual_scatter import DRAWS
from tests.systems import paper_chain3, pulse_recording, with_noise

TRUTH = paper_chain3().modes()


def pulses(level, seed):
    return with_noise(pulse_recording(paper_chain3(), 200), level, seed)


def test_all_of_them_are_methods_of_a_recording():
    assert MARKOV_METHODS.keys() <= METHODS.keys()


def test_a_model_that_grows_beyond_all_bounds_is_refused():
    markov = markov_parameters(pulses(0.01, 0))
    many = replace(markov, values=np.tile(markov.values, (60, 1, 1)))
    system = era_dc(markov, order=6).system
    growing = replace(system, A=1.2 * np.eye(system.n_states))
    with pytest.raises(IdentificationError, match="grows beyond all bounds within"):
        with_best_inputs(many, growing)


@pytest.mark.parametrize("name", ["itd", "mrtd", "mmrtd"])
def test_every_mode_and_matrix_has_an_error_bar_that_holds(name):
    found = identify(pulses(0.01, 0), name, order=6)
    for values, truth, std in (
        (found.modes.frequency_hz, TRUTH.frequency_hz, found.modes.frequency_std),
        (found.modes.damping_ratio, TRUTH.damping_ratio, found.modes.damping_std),
    ):
        # Six figures of one test: beyond four of their standard deviations once in thousands.
        assert np.all(np.abs(values - truth) < 4 * std)
        # Less than a few percent of noise can tell is no honest bar, nor is more than a tenth.
        assert np.all((std > 1e-5) & (std < 0.1 * truth))
    assert found.second_order is not None
    assert np.all(found.second_order.mass_std > 0)


def test_normal_forms_scatter_as_era_does():
    recording = pulses(0.01, 1)
    size = {"n_rows": 60, "n_columns": 80}
    plain = identify(recording, "era", order=6, **size).modes
    # MRTD is ERA in output-normal form, and MMRTD in input-normal form: the same poles, and the same draws.
    mrtd, mmrtd = (identify(recording, name, order=6, **size).modes for name in ("mrtd", "mmrtd"))
    np.testing.assert_allclose(mrtd.frequency_hz, plain.frequency_hz, rtol=1e-9)
    np.testing.assert_allclose(mrtd.damping_std, mmrtd.damping_std, rtol=1e-6)
    # Draws tell a deviation to 1 / √(2 · 24) = 14 %, ERA's own 200 draws to 5 %: four of both.
    for name in ("frequency_std", "damping_std"):
        ratio = getattr(mrtd, name) / getattr(plain, name)
        assert np.all(np.abs(np.log(ratio)) < 4 * np.hypot(1 / np.sqrt(2 * DRAWS), 0.05))


def test_without_noise_the_bars_are_rounding():
    recording = pulse_recording(paper_chain3(), 200)
    found = METHODS["mrtd"](recording, 6)
    places = [(6, complex(pole)) for pole in found.system.modes().poles]
    assert np.max(markov_scatter(recording, found, places)[:2]) < 1e-9


def test_a_mode_is_read_at_the_order_where_it_stands():
    recording = pulses(0.01, 2)
    found = METHODS["mrtd"](recording, 6, orders=[6, 8])
    pole = complex(found.at(6).modes().poles[0])
    low, high = (np.array(markov_scatter(recording, found, [(order, pole)])[:2]) for order in (6, 8))
    assert np.all(np.isfinite(low))
    assert not np.array_equal(low, high)


def test_the_best_inputs_are_those_of_the_model_when_data_are_its_own():
    system = paper_chain3()
    markov = system.markov(100)
    wrong = replace(system, B=2 * system.B[:, ::-1])
    np.testing.assert_allclose(with_best_inputs(markov, wrong).B, system.B, atol=1e-10)


def test_what_a_correlated_realization_leaves_is_the_noise():
    clean = pulse_recording(paper_chain3(), 400)
    measured = markov_parameters(with_noise(clean, 0.05, 1))
    noise = np.sqrt(np.mean((measured.values - markov_parameters(clean).values) ** 2, axis=0))
    system = era_dc(measured, 6).system
    found = residual_std(measured, with_best_inputs(measured, system))
    # The model itself, B from its first lags, leaves up to twice the noise. Errors of the shapes remain, and the fit of
    # 12 numbers in each response to 400 lags makes 1.5 %.
    np.testing.assert_allclose(found, noise, rtol=0.06)
    assert np.max(residual_std(measured, system) / noise) > 1.5


def test_bars_of_a_correlated_realization_are_as_long_as_the_scatter_of_repeated_tests():
    n, size = 16, {"n_rows": 15, "n_shifts": 3}
    case = Case(lambda rng: pulses(0.04, rng), TRUTH, {"method": "era_dc", "order": 6, **size})
    found = calibrate(case, n, seed=3)
    assert found.n_tests == n
    # A spread over n tests is known to 1/√(2 n), and what all bars share, their draws, tells a deviation to
    # 1/√(2 · 24): three of both beyond the range of 0.8 to 1.25 that is asked for.
    slack = 3 * np.hypot(1 / np.sqrt(2 * n), 1 / np.sqrt(2 * DRAWS))
    assert np.all(np.abs(np.log(found.ratio)) < np.log(1.25) + slack)
    # Six such figures together are known better: those of bars twice too wide lie beyond.
    assert abs(np.mean(np.log(found.ratio))) < np.log(1.25)
