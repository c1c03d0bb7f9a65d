"""Error bars of models realized through an observer, on records too short or noisy for any linearization."""

from __future__ import annotations

import numpy as np
import pytest

from identification.errors import IdentificationError
from identification.identify import identify
from identification.observer_scatter import matrix_model, observer_scatter
from identification.okid import okid_era
from tests.systems import chain3, paper_chain3, pulse_recording, recorded, with_noise

SYSTEM = paper_chain3()
TRUTH = SYSTEM.modes()


def short_pulses(rng):
    """Ten seconds after each pulse, less than the first mode takes to fall to 1 / e, with 4 % noise."""
    return with_noise(pulse_recording(SYSTEM, 200), 0.04, rng)


def short_forces(rng):
    """Two records of random forces of 12.5 s, with 1 % noise."""
    return with_noise(recorded(SYSTEM, [rng.standard_normal((2, 250)) for _ in range(2)]), 0.01, rng)


@pytest.mark.slow
@pytest.mark.parametrize("test", [short_pulses, short_forces])
def test_error_bars_hold_where_the_observer_is_hardly_determined(test):
    inside, size = [], []
    for k in range(12):
        recording = test(np.random.default_rng([1, k]))
        found = okid_era(recording, 6)
        modes = found.system.modes()
        modes = modes.take([int(np.argmin(np.abs(modes.poles - pole))) for pole in TRUTH.poles])
        scatter = observer_scatter(recording, found, modes).modes
        error = np.stack([modes.frequency_hz - TRUTH.frequency_hz, modes.damping_ratio - TRUTH.damping_ratio])
        std = np.stack([scatter.frequency, scatter.damping])
        inside.append(np.abs(error) < 2 * std)
        size.append(error / std)
    # 72 figures, of which those of a test go together: 95 % less three standard deviations of 24 that do not.
    assert np.mean(inside) > 0.95 - 3 * np.sqrt(0.95 * 0.05 / 24)
    # A linearization is off by any power of ten here; errors that hold are of the size of their bars, up to a factor.
    assert 0.4 < np.sqrt(np.mean(np.square(size))) < 2.0


def test_without_noise_nothing_scatters():
    recording = pulse_recording(SYSTEM, 100)
    found = identify(recording, "okid_era", order=6, dofs=chain3().dofs)
    assert np.all(found.modes.frequency_std == 0)
    assert np.all(found.second_order.stiffness_std == 0)


def test_modes_and_matrices_share_the_tests_drawn():
    recording = with_noise(pulse_recording(SYSTEM, 200), 1e-3, np.random.default_rng(3))
    found = okid_era(recording, 6)
    modes, dofs = found.system.modes(), chain3().dofs
    matrices = identify(recording, "okid_era", order=6, dofs=dofs, uncertainty=False).second_order
    both, alone = (observer_scatter(recording, found, modes, matrices=each) for each in (matrices, None))
    # The fit of B and D leaves the poles alone, so that the same draws move them the same way.
    np.testing.assert_array_equal(both.modes.frequency, alone.modes.frequency)
    assert alone.matrices is None
    assert np.all(both.matrices.mass_std > 0)


def test_matrices_come_from_two_states_per_degree_of_freedom_where_there_are():
    recording = with_noise(pulse_recording(SYSTEM, 200), 1e-3, np.random.default_rng(3))
    swept = okid_era(recording, 8, orders=[6, 8])
    assert matrix_model(swept, 3).n_states == 6
    assert matrix_model(okid_era(recording, 8), 3).n_states == 8


def test_no_mode_has_no_error_bar():
    recording = with_noise(pulse_recording(SYSTEM, 200), 1e-3, np.random.default_rng(3))
    found = okid_era(recording, 6)
    with pytest.raises(IdentificationError, match="no mode"):
        observer_scatter(recording, found, found.system.modes().take([]))
