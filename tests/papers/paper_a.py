"""De Angelis, Luş, Betti and Longman (2002), J. Appl. Mech. 69: what is printed, and the experiments behind it."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

import lab
from identification.era import era
from identification.errors import IdentificationError
from identification.information import cramer_rao_bound
from identification.likelihood import refine
from identification.okid import okid_era
from identification.pulse import markov_parameters
from identification.recording import Channel, Recording
from identification.second_order import second_order
from identification.systems import SecondOrder, StateSpace
from lab.excitation import Pulse, Random
from lab.rig import Rig

MODELS = Path(__file__).parents[2] / "models"
DOFS = ("x1", "x2", "x3")
TRUSS_INPUTS = ["force_v1", "force_u2", "force_u3", "force_v4"]
TRUSS_OUTPUTS = ["acc1.x", "acc1.z", "acc2.z", "acc3.z", "acc4.x"]


def numbers(text: str) -> np.ndarray:
    return np.array([line.split() for line in text.strip().splitlines()], dtype=float)


# Tables 3 and 4: ten times Φ, C and Γᵀ.
IDENTIFIED = {
    "uncoupled": numbers("""
9.9520  0.0956 -0.6987  0.2243  0.0072  0.0178
-0.0761  9.8881 -0.5836 -0.6557  0.0264  0.0032
0.6886  0.5640  9.9450 -0.0075 -0.4241 -0.0190
-0.2833  0.7991  0.0135  9.8893  0.1779 -0.0022
0.1586 -0.0056  0.4669 -0.1255  9.6269  0.8757
0.0158 -0.0335 -0.0190  0.0679 -1.0219  9.9322
1.6132 -1.2168  0.4631 -1.1516  0.1377 -0.0220
1.4748  0.6048  1.8841  0.2602  0.2798 -0.0377
0.4917  0.0904  0.2763  0.0800 -2.5024 -0.4362
-0.4112  1.2005  0.2179 -1.2017  0.1888  0.3338"""),
    "coupled": numbers("""
9.9461  0.3794 -0.5714  0.1773  0.0032  0.0157
-0.3310  9.8771 -0.5938 -0.6294  0.1211  0.0084
0.5782  0.4676  9.8825 -0.2419 -0.3919 -0.0220
-0.2784  0.8119  0.3483  9.8572  0.0833 -0.0785
0.1925 -0.1088  0.5346  0.0501  9.5282  0.9199
0.0117 -0.0764 -0.0880  0.1883 -0.9465  9.9287
1.5236 -1.2545  0.2148 -0.8687  0.0960 -0.0348
1.3362  0.0325  1.5306  0.2360  0.2277 -0.0230
0.5234  0.0030  0.6595  0.3176 -2.8212  0.0959
-0.5469  1.2525  1.0654 -1.3654  0.2666  0.6835"""),
}
# Sections 5.1 and 5.2, modes in columns; the last entry of the coupled ψ3 is printed 0.139 + j 0.0093.
PSI = {
    "uncoupled": np.array([[-0.159, 0.109, 0.334], [-0.276, -0.135, -0.031], [-0.185, 0.274, -0.114]])
    * (1 + 1j),
    "coupled": np.array(
        [
            [0.166 + 0.154j, 0.127 + 0.088j, -0.327 - 0.345j],
            [0.266 + 0.284j, -0.161 - 0.120j, 0.018 + 0.045j],
            [0.207 + 0.171j, 0.251 + 0.296j, 0.139 + 0.093j],
        ]
    ),
}
# The diagonal of 𝒯, one of each conjugate pair.
SCALING = {
    "uncoupled": np.array([2.966 - 2.322j, 8.996 - 8.164j, 6.449 - 4.789j]),
    "coupled": np.array([0.256 + 4.218j, 0.479 - 16.492j, 9.980 - 0.754j]),
}
# Tables 6 and 7 [%]: M, C, K in rows 1 to 3, 4 to 6, 7 to 9; nan where there is a dash.
TABLE_6 = numbers("""
0.36 nan nan
nan 0.08 nan
nan nan 0.30
0.15 1.03 0.48
1.03 0.29 0.29
0.48 0.29 0.04
0.39 0.18 0.50
0.18 0.06 0.36
0.50 0.36 0.15""").reshape(3, 3, 3)
TABLE_7 = numbers("""
6.11 nan nan
nan 0.65 nan
nan nan 3.29
23.05 8.97 5.29
8.97 2.96 3.90
5.29 3.90 14.36
5.67 6.26 4.57
6.26 0.63 4.92
4.57 4.92 2.54""").reshape(3, 3, 3)
# Table 9: a hundred times the real part of ψ, which equals the imaginary part but for sign.
TABLE_9 = numbers("""
-0.122 -0.243 -0.714  0.621  0.191  0.183 -0.579 -0.527
-1.050  0.764 -0.227  0.197 -0.601 -0.575  0.067 -0.168
 0.122  0.243 -0.714 -0.621  0.191  0.183  0.579 -0.527
