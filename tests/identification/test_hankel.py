"""Block Hankel matrices, nested models and the choice of order."""

import numpy as np
import pytest
import scipy.linalg
from hypothesis import given
from hypothesis import strategies as st

from identification.errors import OrderError, TooShortError
from identification.hankel import block_hankel, choose_order, shift_invariance
from tests import systems


@given(st.integers(1, 4), st.integers(1, 4), st.integers(1, 3), st.integers(1, 3), st.integers(0, 2))
def test_blocks_stand_where_their_lag_says(n_rows, n_columns, n_outputs, n_inputs, first):
    n_lags = first + n_rows + n_columns - 1
    values = np.arange(n_lags * n_outputs * n_inputs, dtype=float).reshape(n_lags, n_outputs, n_inputs)
    H = block_hankel(values, n_rows, n_columns, first=first)
    plain = np.block([[values[first + i + j] for j in range(n_columns)] for i in range(n_rows)])
    np.testing.assert_array_equal(H, plain)


def test_too_few_lags_are_counted():
    with pytest.raises(TooShortError, match="needs 10 lags and 9 were given"):
        block_hankel(np.zeros((9, 1, 1)), 5, 5, first=1)


def subspace(model, n_rows):
    Y = model.markov(2 * n_rows).values
    return scipy.linalg.svd(block_hankel(Y, n_rows, n_rows, first=1))


@pytest.mark.parametrize(
    "model", [systems.paper_chain3("coupled"), systems.paper_truss()], ids=["chain3", "truss"]
)
def test_true_order_gives_the_true_model(model):
    n = model.n_states
    U, S, _ = subspace(model, 40)
    [(A, C)] = shift_invariance(U[:, :n], S[:n], n_outputs=len(model.outputs), orders=[n])
    z = np.sort_complex(scipy.linalg.eigvals(A))
    # The smallest singular value is a tenth of the largest here, so rounding grows tenfold or so.
    np.testing.assert_allclose(z, np.sort_complex(scipy.linalg.eigvals(model.A)), atol=1e-13)
    # C and A together reproduce the subspace.
    O = np.vstack([C @ np.linalg.matrix_power(A, k) for k in range(40)])  # noqa: E741
    np.testing.assert_allclose(O, U[:, :n] * np.sqrt(S[:n]), atol=1e-12 * np.sqrt(S[0]))


@given(st.integers(0, 1000), st.integers(2, 9))
def test_nested_models_equal_one_least_squares_problem_per_order(seed, n_max):
    rng = np.random.default_rng(seed)
    U = np.linalg.qr(rng.standard_normal((24, n_max)))[0]
    S = np.sort(rng.uniform(0.5, 2, n_max))[::-1]
    orders = range(1, n_max + 1)
    for n, (A, C) in zip(orders, shift_invariance(U, S, n_outputs=3, orders=orders), strict=True):
        O_n = U[:, :n] * np.sqrt(S[:n])
        expected = np.linalg.lstsq(O_n[:-3], O_n[3:], rcond=None)[0]
        # Both solve the same problem; they differ by rounding times its condition, small for random columns.
        np.testing.assert_allclose(A, expected, atol=1e-10 * max(1, np.abs(expected).max()))
        np.testing.assert_array_equal(C, O_n[:3])


def test_zero_singular_values_still_give_a_finite_model():
    U = np.linalg.qr(np.random.default_rng(0).standard_normal((12, 4)))[0]
    [(A, C)] = shift_invariance(U, np.array([1.0, 0.5, 0.0, 0.0]), n_outputs=2, orders=[4])
    assert np.all(np.isfinite(A))
    assert np.all(np.isfinite(C))


def test_an_order_beyond_the_rows_is_refused():
    U = np.eye(6, 5)
    with pytest.raises(OrderError, match="order 5 exceeds the 4"):
        shift_invariance(U, np.ones(5), n_outputs=2, orders=[5])


def test_a_state_only_in_the_last_row_is_refused():
    with pytest.raises(OrderError, match="last block row"):
        shift_invariance(np.eye(6)[:, [0, 5]], np.ones(2), n_outputs=2, orders=[2])


@pytest.mark.parametrize(
    ("model", "order"),
    [(systems.paper_chain3(), 6), (systems.paper_truss(), 16), (systems.modes4(), 8)],
    ids=["chain3", "truss", "modes4"],
)
def test_order_of_calculated_data_is_exact(model, order):
    P, S, Qt = subspace(model, 60)
    chosen, reason = choose_order(P, S, Qt.T, n_outputs=len(model.outputs), n_inputs=len(model.inputs))
    assert chosen == order
    assert f"Order {order} is where the singular values fall" in reason


@pytest.mark.parametrize("level", [0.01, 0.05, 0.2])
@pytest.mark.parametrize(
    ("model", "n_lags"),
    [(systems.paper_chain3("coupled"), 400), (systems.paper_truss(), 300)],
    ids=["chain3", "truss"],
)
def test_order_of_noisy_data_is_where_the_noise_begins(model, n_lags, level):
    rng = np.random.default_rng(8)
    Y = model.markov(n_lags).values
    noisy = np.moveaxis(systems.noisy(np.moveaxis(Y, 0, -1), level, rng), -1, 0)
    n_rows = n_lags // 2
    P, S, Qt = scipy.linalg.svd(block_hankel(noisy, n_rows, n_rows - 1, first=1), full_matrices=False)
    chosen, reason = choose_order(P, S, Qt.T, n_outputs=len(model.outputs), n_inputs=len(model.inputs))
    assert chosen == model.n_states
    assert "edge of the noise" in reason


def test_pure_noise_is_called_so():
    E = block_hankel(np.random.default_rng(1).standard_normal((200, 2, 2)), 100, 100)
    P, S, Qt = scipy.linalg.svd(E)
    order, reason = choose_order(P, S, Qt.T, n_outputs=2, n_inputs=2)
    assert order == 2
    assert "no singular value stands above the noise" in reason


def test_silence_has_no_order():
    with pytest.raises(OrderError, match="no response"):
        choose_order(np.eye(4), np.zeros(4), np.eye(4), n_outputs=1, n_inputs=1)
