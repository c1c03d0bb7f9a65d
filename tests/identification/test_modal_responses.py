"""Responses and their derivatives, against a plain loop with derivatives of the matrix exponential."""

import numpy as np
import pytest
import scipy.linalg
from hypothesis import given, settings
from hypothesis import strategies as st

from identification import cascade, modal_responses, modal_signals
from identification.modal_signals import Run, spectrum
from identification.parameterizations import Tangent
from identification.recording import Channel
from identification.systems import StateSpace

DT = 0.05


def channels(n, prefix):
    return tuple(Channel(f"{prefix}{i}", "N" if prefix == "u" else "m/s^2") for i in range(n))


def system_of(A, n_inputs, n_outputs, rng, dt=0.0):
    n = len(A)
    B, C, D = (
        rng.standard_normal((n, n_inputs)),
        rng.standard_normal((n_outputs, n)),
        np.ones((n_outputs, n_inputs)),
    )
    return StateSpace(A, B, C, D, dt, channels(n_inputs, "u"), channels(n_outputs, "y"))


def tangent_of(system, n_parameters, rng):
    """A system whose every entry moves with every parameter."""
    slopes = (rng.standard_normal((n_parameters, *getattr(system, name).shape)) for name in "ABCD")
    return Tangent(system, *slopes)


def run_of(system, n_samples, rng):
    u = rng.standard_normal((len(system.inputs), n_samples))
    y = rng.standard_normal((len(system.outputs), n_samples))
    return Run(u, np.arange(len(u)), y, DT)


def sampled(A, B, dt):
    n, m = B.shape
    block = scipy.linalg.expm(np.block([[A, B], [np.zeros((m, n + m))]]) * dt)
    return block[:n, :n], block[:n, n:]


def plain_loop(tangent, run, initial):
    """Outputs, and their derivatives (n_unknowns, n_outputs, n_samples), sample by sample."""
    s = tangent.system
    n, m, p = s.n_states, len(s.inputs), len(tangent.A_theta)
    A, B = (s.A, s.B) if s.dt else sampled(s.A, s.B, DT)
    dA, dB = tangent.A_theta, tangent.B_theta
    if not s.dt:
        moved = [
            scipy.linalg.expm_frechet(
                np.block([[s.A, s.B], [np.zeros((m, n + m))]]) * DT,
                np.block([[da, db], [np.zeros((m, n + m))]]) * DT,
                compute_expm=False,
            )[:n]
            for da, db in zip(dA, dB, strict=True)
        ]
        dA, dB = (np.array([x[:, :n] for x in moved]), np.array([x[:, n:] for x in moved]))
    extra = 0 if initial is None else n
    x = np.zeros(n) if initial is None else initial
    dx = np.concatenate([np.zeros((p, n)), np.eye(n)[:extra]])
    y, J = [], []
    for u in run.inputs.T:
        y.append(s.C @ x + s.D @ u)
        row = dx @ s.C.T
        row[:p] += tangent.C_theta @ x + tangent.D_theta @ u
        J.append(row)
        forcing = np.zeros_like(dx)
        forcing[:p] = dA @ x + dB @ u
        dx = dx @ A.T + forcing
        x = A @ x + B @ u
    return np.array(y).T, np.moveaxis(np.array(J), 0, -1)


def expected_equations(tangent, run, initial, weights):
    y, J = plain_loop(tangent, run, initial)
    e = run.outputs - y
    if run.missing is not None:
        e, J = np.where(run.missing, 0, e), np.where(run.missing, 0, J)
    return np.einsum("o,pok,ok->p", weights, J, e), np.einsum("o,pok,qok->pq", weights, J, J)


def with_gaps(run, rng):
    """The run without some samples, and without a stretch of the first output."""
    missing = rng.random(run.outputs.shape) < 0.1
    missing[0, 20:70] = True
    return run._replace(outputs=np.where(missing, 0, run.outputs), missing=missing)


def assert_close(found, expected, rtol):
    np.testing.assert_allclose(found, expected, rtol=0, atol=rtol * np.abs(expected).max())


def oscillators(*poles):
    """A with these complex pairs and real poles, in coordinates that mix them."""
    blocks = [[[p.real, p.imag], [-p.imag, p.real]] if isinstance(p, complex) else [[p]] for p in poles]
    A = scipy.linalg.block_diag(*blocks)
    Q = np.linalg.qr(np.random.default_rng(len(A)).standard_normal(A.shape))[0]
    return Q @ A @ Q.T


CASES = {
    "apart": (-0.3 + 3j, -0.1 + 8j),
    "overdamped": (-0.3 + 3j, -2.0, -0.5),
    "coincident": (-0.2 + 3j, -0.2 + 3j),
    "nearly coincident": (-0.2 + 3j, -0.2 + 3.00001j),
    "close": (-0.2 + 3j, -0.2 + 3.01j),
    "close and real": (-0.2, -0.2001, -0.3 + 3j),
    "nearly critical": (-1 + 0.02j, -0.2 + 3.01j),
    "undamped": (3j, 7j),
    "slow": (-1e-3 + 0.01j, -0.1 + 8j),
}


@pytest.mark.parametrize("equations", [modal_responses, cascade])
def test_missing_samples_count_for_nothing(equations):
    rng = np.random.default_rng(6)
    tangent = tangent_of(system_of(oscillators(*CASES["apart"]), 2, 3, rng), 4, rng)
    run = with_gaps(run_of(tangent.system, 3000, rng), rng)  # several blocks of the cascade
    x0, weights = rng.standard_normal(4), np.array([1.0, 2.0, 0.5])
    spectra = (spectrum(tangent.system),) if equations is modal_responses else ()
    found = equations.normal_equations(tangent, *spectra, run, x0, weights)
    for ours, twin in zip(found, expected_equations(tangent, run, x0, weights), strict=True):
        assert_close(ours, twin, 1e-10)  # as without gaps, with a longer sum