-1.050  0.764  0.227  0.197  0.601  0.575  0.067  0.168
 0.122 -0.243 -0.714  0.621  0.191 -0.183  0.579  0.527
-1.050 -0.764  0.227 -0.197  0.601 -0.575  0.067 -0.168
-0.122  0.243 -0.714 -0.621  0.191 -0.183 -0.579  0.527
-1.050 -0.764 -0.227 -0.197 -0.601  0.575  0.067  0.168""")


def printed_system(damping: str) -> StateSpace:
    """The sampled model of Table 3 or 4; its direct term is not printed and plays no part."""
    table = IDENTIFIED[damping] / 10
    inputs = (Channel("force1", "N", "x1"), Channel("force2", "N", "x2"))
    outputs = (Channel("acc2.x", "m/s^2", "x2"), Channel("acc3.x", "m/s^2", "x3"))
    return StateSpace(table[:6], table[8:].T, table[6:8], np.zeros((2, 2)), 0.05, inputs, outputs)


def three_masses(damping: str) -> Rig:
    rig = Rig.load(MODELS / f"chain3_{damping}.xml")
    return rig.connected(inputs=["force1", "force2"], outputs=["acc2.x", "acc3.x"])


def pulse_test(damping: str, *, duration: float = 10.0, accuracy: float = 1e-12) -> Recording:
    return lab.simulate(
        three_masses(damping), Pulse(), sample_rate=20.0, duration=duration, accuracy=accuracy
    )


def truss_model() -> StateSpace:
    """Sampled model identified by OKID/ERA from the general input of section 5.4, without noise."""
    rig = Rig.load(MODELS / "truss.xml").connected(inputs=TRUSS_INPUTS, outputs=TRUSS_OUTPUTS)
    recording = lab.simulate(rig, Random(rms=100.0), sample_rate=50.0, duration=20.0, accuracy=1e-12)
    return okid_era(recording, 16).system


@dataclass(frozen=True)
class MonteCarlo:
    """Estimates of M, C, K over noise patterns, shape (n_patterns, 3, 3, 3), the truth and the bound on the scatter."""

    truth: np.ndarray
    era: np.ndarray
    likelihood: np.ndarray
    bound: np.ndarray
    lost: int

    def variation(self, scatter: np.ndarray) -> np.ndarray:
        """Coefficient of variation [%], nan where the truth is zero."""
        return 100 * scatter / np.abs(np.where(self.truth == 0, np.nan, self.truth))


def monte_carlo(n_patterns: int = 200, *, seed: int = 0) -> MonteCarlo:
    """Section 5.3 with records of 60 s: 5 % noise on the pulse responses of the coupled case.

    Plain ERA has a Hankel matrix of 200 x 200, five seconds of response on each side.
    """
    clean = pulse_test("coupled", duration=60.0, accuracy=1e-9)
    std = np.array([0.05 * np.sqrt(np.mean(record.outputs[:, :] ** 2, axis=1)) for record in clean.records])
    truth = three_masses("coupled").second_order()
    bound = cramer_rao_bound(truth, clean, noise_std=std).second_order
    assert bound is not None
    rng, plain, best, lost = np.random.default_rng(seed), [], [], 0
    for _ in range(n_patterns):
        recording = _polluted(clean, std, rng)
        try:
            model = era(markov_parameters(recording), 6, n_rows=100, n_columns=100).system
            start = second_order(model, dofs=DOFS)
            fitted = refine(recording, start).second_order
        except IdentificationError:
            lost += 1
            continue
        assert fitted is not None
        plain.append(_stacked(start))
        best.append(_stacked(fitted))
    spread = np.stack([np.asarray(x) for x in (bound.mass_std, bound.damping_std, bound.stiffness_std)])
    return MonteCarlo(_stacked(truth), np.array(plain), np.array(best), spread, lost)


def _polluted(clean: Recording, std: np.ndarray, rng: np.random.Generator) -> Recording:
    def noise(shape: tuple[int, ...], size: np.ndarray) -> np.ndarray:
        return size[:, None] * rng.standard_normal(shape)

    records = tuple(
        replace(record, outputs=record.outputs[:, :] + noise(record.outputs.shape, size))
        for record, size in zip(clean.records, std, strict=True)
    )
    return replace(clean, records=records)


def _stacked(structure: SecondOrder) -> np.ndarray:
    return np.stack([structure.mass, structure.damping, structure.stiffness])


def aligned(psi: np.ndarray, printed: np.ndarray) -> np.ndarray:
    """ψ, one column per mode, with the sign and the conjugate closest to the printed columns."""
    choices = np.stack([psi, -psi, psi.conj(), -psi.conj()])
    best = np.argmin(np.sum(np.abs(choices - printed) ** 2, axis=1), axis=0)
    return np.take_along_axis(choices, best[None, None, :], axis=0)[0]
