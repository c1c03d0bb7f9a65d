"""Eigensystem realization against known systems, the printed thesis and its own three forms."""

from dataclasses import replace

import numpy as np
import pytest
import scipy.linalg
from hypothesis import given, settings
from hypothesis import strategies as st

from identification.era import FORMS, era, era_dc
from identification.errors import IdentificationError, OrderError, TooShortError
from tests import systems

MODELS = {
    "chain3_uncoupled": systems.paper_chain3(),
    "chain3_coupled": systems.paper_chain3("coupled"),
    "truss": systems.paper_truss(),
}


def poles(system):
    return np.sort_complex(system.eigen()[0])


def noisy(markov, level, seed):
    Y = systems.noisy(np.moveaxis(markov.values, 0, -1), level, np.random.default_rng(seed))
    return replace(markov, values=np.moveaxis(Y, -1, 0))


@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize("name", MODELS)
def test_exact_data_give_back_the_system(name, form):
    model = MODELS[name]
    markov = model.markov(300)
    found = era(markov, form=form)
    assert found.order == model.n_states
    # Singular values span one decade, so rounding in the data grows by about ten; ln z divides it by dt.
    np.testing.assert_allclose(poles(found.system), poles(model), atol=1e-12 * np.abs(poles(model)).max())
    f = np.linspace(0.05, 0.45, 30) / model.dt
    H = model.frequency_response(f)
    np.testing.assert_allclose(found.system.frequency_response(f), H, atol=1e-12 * np.abs(H).max())


# --- Thesis B, 6.1
# -------------------------------------------------------------------------------------------


def thesis(markov, **options):
    return era(markov, n_rows=128, n_columns=32, **options)


def test_printed_singular_values_belong_to_the_damping_column_read_upwards():
    S = thesis(systems.modes4().markov(161), order=8).singular_values
    # Printed to 1e-3; Table 2 gives the damping to 1e-4, a few per cent of it, and the frequency to 1e-3 Hz.
    printed = [1606.942, 1604.974, 170.622, 152.718, 147.630, 74.688, 0.044, 0.039]
    np.testing.assert_allclose(S[:8], printed, rtol=2e-3, atol=1e-3)
    assert S[8] < 1e-12 * S[0]


def test_printed_damping_column_gives_other_singular_values():
    S = thesis(systems.modes4((0.0025, 0.0022, 0.0022, 0.0499)).markov(161), order=8).singular_values
    assert S[0] == pytest.approx(320, abs=1)


@pytest.mark.parametrize("level", [0.0, 0.05])
def test_three_forms_have_the_same_markov_parameters_over_640_lags(level):
    markov = noisy(systems.modes4().markov(161), level, 5)
    Y = [thesis(markov, order=8, form=form).system.markov(641).values for form in FORMS]
    size = np.abs(Y[0]).max()
    # Eleven digits of the largest, the thesis' claim: Σ spans 4e4, which the change of form multiplies
    # rounding by.
    np.testing.assert_allclose(Y[1], Y[0], atol=1e-11 * size)
    np.testing.assert_allclose(Y[2], Y[0], atol=1e-11 * size)


def test_grammians_of_the_finite_hankel_matrix_are_those_of_the_form():
    markov = MODELS["truss"].markov(100)
    for form, power in FORMS.items():
        found = era(markov, 16, form=form, n_rows=50, n_columns=49)
        A, B, C, S = found.system.A, found.system.B, found.system.C, found.singular_values[:16]
        V = np.vstack([C @ np.linalg.matrix_power(A, k) for k in range(50)])
        W = np.hstack([np.linalg.matrix_power(A, k) @ B for k in range(49)])
        # Juang (1992), eq. (3.11) and (3.16); fifty products of well-conditioned matrices.
        np.testing.assert_allclose(W @ W.T, np.diag(S ** (2 * power)), atol=1e-10)
        np.testing.assert_allclose(V.T @ V, np.diag(S ** (2 - 2 * power)), atol=1e-10)


# --- Orders
# --------------------------------------------------------------------------------------------------


def test_every_order_equals_the_realization_of_that_order_alone():
    markov = noisy(MODELS["chain3_coupled"].markov(200), 0.05, 1)
    many = era(markov, 6, orders=range(2, 13))
    assert many.orders == tuple(range(2, 13))
    for n in (2, 7, 12):
        alone = era(markov, n).system
        # The same numbers from products of other sizes.
        np.testing.assert_allclose(many.at(n).A, alone.A, atol=1e-13)
        np.testing.assert_allclose(many.at(n).C, alone.C, atol=1e-13)


