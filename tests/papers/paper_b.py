"""S.-Z. Juang (1992), thesis: what is printed, the close modes of section 6.1 and the flexible truss of section 6.2."""

from __future__ import annotations

import sys
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np
import scipy.linalg
import scipy.signal

import lab
from identification.era import era
from identification.modes import Modes, mac
from identification.pulse import markov_parameters
from identification.recording import Channel
from identification.systems import MarkovParameters, Realization, StateSpace
from lab.excitation import FreeDecay
from lab.rig import Rig

MODELS = Path(__file__).parents[2] / "models"
sys.path.append(str(MODELS))
import generate_flexible_truss  # noqa: E402
import generate_modes4  # noqa: E402

RATE, ROWS, COLUMNS = 128.0, 128, 32
CORRECTED = (0.0499, 0.0022, 0.0022, 0.0025)
"""Table 2's damping column upside down, which the printed singular values ask for."""
AS_PRINTED = (0.0025, 0.0022, 0.0022, 0.0499)

# The diagonals of T_io, T_ib and T_ob.
SIGMA = np.array([1606.942, 1604.974, 170.622, 152.718, 147.630, 74.688, 0.044, 0.039])
ROOT_SIGMA = np.array([40.086, 40.062, 13.062, 12.357, 12.150, 8.642, 0.210, 0.199])
INVERSE_ROOT = np.array([0.024, 0.024, 0.076, 0.080, 0.082, 0.115, 4.747, 5.014])
# Eq. (6.4) to (6.6): the input matrices, whose signs depend on those of the singular vectors.
INPUT_MATRICES = {
    "input_normal": np.array([0.240, -0.097, -0.220, -0.107, -0.103, 0.326, 0.188, -0.259]),
    "output_normal": np.array([386.144, -156.163, -37.671, -16.403, -15.349, 24.397, 0.008, -0.010]),
    "balanced": np.array([9.632, -3.898, -2.884, -1.327, -1.263, 2.823, 0.039, 0.051]),
}
# Table 3: with noise.
NOISY_FREQUENCY = np.array([0.990, 9.030, 20.000])
NOISY_DAMPING = np.array([0.099, 0.002, 0.002])

# Tables 4 and 5: frequencies in cases 1, 2 (96 values kept), 6 and 7 (36 kept); nan where not identified.
CASES = {"case 1": (128.0, 96), "case 2": (64.0, 96), "case 6": (128.0, 36), "case 7": (64.0, 36)}
PRINTED = {
    case: np.array(row.split(), dtype=float)
    for case, row in {
        "case 1": "nan 3.01 3.51 4.65 4.96 7.42 nan 10.19 11.82 12.11 "
        "nan 13.30 13.52 16.03 nan 22.28 25.28 25.96 38.21 38.69",
        "case 2": "0.91 2.79 3.51 4.66 5.02 7.42 9.75 10.19 11.05 12.13 "
        "12.6 13.30 13.49 16.04 16.58 22.27 25.37 25.79 nan nan",
        "case 6": "nan nan 3.51 4.64 4.85 7.43 nan 10.18 10.48 12.12 "
        "nan 13.24 13.33 16.04 nan 22.26 25.35 nan 38.21 38.62",
        "case 7": "0.85 nan 3.51 4.65 5.01 7.42 9.79 10.19 11.06 12.14 "
        "nan 13.30 13.48 16.04 nan 22.28 25.31 25.78 nan nan",
    }.items()
}
TRUSS_INPUTS = ["force_y28", "force_z15", "force_y17"]
TRUSS_OUTPUTS = [f"acc{node}.{axis}" for node in (11, 12, 29, 30) for axis in "yz"]
TRUSS_ROWS, TRUSS_COLUMNS, CORNER = 129, 33, 40.0


def thesis_markov(n_lags: int, damping: tuple[float, ...] = CORRECTED) -> np.ndarray:
    """Y(k) of eq. (6.3), shape (n_lags, 4), written out: Ψ_r Λ_rᵏ L_r with the real blocks of appendix C."""
    omega_d, zeta = 2 * np.pi * np.array(generate_modes4.DAMPED_FREQUENCIES), np.array(damping)
    z = np.exp((-zeta / np.sqrt(1 - zeta**2) + 1j) * omega_d / RATE)
    phase = np.add(generate_modes4.SHAPE_PHASES, generate_modes4.PARTICIPATION_PHASES)
    blocks = scipy.linalg.block_diag(*(np.array([[v.real, -v.imag], [v.imag, v.real]]) for v in z))
    state = 2 * np.repeat(generate_modes4.MODULI, 2)
    state[::2] *= np.cos(phase)
    state[1::2] *= np.sin(phase)
    shapes = np.zeros((4, 8))
    shapes[:, ::2] = generate_modes4.SHAPES
    values = np.empty((n_lags, 4))
    for k in range(n_lags):
        values[k] = shapes @ state
        state = blocks @ state
    return values


def as_markov(values: np.ndarray) -> MarkovParameters:
    """Y(0), Y(1), … as the responses from lag 1 on."""
    channels = tuple(Channel(f"y{i + 1}", "m") for i in range(values.shape[1]))
    padded = np.concatenate([np.zeros((1, values.shape[1])), values])[:, :, None]
    return MarkovParameters(padded, 1 / RATE, (Channel("release1", "1"),), channels)


