"""Residues of known poles: exact where all modes are there, with residual lines where some are not."""

import numpy as np
import pytest

from identification.errors import IdentificationError, TooShortError
from identification.lsfd import lsfd
from identification.modes import mac
from identification.response import FrequencyResponse
from identification.spectra import frequency_response
from tests import systems

QUANTITIES = ["displacement", "velocity", "acceleration"]


def chain7(quantity, dt=0.001):
    structure = systems.chain7()
    system = systems.instrumented(
        structure, systems.sensors(structure.dofs, quantity), systems.actuators(("x1", "x7"))
    )
    return system.sampled(dt)


def response_of(system, f):
    return FrequencyResponse(f, system.frequency_response(f), system.dt, system.inputs, system.outputs)


@pytest.mark.parametrize("quantity", QUANTITIES)
def test_all_modes_give_the_exact_model(quantity):
    system = chain7(quantity, 0.02)
    f = np.linspace(0.1, 24.9, 300)
    found = lsfd(response_of(system, f), system.modes())
    H = system.frequency_response(f)
    # Rounding, times the condition of overlapping resonances.
    np.testing.assert_allclose(found.frequency_response(f), H, atol=1e-11 * np.abs(H).max())
    np.testing.assert_allclose(found.state_space().frequency_response(f), H, atol=1e-10 * np.abs(H).max())
    np.testing.assert_allclose(np.diag(mac(found.modes().shapes, system.modes().shapes)), 1, atol=1e-10)
    s = np.linalg.svd(found.values, compute_uv=False)
    assert np.all(s[:, 1] < 1e-9 * s[:, 0])  # each residue is the product of a shape and a participation


@pytest.mark.parametrize("quantity", QUANTITIES)
def test_residual_lines_stand_for_the_modes_outside_the_band(quantity):
    system, band = chain7(quantity), (4.0, 9.0)
    f = np.linspace(*band, 200)
    inside = system.modes().take([1, 2])
    H = system.frequency_response(f)
    with_lines = lsfd(response_of(system, f), inside, residuals=True)
    without = lsfd(response_of(system, f), inside)
    errors = [
        np.linalg.norm(each.frequency_response(f) - H) / np.linalg.norm(H) for each in (with_lines, without)
    ]
    # A mode at 1.7 Hz is no pure mass at 4 Hz, (1.7 / 4)² = 18 % off, nor one at 10.6 Hz a pure spring at 9 Hz.
    assert errors[0] < 0.05
    assert errors[0] < errors[1] / 2
    shapes = np.diag(mac(with_lines.modes().shapes, inside.shapes))
    assert np.all(shapes > 0.99)


def test_the_exponential_window_is_undone():
    system = chain7("acceleration", 0.02)
    response = frequency_response(systems.pulse_recording(system, 3000), decay=0.5)
    found = lsfd(response, system.modes())
    f = np.linspace(0.5, 24, 100)
    H = system.frequency_response(f)
    # exp(-(0.5 + 0.05) * 60) = 1e-14 of the motion is left at the end.
    np.testing.assert_allclose(found.state_space().frequency_response(f), H, atol=1e-10 * np.abs(H).max())


def test_what_cannot_be_fitted():
    system = chain7("displacement", 0.02)
    with pytest.raises(TooShortError, match="7 lines cannot carry 7 modes"):
        lsfd(response_of(system, np.linspace(1, 20, 7)), system.modes())
    with pytest.raises(IdentificationError, match="the lines begin at 0 Hz"):
        lsfd(response_of(system, np.linspace(0, 20, 50)), system.modes(), residuals=True)