@pytest.mark.parametrize("method", [era, era_dc])
def test_chosen_order_and_its_reason_at_five_per_cent_noise(method):
    found = method(noisy(MODELS["chain3_coupled"].markov(400), 0.05, 2))
    assert found.order == 6
    assert "edge of the noise" in found.notes[0]


def test_order_beyond_the_rank_is_refused():
    with pytest.raises(OrderError, match=r"order 8 is outside 1 to 6, the numerical rank of the"):
        era(MODELS["chain3_uncoupled"].markov(200), 8)


def test_too_few_lags_are_refused():
    markov = MODELS["chain3_uncoupled"].markov(20)
    with pytest.raises(TooShortError, match="together may be 19 at most"):
        era(markov, 6, n_rows=10, n_columns=10)
    with pytest.raises(TooShortError, match="lengthen the record"):
        era_dc(markov, 6, step=5)


def test_no_inputs_make_no_hankel_matrix():
    markov = MODELS["chain3_uncoupled"].markov(20)
    with pytest.raises(IdentificationError, match="2 outputs and 0 inputs make no Hankel matrix"):
        era(replace(markov, values=markov.values[:, :, :0], inputs=()))


def test_unknown_form_is_named():
    with pytest.raises(IdentificationError, match="input_normal, balanced, output_normal"):
        era(MODELS["chain3_uncoupled"].markov(50), 6, form="modal")


# --- Properties
# ----------------------------------------------------------------------------------------------


@settings(max_examples=15, deadline=None)
@given(st.permutations(range(5)), st.permutations(range(4)))
def test_modes_follow_a_permutation_of_channels(rows, columns):
    markov = MODELS["truss"].markov(61)
    permuted = replace(
        markov,
        values=markov.values[:, rows][:, :, columns],
        outputs=tuple(markov.outputs[i] for i in rows),
        inputs=tuple(markov.inputs[j] for j in columns),
    )
    a, b = era(markov).system, era(permuted).system
    np.testing.assert_allclose(poles(b), poles(a), atol=1e-11 * np.abs(poles(a)).max())
    np.testing.assert_allclose(
        b.frequency_response([1.0, 2.0]), a.frequency_response([1.0, 2.0])[:, rows][:, :, columns], atol=1e-12
    )


@settings(max_examples=15, deadline=None)
@given(st.lists(st.floats(1e-2, 1e2), min_size=4, max_size=4))
def test_units_scale_the_response_and_leave_the_poles(units):
    markov = MODELS["chain3_coupled"].markov(81)
    out, into = np.array(units[:2]), np.array(units[2:])
    scaled = replace(markov, values=markov.values * out[:, None] / into)
    a, b = era(markov, 6).system, era(scaled, 6).system
    # Scales that differ by 1e4 worsen the condition by as much.
    np.testing.assert_allclose(poles(b), poles(a), atol=1e-8)
    np.testing.assert_allclose(b.D, a.D * out[:, None] / into, rtol=1e-15)


# --- Data correlations
# ---------------------------------------------------------------------------------------


@pytest.mark.parametrize("first", [0, 30])
@pytest.mark.parametrize("name", MODELS)
def test_correlations_of_exact_data_give_back_the_system(name, first):
    model = MODELS[name]
    found = era_dc(model.markov(160), first=first, step=2, n_rows=12)
    assert found.order == model.n_states
    # The square of the condition of the data, 1e2 to 1e3, times rounding.
    np.testing.assert_allclose(poles(found.system), poles(model), atol=1e-11 * np.abs(poles(model)).max())
    Y = model.markov(160).values
    np.testing.assert_allclose(found.system.markov(160).values, Y, atol=1e-11 * np.abs(Y).max())


def test_correlations_nest_over_the_orders():
    markov = noisy(MODELS["chain3_coupled"].markov(120), 0.05, 4)
    many = era_dc(markov, 6, orders=range(2, 11), n_rows=10)
    alone = era_dc(markov, 4, n_rows=10)
    np.testing.assert_allclose(many.at(4).B, alone.system.B, atol=1e-12)
    np.testing.assert_allclose(poles(many.at(4)), poles(alone.system), atol=1e-11)


def test_noise_moves_the_poles_in_proportion():
    # Ten times less noise, ten times less error: first-order perturbation, so within a factor of two.
    model = MODELS["chain3_coupled"]
    errors = []
    for level in (1e-2, 1e-3):
        found = era(noisy(model.markov(400), level, 3), 6).system
        errors.append(scipy.linalg.norm(poles(found) - poles(model)))
    assert errors[0] / errors[1] == pytest.approx(10, rel=0.5)