def close_modes(n_lags: int = ROWS + COLUMNS) -> MarkovParameters:
    """The same from MuJoCo: modes4 released as the thesis' participation has it."""
    rig = Rig.load(MODELS / "modes4.xml").connected(outputs=[f"y{i}" for i in range(1, 5)])
    displacement, velocity = generate_modes4.release()
    drive = FreeDecay(displacement=displacement, velocity=velocity)
    recording = lab.simulate(rig, drive, sample_rate=RATE, duration=n_lags / RATE, accuracy=1e-12)
    return markov_parameters(recording)


def close_modes_realized(form: str = "balanced") -> Realization:
    """ERA of the thesis' own Hankel matrix, 512 x 32, without noise."""
    return era(as_markov(thesis_markov(ROWS + COLUMNS)), 8, form=form, n_rows=ROWS, n_columns=COLUMNS)


def with_noise(seed: int) -> MarkovParameters:
    """Eq. (6.7): Gaussian noise with 5 % of the standard deviation of each output."""
    values = thesis_markov(ROWS + COLUMNS)
    rng = np.random.default_rng(seed)
    return as_markov(values + 0.05 * np.std(values, axis=0) * rng.standard_normal(values.shape))


def noisy_modes(seed: int) -> tuple[np.ndarray, np.ndarray]:
    """Frequency and damping nearest to 1, 9 and 20 Hz at order 8 with noise, each (3,)."""
    modes = era(with_noise(seed), 8, n_rows=ROWS, n_columns=COLUMNS).system.modes()
    pick = [int(np.argmin(np.abs(modes.frequency_hz - f))) for f in (1.0, 9.0, 20.0)]
    return modes.frequency_hz[pick], modes.damping_ratio[pick]


@cache
def truss() -> Rig:
    rig = Rig.load(MODELS / "flexible_truss.xml")
    return rig.connected(inputs=TRUSS_INPUTS, outputs=TRUSS_OUTPUTS)


def filtered(system: StateSpace) -> StateSpace:
    """The continuous model with every output behind an eighth-order Butterworth low-pass at 40 Hz."""
    zeros, poles, gain = scipy.signal.butter(8, 2 * np.pi * CORNER, analog=True, output="zpk")
    a, b, c, _ = scipy.signal.zpk2ss(zeros, poles, gain)
    n_outputs = len(system.outputs)
    a, b, c = (np.kron(np.eye(n_outputs), matrix) for matrix in (a, b, c))
    A = np.block([[system.A, np.zeros((system.n_states, len(a)))], [b @ system.C, a]])
    B, C = np.vstack([system.B, b @ system.D]), np.hstack([np.zeros((n_outputs, system.n_states)), c])
    return StateSpace(A, B, C, np.zeros((n_outputs, B.shape[1])), 0.0, system.inputs, system.outputs)


@cache
def truss_responses(rate: float) -> MarkovParameters:
    """Exact responses to a pulse of 100 N on each of three places: free decays from the second sample on."""
    system = filtered(truss().state_space()).sampled(1 / rate)
    markov = system.markov(TRUSS_ROWS + TRUSS_COLUMNS + 1)
    return MarkovParameters(100 * markov.values, markov.dt, markov.inputs, markov.outputs)


def truss_case(case: str, *, noise: float = 0.01, seed: int = 1) -> Modes:
    """Modes of one case: 1032 x 99 Hankel matrix, 96 or 36 singular values kept, white noise of 1 % of the RMS."""
    rate, order = CASES[case]
    clean = truss_responses(rate)
    rms = np.sqrt(np.mean(clean.values**2, axis=0))
    values = clean.values + noise * rms * np.random.default_rng(seed).standard_normal(clean.values.shape)
    markov = MarkovParameters(values, clean.dt, clean.inputs, clean.outputs)
    return era(markov, order, n_rows=TRUSS_ROWS, n_columns=TRUSS_COLUMNS).system.modes()


@dataclass(frozen=True)
class Found:
    """The identified mode nearest to each true one, nan where none counts, shape (20,)."""

    frequency: np.ndarray
    damping: np.ndarray


def found_modes(modes: Modes, *, band: float = 0.01, least_mac: float = 0.9) -> Found:
    """Which of the 20 modes are found: within 1 % of the frequency, MAC above 0.9, damping below 5 %."""
    truth = truss().modes().take(np.arange(20))
    agreement = mac(truth.shapes, modes.shapes)
    apart = np.abs(modes.frequency_hz / truth.frequency_hz[:, None] - 1)
    good = (apart < band) & (agreement > least_mac) & (modes.damping_ratio > 0) & (modes.damping_ratio < 0.05)
    cost = np.where(good, apart, np.inf)
    best, some = np.argmin(cost, axis=1), np.any(good, axis=1)
    pick = [np.where(some, values[best], np.nan) for values in (modes.frequency_hz, modes.damping_ratio)]
    return Found(pick[0], pick[1])


def printed_frequencies() -> np.ndarray:
    """The 20 frequencies that the generator of the truss aims at."""
    return generate_flexible_truss.FREQUENCIES
