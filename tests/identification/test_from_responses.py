"""Frequency responses alone: modes with error bars that hold, matrices, and clear words where a method cannot."""

from dataclasses import replace

import numpy as np
import pytest

from identification.errors import IdentificationError
from identification.from_responses import identify_responses
from identification.line_scatter import noise_std
from identification.response import FrequencyResponse
from tests import systems

F = 0.02 * np.arange(5, 900)


@pytest.fixture(scope="module")
def truth():
    outputs = systems.sensors(("x2", "x5", "x7"))
    return systems.instrumented(systems.chain7(), outputs, systems.actuators(("x2",)))


def measured(system, noise, seed=0, dt=0.0):
    """Responses with complex white noise of a share of the RMS of each."""
    system = system.sampled(dt) if dt else system
    H, rng = system.frequency_response(F), np.random.default_rng(seed)
    level = noise * np.sqrt(np.mean(np.abs(H) ** 2, axis=0) / 2)
    H = H + level * (rng.standard_normal(H.shape) + 1j * rng.standard_normal(H.shape))
    return FrequencyResponse(F, H, dt, system.inputs, system.outputs)


@pytest.mark.parametrize("dt", [0.0, 0.02])
def test_error_bars_of_modes_hold(truth, dt):
    known, z = truth.modes(), []
    for seed in range(3):
        found = identify_responses(measured(truth, 0.02, seed, dt))
        assert found.realization.method == "plscf"
        assert all(found.stable)
        nearest = np.argmin(np.abs(found.modes.frequency_hz[:, None] - known.frequency_hz), axis=1)
        assert set(nearest[found.modes.damping_ratio < 0.2]) >= {0, 1, 2, 3, 4}
        # The two highest modes hardly show at this noise; those that do are told apart by their bars.
        for mode, own in enumerate(nearest):
            if own < 5:
                z.append(
                    (found.modes.frequency_hz[mode] - known.frequency_hz[own])
                    / found.modes.frequency_std[mode]
                )
                z.append(
                    (found.modes.damping_ratio[mode] - known.damping_ratio[own])
                    / found.modes.damping_std[mode]
                )
    # The mean square of thirty standard normals lies between 0.4 and 2 but for one chance in a thousand.
    assert 0.4 < np.mean(np.square(z)) < 2.0


def test_matrices_come_out_where_the_channels_allow():
    structure = systems.chain3()
    outputs = systems.sensors(("x1", "x2", "x3"))
    system = systems.instrumented(structure, outputs, systems.actuators(("x1",)))
    f = np.linspace(0.005, 2.0, 400)
    response = FrequencyResponse(f, system.frequency_response(f), 0.0, system.inputs, system.outputs)
    matrices = identify_responses(response, uncertainty=False).second_order
    # Degree 32 on the circle of the band comes within 1e-5 of a rational function of s, and K hangs on squares of poles.
    np.testing.assert_allclose(matrices.mass, structure.mass, atol=1e-3)
    np.testing.assert_allclose(matrices.stiffness, structure.stiffness, atol=1e-3)
    nowhere = replace(response, outputs=tuple(replace(channel, dof="") for channel in outputs))
    found = identify_responses(nowhere, uncertainty=False)
    assert found.second_order is None
    assert any("Mass, damping and stiffness are left out" in note for note in found.notes)


def test_matrices_of_fewer_degrees_of_freedom_than_modes_are_refused(truth):
    found = identify_responses(measured(truth, 0.01), uncertainty=False)
    assert found.second_order is None
    assert "7 modes were found and the channels name 3 degrees of freedom" in found.explanation


def test_an_order_asked_for_is_kept(truth):
    found = identify_responses(measured(truth, 0.0), order=14)
    assert found.stabilization is None
    assert len(found.modes) == 7
    np.testing.assert_allclose(found.modes.frequency_hz, truth.modes().frequency_hz, rtol=1e-4)


def test_what_samples_are_needed_for_is_refused(truth):
    response = measured(truth, 0.01)
    with pytest.raises(
        IdentificationError, match=r"'era' needs samples.*expected plscf; import the time signals"
    ):
        identify_responses(response, "era")
    with pytest.raises(IdentificationError, match="no input"):
        identify_responses(replace(response, inputs=(), values=response.values[:, :, :0]))


def test_noise_is_that_stated_or_else_that_left(truth):
    response, clean = measured(truth, 0.02, 1), truth.frequency_response(F)
    level = 0.02 * np.sqrt(np.mean(np.abs(clean) ** 2, axis=0))
    # Means over all lines of 1800 squares scatter by 2.4 %; their square roots by half of it.
    left = np.sqrt(np.mean(noise_std(response, clean, 0)[50:-50] ** 2, axis=0))
    np.testing.assert_allclose(left, level, rtol=0.1)
    stated = replace(response, variance=np.full(clean.shape, 4.0))
    np.testing.assert_array_equal(noise_std(stated, clean, 14), np.full(clean.shape, 2.0))
