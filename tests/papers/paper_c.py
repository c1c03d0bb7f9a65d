"""Cambraia and Kurka (2010), VI CONEM: what is printed, its algorithm as written, and the bound on any other."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import scipy.linalg
import scipy.signal

from identification.modes import Modes
from identification.recording import Channel
from lab.compare import compare
from lab.rig import Rig

MODEL = Path(__file__).parents[2] / "models" / "chain7.xml"
DT = 0.027
N_SAMPLES, ROWS, COLUMNS, ORDER, REFERENCE = 400, 190, 20, 6, 6
FORCE = 5.0

# Table 1, with the first frequency of Table 2 (2.1048 Hz is a misprint).
FREQUENCY = np.array([1.6636, 4.9182, 7.9577, 10.6495, 12.8759, 14.5395, 15.5677])
DAMPING = np.array([0.0052, 0.0155, 0.0250, 0.0335, 0.0405, 0.0457, 0.0489])
# Table 2: identified.
FOUND_FREQUENCY = np.array([1.6631, 4.9501, 7.8315])
FOUND_DAMPING = np.array([0.0144, 0.0132, 0.0124])


def chain(stiffness: float = 2500.0, damping: float = 2.5) -> Rig:
    """The seven masses with springs k [N/m] and dashpots c [N s/m], displacements recorded."""

    def edit(root: ET.Element) -> None:
        for element in root.iter():
            if element.get("stiffness") is not None:
                element.set("stiffness", repr(stiffness))
                element.set("damping", repr(damping))

    return Rig.load(MODEL).edited(edit).connected(inputs=["force1"], outputs=[f"pos{i}" for i in range(1, 8)])


def ambient_responses(n_runs: int, *, seed: int = 0) -> np.ndarray:
    """Displacements (n_runs, 7, 400) under white noise of 5 N on mass 1, from rest: eq. (43), each force held."""
    h = chain().state_space().sampled(DT).markov(N_SAMPLES).values[:, :, 0].T
    u = FORCE * np.random.default_rng(seed).standard_normal((n_runs, 1, N_SAMPLES))
    return scipy.signal.fftconvolve(u, h[None], axes=2)[:, :, :N_SAMPLES]


def subspace(y: np.ndarray, n_rows: int = ROWS, n_columns: int = COLUMNS, order: int = ORDER) -> Modes:
    """Modes by the paper's own steps, from outputs (n_outputs, n_samples) with the last one as reference.

    Eq. (30) fills Y_r with the reference and Y_s with all outputs, i samples later; (29) T = Y_s Y_rᵀ; (36) its leading
    left singular vectors Q; (37) Γ = Q; (35) A = Γ₁⁺ Γ₂.
    """
    n_outputs = len(y)
    windows = np.lib.stride_tricks.sliding_window_view(
        y, n_columns, axis=1
    )  # (n_outputs, n_starts, n_columns)
    Y_r = windows[REFERENCE, :n_rows] / np.sqrt(n_columns)
    Y_s = windows[:, n_rows : 2 * n_rows].transpose(1, 0, 2).reshape(-1, n_columns) / np.sqrt(n_columns)
    # T has the rank of its few columns: with Y_s = Q R its singular vectors are Q times those of R Y_rᵀ.
    Q, R = scipy.linalg.qr(Y_s, mode="economic")
    Gamma = (Q @ scipy.linalg.svd(R @ Y_r.T, full_matrices=False)[0])[:, :order]
    A = np.linalg.lstsq(Gamma[:-n_outputs], Gamma[n_outputs:], rcond=None)[0]
    z, vectors = np.linalg.eig(A)
    poles = np.log(z.astype(complex)) / DT
    own = (z.imag > 0) & (np.abs(z) > 0)
    channels = tuple(Channel(f"pos{i + 1}", "m", f"x{i + 1}") for i in range(n_outputs))
    return Modes.from_poles(poles[own], (Gamma[:n_outputs] @ vectors)[:, own], channels)


@dataclass(frozen=True)
class Scatter:
    """Signed relative errors of frequency and damping of the first three modes, (n_runs, 3); nan where not found."""

    frequency: np.ndarray
    damping: np.ndarray


def scatter(n_runs: int, *, seed: int = 0) -> Scatter:
    """What the algorithm makes of many records of 400 samples."""
    truth = chain().modes()
    errors = np.full((2, n_runs, 3), np.nan)
    for run, y in enumerate(ambient_responses(n_runs, seed=seed)):
        for pair in compare(truth, subspace(y)).pairs:
            if pair.truth < 3:
                errors[:, run, pair.truth] = pair.frequency_error, pair.damping_error
    return Scatter(errors[0], errors[1])


def autoregressive_bound(
    frequency_hz: np.ndarray, damping_ratio: np.ndarray, n_samples: int, dt: float
) -> tuple[np.ndarray, np.ndarray]:
    """Least relative standard deviations of frequency and damping from outputs under one unknown white force.

    Without noise of the sensors, the ratios of seven outputs give all numerators exactly. The common denominator is left:
    the outputs are an autoregressive process in it, whose information on a parameter θ of its roots z is, by Whittle,
    N Σ_pq ∂z_p ∂z̄_q / (1 - z_p z̄_q), the spectrum's information N/2 ∫ (∂ ln S)² df dt done by residues.

    Args:
        frequency_hz: undamped, shape (n_modes,).
        damping_ratio: shape (n_modes,).
        n_samples: of the record.
        dt: sample time [s].

    Source: Whittle (1953), Ark. Mat. 2, 423-434; for poles, Friedlander (1984), IEEE Trans. Autom. Control 29.
    """
    omega, root = 2 * np.pi * frequency_hz, np.sqrt(1 - damping_ratio**2)
    pole = omega * (-damping_ratio + 1j * root)
    z = np.exp(pole * dt)
    by_frequency = dt * z * pole  # per relative change
    by_damping = dt * z * omega * (-1 - 1j * damping_ratio / root) * damping_ratio
    n = len(z)
    slope = np.zeros((2 * n, 2 * n), dtype=complex)  # (n_parameters, n_roots)
    slope[:n, :n], slope[n:, :n] = np.diag(by_frequency), np.diag(by_damping)
    slope[:, n:] = slope[:, :n].conj()
    roots = np.concatenate([z, z.conj()])
    information = n_samples * np.real(slope @ (1 / (1 - np.outer(roots, roots.conj()))) @ slope.conj().T)
    std = np.sqrt(np.diag(np.linalg.inv(information)))
    return std[:n], std[n:]
