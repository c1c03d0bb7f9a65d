"""Time-domain methods: equal to the forms of `era` to eleven digits, and exact without noise."""

from dataclasses import replace

import numpy as np
import pytest
import scipy.linalg

from identification.era import FORMS, era
from identification.errors import IdentificationError, OrderError
from identification.time_domain import change_of_form, itd, mmrtd, mmrtd_real, mrtd, mrtd_real
from tests import systems

MODES4 = systems.modes4()
SIZE = {"n_rows": 128, "n_columns": 32}
LEVELS = pytest.mark.parametrize("level", [0.0, 0.05], ids=["exact", "noisy"])
COMPLEX = pytest.mark.parametrize("method", [itd, mrtd, mmrtd])


def data(level, n_lags=161):
    """The thesis' data: lag 0 is D, and the Hankel matrix takes 127 + 31 shifts and one more."""
    markov = MODES4.markov(n_lags)
    Y = systems.noisy(np.moveaxis(markov.values, 0, -1), level, np.random.default_rng(11))
    return replace(markov, values=np.moveaxis(Y, -1, 0))


def assert_same_system(a, b, digits=11):
    for name in "ABC":
        x, y = getattr(a, name), getattr(b, name)
        np.testing.assert_allclose(x, y, rtol=0, atol=10.0**-digits * np.abs(y).max())


@LEVELS
def test_real_mrtd_is_the_output_normal_form(level):
    markov = data(level)
    assert_same_system(
        mrtd_real(markov, 8, **SIZE).system, era(markov, 8, form="output_normal", **SIZE).system
    )


@LEVELS
def test_real_mmrtd_is_the_input_normal_form(level):
    markov = data(level)
    assert_same_system(
        mmrtd_real(markov, 8, **SIZE).system, era(markov, 8, form="input_normal", **SIZE).system
    )


@LEVELS
@pytest.mark.parametrize("source", FORMS)
@pytest.mark.parametrize("target", FORMS)
def test_powers_of_the_singular_values_take_one_form_into_another(source, target, level):
    markov = data(level)
    found = era(markov, 8, form=source, **SIZE)
    T = change_of_form(found.singular_values, 8, source, target)
    inverse = np.diag(1 / np.diag(T))
    moved = replace(
        found.system, A=T @ found.system.A @ inverse, B=T @ found.system.B, C=found.system.C @ inverse
    )
    assert_same_system(moved, era(markov, 8, form=target, **SIZE).system, digits=13)


def test_printed_transformation_from_input_normal_to_balanced():
    # Juang (1992), 6.1.1, T_ib; the damping is known to two digits, so a tenth of a per cent of agreement.
    found = era(data(0.0), 8, **SIZE)
    printed = [40.086, 40.062, 13.062, 12.357, 12.150, 8.642, 0.210, 0.199]
    T = change_of_form(found.singular_values, 8, "input_normal", "balanced")
    np.testing.assert_allclose(np.diag(T), printed, rtol=1.5e-3, atol=1e-3)


@LEVELS
@pytest.mark.parametrize("method", [mrtd, mmrtd])
def test_complex_forms_give_the_markov_parameters_of_era(method, level):
    markov = data(level)
    expected = era(markov, 8, **SIZE).system.markov(641).values
    found = method(markov, 8, **SIZE).markov(641).values
    # The modal coordinates of the two modes at 9 Hz have a condition of 1e4 or so.
    np.testing.assert_allclose(found, expected, atol=1e-10 * np.abs(expected).max())


@LEVELS
def test_itd_cut_to_an_order_has_the_poles_of_era(level):
    # The non-zero eigenvalues of X Y are those of Y X. Its shapes are other projections of the noise.
    markov = data(level)
    z = np.sort_complex(scipy.linalg.eigvals(era(markov, 8, **SIZE).system.A))
    np.testing.assert_allclose(np.sort_complex(itd(markov, 8, **SIZE).z), z, atol=1e-9)


