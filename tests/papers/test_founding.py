"""The printed tables as measurements: what the printed constants get wrong is named."""

import numpy as np
import pytest

from identification.recording import Record, Recording
from lab.diagnosis.diagnose import diagnose
from lab.rig import Rig
from tests.papers.paper_c import DAMPING, DT, FREQUENCY, MODEL

N_SAMPLES = 800


def printed_responses(u: np.ndarray) -> np.ndarray:
    """Displacements (7, n) that have the frequencies and damping ratios of the paper's table, and no k or c.

    The shapes of seven equal masses between equal links, one end free, are φ_ir = sin((2r - 1) i π / 15) whatever the
    links; each mode is stepped exactly over samples in which the force on mass 1 [N] is held.
    """
    i, r = np.arange(1, 8)[:, None], np.arange(1, 8)
    shapes = np.sin((2 * r - 1) * i * np.pi / 15)
    shapes /= np.linalg.norm(shapes, axis=0)
    y = np.zeros((7, u.size))
    for phi, f, zeta in zip(shapes.T, FREQUENCY, DAMPING, strict=True):
        omega = 2 * np.pi * f
        pole = omega * (-zeta + 1j * np.sqrt(1 - zeta**2))
        # q = Im(s) / ω_d, where s' = pole s + φ_1 u.
        z, s = np.exp(pole * DT), 0.0j
        q = np.empty(u.size)
        for k, force in enumerate(u):
            q[k] = s.imag / pole.imag
            s = z * s + (z - 1) / pole * phi[0] * force
        y += phi[:, None] * q
    return y


@pytest.mark.slow
def test_the_printed_constants_of_paper_c_are_refuted_by_its_printed_table():
    rng = np.random.default_rng(3)
    u = 5.0 * rng.standard_normal(N_SAMPLES)
    y = printed_responses(u)
    y += 0.01 * np.sqrt(np.mean(y**2, axis=1, keepdims=True)) * rng.standard_normal(y.shape)
    rig = Rig.load(MODEL.with_name("chain7_printed.xml"))
    rig = rig.connected(inputs=["force1"], outputs=[f"pos{i}" for i in range(1, 8)])
    diagnosis = diagnose(Recording((Record("random", u[None], y),), rig.inputs, rig.outputs, 1 / DT), rig)
    found = {(f.effect.cause, f.effect.location): f.parameters["relative_change"] for f in diagnosis.findings}
    assert diagnosis.verdict == "explained"
    assert set(found) == {("stiffness_change", "*"), ("damping_change", "*")}
    # The table is rounded to 3e-5 of the lowest frequency and 1 % of the lowest ratio, far below the error bars.
    for (cause, _), true in ((("stiffness_change", "*"), 0.25), (("damping_change", "*"), -0.5)):
        quantity = found[cause, "*"]
        assert abs(quantity.value - true) < 4 * quantity.std
        assert quantity.std < 0.1
