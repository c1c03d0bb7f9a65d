"""Cambraia and Kurka (2010): Tables 1 and 2, the bound that they did not have, and the constants as printed."""

import numpy as np
import pytest
import scipy.linalg

import lab
from lab.excitation import Ambient
from tests.papers import paper_c
from tests.papers.paper_c import DAMPING, DT, FOUND_DAMPING, FOUND_FREQUENCY, FREQUENCY

HALF = 0.5e-4
"""Half a unit of the fourth decimal, in which the paper prints."""
THREE = slice(0, 3)


@pytest.fixture(scope="module")
def bound():
    truth = paper_c.chain().modes()
    return paper_c.autoregressive_bound(truth.frequency_hz, truth.damping_ratio, paper_c.N_SAMPLES, DT)


@pytest.fixture(scope="module")
def scatter():
    return paper_c.scatter(200)


def test_printed_constants_cannot_give_the_printed_modes():
    wrong, right = paper_c.chain(2000.0, 5.0).modes(), paper_c.chain(2500.0, 2.5).modes()
    np.testing.assert_allclose(right.frequency_hz, FREQUENCY, rtol=0, atol=HALF)
    np.testing.assert_allclose(right.damping_ratio, DAMPING, rtol=0, atol=HALF)
    # ω = √(k s) and ζ = c √(s / k) / 2 with the same eigenvalues s of the chain.
    np.testing.assert_allclose(wrong.frequency_hz / right.frequency_hz, np.sqrt(0.8), rtol=1e-12)
    np.testing.assert_allclose(wrong.damping_ratio / right.damping_ratio, 2 / np.sqrt(0.8), rtol=1e-12)
    # A tenth in frequency, a factor of two in damping: no rounding of the print.
    assert np.all(np.abs(wrong.frequency_hz - FREQUENCY) > 1000 * HALF)
    assert np.all(wrong.damping_ratio > 2 * DAMPING)


def test_printed_table_leads_to_the_constants():
    """Both constants by least squares from the printed frequencies and damping ratios."""
    shape = 2 * np.eye(7) - np.eye(7, k=1) - np.eye(7, k=-1)
    shape[-1, -1] = 1
    s = scipy.linalg.eigvalsh(shape)
    omega = 2 * np.pi * FREQUENCY
    k = (omega**2 @ s) / (s @ s)
    c = (2 * DAMPING * omega) @ s / (s @ s)
    # Half a unit of the last digit printed: 1e-5 of a frequency, 1e-3 to 1e-2 of a damping ratio, averaged over seven.
    assert k == pytest.approx(1.25 * 2000, rel=3e-5)
    assert c == pytest.approx(0.5 * 5, rel=2e-3)


def test_algorithm_of_the_paper_is_exact_without_noise():
    """Free decay of the chain: the data have rank 14, and the Hankel matrix 20 columns."""
    truth = paper_c.chain()
    system = truth.state_space().sampled(DT)
    y = system.simulate(np.eye(1, paper_c.N_SAMPLES))[:, 1:]
    modes = paper_c.subspace(y, order=14, n_rows=100)
    # T squares the data, which leaves half of 16 digits, less what the weakest mode at the reference costs.
    np.testing.assert_allclose(modes.frequency_hz, truth.modes().frequency_hz, rtol=1e-5)
    np.testing.assert_allclose(modes.damping_ratio, truth.modes().damping_ratio, rtol=1e-3)


def test_sizes_are_those_of_the_paper():
    assert 2 * paper_c.ROWS + paper_c.COLUMNS - 1 <= paper_c.N_SAMPLES
    assert len(paper_c.subspace(paper_c.ambient_responses(1)[0])) <= paper_c.ORDER // 2