@COMPLEX
def test_exact_data_give_the_modes_of_the_model(method):
    modes, truth = method(data(0.0), 8, **SIZE).modes(), MODES4.modes()
    np.testing.assert_allclose(modes.frequency_hz, truth.frequency_hz, rtol=1e-9)
    np.testing.assert_allclose(modes.damping_ratio, truth.damping_ratio, rtol=1e-6)
    shapes, expected = (m.normalized().shapes for m in (modes, truth))
    # Two modes 3 mHz apart: rounding over their distance of 1e-4 radians per sample.
    np.testing.assert_allclose(shapes, expected, atol=1e-6)


def test_order_of_mrtd_and_mmrtd_is_chosen():
    for method in (mrtd, mmrtd):
        assert method(data(0.0), **SIZE).z.size == 8


def test_original_itd_keeps_all_of_the_noise():
    found = itd(data(0.05), **SIZE)
    # Rank 32, the smaller side of the Hankel matrix, and so 32 eigenvalues for eight true ones.
    assert found.z.size == 32


@pytest.mark.parametrize("method", [mrtd_real, mmrtd_real])
def test_every_order_asked_for_is_realized(method):
    markov = data(0.05)
    found = method(markov, 6, orders=(2, 4, 8), **SIZE)
    assert found.orders == (2, 4, 6, 8)
    assert_same_system(found.at(4), method(markov, 4, **SIZE).system)


def test_real_modal_form_is_the_printed_one():
    # Juang (1992), eq. (6.1): real shapes stand in every other column, up to the scale that L carries.
    real = mrtd(data(0.0), 8, **SIZE).real()
    printed = MODES4.C[:, ::2]
    ratio = real.C[:, ::2] / np.where(printed == 0, 1, printed)
    np.testing.assert_allclose(real.C[:, 1::2], 0, atol=1e-6 * np.abs(real.C).max())
    np.testing.assert_allclose(real.C[:, ::2], ratio[:1] * printed, atol=1e-6 * np.abs(real.C).max())
    np.testing.assert_allclose(real.A, MODES4.A, atol=1e-9)
    np.testing.assert_allclose(
        real.B[:, 0].reshape(4, 2) * ratio[0][:, None], MODES4.B.reshape(4, 2), atol=2e-5
    )
    Y = MODES4.markov(200).values
    np.testing.assert_allclose(real.markov(200).values, Y, atol=1e-10 * np.abs(Y).max())


@COMPLEX
def test_several_inputs_and_a_direct_term(method):
    model = systems.paper_chain3("coupled")
    markov = model.markov(100)
    found = method(markov, 6)
    np.testing.assert_allclose(found.markov(100).values, markov.values, atol=1e-12)
    np.testing.assert_allclose(found.real().markov(100).values, markov.values, atol=1e-12)
    assert found.markov(1).values.shape == (1, 2, 2)


@COMPLEX
def test_real_poles_have_blocks_of_one(method):
    model = systems.paper_chain3("coupled")
    slow = replace(
        model,
        A=scipy.linalg.block_diag(model.A, 0.8),
        B=np.vstack([model.B, [[0.1, 0.2]]]),
        C=np.hstack([model.C, [[0.3], [0.1]]]),
    )
    markov = slow.markov(100)
    found = method(markov, 7)
    assert np.sum(found.z.imag == 0) == 1
    np.testing.assert_allclose(found.real().markov(100).values, markov.values, atol=1e-11)
    assert len(found.modes()) == 3


def test_unknown_form_is_named():
    with pytest.raises(
        IdentificationError, match="form 'mrtd' is unknown; expected one of input_normal, balanced"
    ):
        change_of_form(np.ones(4), 4, "balanced", "mrtd")


@COMPLEX
def test_order_beyond_the_rank_is_refused(method):
    with pytest.raises(OrderError, match="numerical rank"):
        method(data(0.0), 9, **SIZE)