@pytest.mark.parametrize("initial", [False, True], ids=["rest", "released"])
@pytest.mark.parametrize("case", CASES)
def test_fast_equations_equal_the_plain_loop(case, initial):
    rng = np.random.default_rng(1)
    tangent = tangent_of(system_of(oscillators(*CASES[case]), 2, 3, rng), 4, rng)
    run = run_of(tangent.system, 200, rng)
    x0 = rng.standard_normal(tangent.system.n_states) if initial else None
    weights = np.array([1.0, 2.0, 0.5])
    y, _ = plain_loop(tangent, run, x0)
    modes = spectrum(tangent.system)
    assert modes is not None
    # Sums over modes lose no digits when eigenvectors are well conditioned.
    assert_close(modal_responses.simulate(tangent.system, modes, run, x0), y, 1e-12)
    found = modal_responses.normal_equations(tangent, modes, run, x0, weights)
    # Dividing by a distance of a hundredth costs two digits, and four when squared.
    for ours, twin in zip(found, expected_equations(tangent, run, x0, weights), strict=True):
        assert_close(ours, twin, 1e-11)


@pytest.mark.parametrize("initial", [False, True], ids=["rest", "released"])
def test_sampled_models_too(initial):
    rng = np.random.default_rng(2)
    A = scipy.linalg.block_diag(oscillators(-0.3 + 3j, -0.1 + 8j), 0.0)
    A[:4, :4] = scipy.linalg.expm(A[:4, :4] * DT)
    tangent = tangent_of(
        system_of(A, 2, 2, rng, dt=DT), 3, rng
    )  # a pole at z = 0 among the others: a pure delay
    run = run_of(tangent.system, 200, rng)
    x0 = rng.standard_normal(5) if initial else None
    y, _ = plain_loop(tangent, run, x0)
    modes = spectrum(tangent.system)
    assert_close(modal_responses.simulate(tangent.system, modes, run, x0), y, 1e-12)
    found = modal_responses.normal_equations(tangent, modes, run, x0, np.ones(2))
    for ours, twin in zip(found, expected_equations(tangent, run, x0, np.ones(2)), strict=True):
        assert_close(ours, twin, 1e-11)


@given(seed=st.integers(0, 10_000), n=st.integers(1, 6))
@settings(max_examples=25)
def test_any_stable_system(seed, n):
    rng = np.random.default_rng(seed)
    A = rng.standard_normal((n, n)) * 3
    A -= (np.max(np.linalg.eigvals(A).real) + 0.1) * np.eye(n)
    tangent = tangent_of(system_of(A, 1, 2, rng), 2, rng)
    run = run_of(tangent.system, 60, rng)
    x0 = rng.standard_normal(n)
    expected = expected_equations(tangent, run, x0, np.ones(2))
    modes = spectrum(tangent.system)
    engines = [cascade.normal_equations(tangent, run, x0, np.ones(2))]
    if modes is not None:
        engines.append(modal_responses.normal_equations(tangent, modes, run, x0, np.ones(2)))
    for found in engines:
        for ours, twin in zip(found, expected, strict=True):
            # Eigenvectors up to the condition number of 1e4 that is let through cost its square: 1e-16 x 1e8.
            assert_close(ours, twin, 1e-7)


def test_long_records_go_through_in_blocks(monkeypatch):
    rng = np.random.default_rng(3)
    tangent = tangent_of(system_of(oscillators(-0.3 + 3j, -1.0), 2, 2, rng), 3, rng)
    run, x0 = run_of(tangent.system, 100, rng), rng.standard_normal(3)
    modes = spectrum(tangent.system)

    def results():
        return (
            modal_responses.simulate(tangent.system, modes, run, x0),
            *modal_responses.normal_equations(tangent, modes, run, x0, np.ones(2)),
            *cascade.normal_equations(tangent, run, x0, np.ones(2)),
        )

    whole = results()
    monkeypatch.setattr(modal_signals, "BLOCK", 7)
    monkeypatch.setattr(cascade, "BLOCK", 7)
    for a, b in zip(results(), whole, strict=True):
        assert_close(a, b, 1e-12)  # the same sums in another order


def test_silent_inputs_may_be_left_out():
    rng = np.random.default_rng(4)
    tangent = tangent_of(system_of(oscillators(-0.3 + 3j), 3, 2, rng), 3, rng)
    full = run_of(tangent.system, 50, rng)
    full.inputs[1] = 0
    short = full._replace(inputs=full.inputs[[0, 2]], active=np.array([0, 2]))
    modes = spectrum(tangent.system)
    for a, b in zip(
        modal_responses.normal_equations(tangent, modes, full, None, np.ones(2)),
        modal_responses.normal_equations(tangent, modes, short, None, np.ones(2)),
        strict=True,
    ):
        assert_close(a, b, 1e-13)


@pytest.mark.parametrize("scale", [1.0, 1e3, 1e-3])
def test_defective_matrices_are_recognized(scale):
    rigid = np.array([[0.0, scale], [0.0, 0.0]])
    critical = np.array([[0.0, 1.0], [-(scale**2), -2 * scale]])
    light = np.array([[0.0, 1.0], [-(scale**2), -0.02 * scale]])
    rng = np.random.default_rng(0)
    assert spectrum(system_of(rigid, 1, 1, rng)) is None
    assert spectrum(system_of(critical, 1, 1, rng)) is None
    assert spectrum(system_of(light, 1, 1, rng)) is not None