def test_bound_equals_the_information_of_an_autoregression():
    """Twin: N R / σ² of the coefficients, with R the covariances of the process, and derivatives by differences."""
    f, zeta, n, dt = np.array([1.7, 4.9]), np.array([0.02, 0.05]), 400, 0.05

    def coefficients(theta):
        omega = 2 * np.pi * f * (1 + theta[:2])
        ratio = zeta * (1 + theta[2:])
        z = np.exp(dt * omega * (-ratio + 1j * np.sqrt(1 - ratio**2)))
        return np.real(np.poly(np.concatenate([z, z.conj()])))[1:]

    step = 1e-6
    J = np.stack([(coefficients(step * e) - coefficients(-step * e)) / (2 * step) for e in np.eye(4)], axis=1)
    # Companion form driven by unit noise: its covariance is R.
    A = np.vstack([-coefficients(np.zeros(4)), np.eye(4)[:3]])
    R = scipy.linalg.solve_discrete_lyapunov(A, np.outer(np.eye(4)[0], np.eye(4)[0]))
    expected = np.sqrt(np.diag(np.linalg.inv(n * J.T @ R @ J)))
    found = np.concatenate(paper_c.autoregressive_bound(f, zeta, n, dt))
    # Central differences over 1e-6 leave about 1e-9.
    np.testing.assert_allclose(found, expected, rtol=1e-6)


def test_bound_follows_the_law_for_light_damping(bound):
    """Au (2014), Mech. Syst. Signal Process. 48: √(ζ / 2πN) and 1 / √(2πζN) with N periods, for lone light modes."""
    periods, z = FREQUENCY * paper_c.N_SAMPLES * DT, DAMPING
    np.testing.assert_allclose(bound[0][0], np.sqrt(z / (2 * np.pi * periods))[0], rtol=0.01)
    np.testing.assert_allclose(bound[1][0], 1 / np.sqrt(2 * np.pi * z * periods)[0], rtol=0.01)


def test_table_2_is_one_draw_within_the_bound(bound):
    """The paper's damping errors look large, and are what 400 samples leave to any method."""
    frequency = FOUND_FREQUENCY / FREQUENCY[THREE] - 1
    damping = FOUND_DAMPING / DAMPING[THREE] - 1
    assert np.all(np.abs(frequency) < 3 * bound[0][THREE])
    assert np.all(np.abs(damping) < 3 * bound[1][THREE])
    # The first frequency, right to 0.03 %, was luck: the bound is 0.68 %.
    assert abs(frequency[0]) < 0.1 * bound[0][0]


@pytest.mark.slow
def test_algorithm_finds_three_modes_as_in_table_2(scatter, bound):
    assert np.all(np.mean(np.isfinite(scatter.frequency), axis=0) > [0.99, 0.99, 0.85])
    for errors, least, printed in (
        (scatter.frequency, bound[0], FOUND_FREQUENCY / FREQUENCY[THREE] - 1),
        (scatter.damping, bound[1], FOUND_DAMPING / DAMPING[THREE] - 1),
    ):
        size = np.sqrt(np.nanmean(errors**2, axis=0))
        # Twenty columns are few: above the bound, by less than a factor of five.
        assert np.all(size > least[THREE])
        assert np.all(size < 5 * least[THREE])
        # The printed errors are ordinary draws.
        assert np.all(np.abs(printed) < 2.5 * size)


def test_mujoco_and_the_convolution_of_the_paper_agree():
    """One white force through MuJoCo, found back from one output, gives the other outputs by eq. (43)."""
    rig = paper_c.chain()
    recording = lab.simulate(
        rig, Ambient(rms=5.0, dofs=("x1",)), sample_rate=1 / DT, duration=400 * DT, seed=3, accuracy=1e-9
    )
    y = recording.records[0].outputs[:, :]
    system = rig.state_space().sampled(DT)
    h = system.markov(400).values[:, :, 0].T  # (7, 400)
    # The force from output 1, whose response begins with CB, then the other six outputs from that force.
    lower = scipy.linalg.toeplitz(h[0, 1:], np.zeros(399))
    u = scipy.linalg.solve_triangular(lower, y[0, 1:], lower=True)
    predicted = np.stack([np.convolve(row[1:], u)[:399] for row in h])
    # 1e-9 of the response, times the condition of the deconvolution.
    np.testing.assert_allclose(predicted, y[:, 1:], rtol=0, atol=1e-6 * np.max(np.abs(y)))
    assert np.std(u) == pytest.approx(5.0, rel=0.1)
