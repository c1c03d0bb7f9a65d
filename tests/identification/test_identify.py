"""The whole way from a recording to modes and matrices: what is chosen, what is found, what is said."""

from dataclasses import replace

import numpy as np
import pytest

from identification.errors import IdentificationError, RecordingError
from identification.identify import choose_method, identify
from identification.modes import mac
from identification.recording import KINDS, Record, Recording
from tests.ambient import ambient, output_record
from tests.systems import (
    chain3,
    chain7,
    paper_chain3,
    paper_truss,
    pulse_recording,
    recorded,
    with_noise,
)


def measured(recording, level, seed=7):
    return with_noise(recording, level, seed)


def of_kind(kind, *, inputs):
    u = np.zeros((2 if inputs else 0, 10))
    system = paper_chain3()
    return Recording((Record(kind, u, np.ones((2, 10))),), system.inputs, system.outputs, 20.0)


@pytest.mark.parametrize("kind", KINDS)
def test_the_method_follows_the_kind_of_the_records(kind):
    name, reason = choose_method(of_kind(kind, inputs=True))
    assert name == {"pulse": "era", "free_decay": "era", "ambient": "ssi_cov"}.get(kind, "okid_era")
    assert reason.startswith("since")


@pytest.mark.parametrize("kind", sorted(set(KINDS) - {"pulse", "free_decay"}))
def test_without_forces_outputs_must_do(kind):
    assert choose_method(of_kind(kind, inputs=False))[0] == "ssi_cov"


@pytest.mark.parametrize("damping", ["uncoupled", "coupled"])
def test_exact_pulses_give_exact_matrices(damping):
    truth = chain3(damping)
    found = identify(pulse_recording(paper_chain3(damping), 200), dofs=truth.dofs)
    assert found.realization.method == "era"
    assert found.realization.order == 6
    assert found.stabilization is None
    assert found.stable == (True,) * 3
    assert found.warnings == ()
    np.testing.assert_allclose(found.modes.poles, truth.modes().poles, rtol=1e-10)
    for name in ("mass", "damping", "stiffness"):
        exact = getattr(truth, name)
        # Ten digits, as the paper's example promises for data without noise.
        np.testing.assert_allclose(
            getattr(found.second_order, name), exact, atol=1e-10 * np.max(np.abs(exact))
        )


def test_known_random_forces_give_the_matrices_of_the_truss():
    forces = 100 * np.random.default_rng(1).standard_normal((4, 1000))
    found = identify(measured(recorded(paper_truss(), [forces]), 0.02), uncertainty=False)
    assert found.realization.method == "okid_era"
    assert found.realization.order == 16
    assert found.stable == (True,) * 8
    # 2 % noise over 1000 samples moves frequencies by less than 0.1 % and masses by some per cent.
    np.testing.assert_allclose(found.modes.frequency_hz, paper_truss().modes().frequency_hz, rtol=2e-3)
    np.testing.assert_allclose(np.diag(found.second_order.mass), 100, rtol=0.15)


def test_noisy_pulses_are_swept_and_modelled_at_the_order_they_show():
    found = identify(measured(pulse_recording(paper_chain3(), 200), 0.05))
    assert found.realization.order == 6
    assert found.stable == (True,) * 3
    assert len(found.stabilization.modes) == 3
    # 5 % noise: frequencies scatter by 0.2 to 0.4 %.
    np.testing.assert_allclose(found.modes.frequency_hz, chain3().modes().frequency_hz, rtol=0.015)
    assert found.second_order is not None


def test_ambient_vibration_gives_the_modes_and_says_why_no_matrices():
    truth = chain7().modes()
    found = identify(ambient(20_000, 3))
    assert found.realization.method == "ssi_cov"
    assert len(found.modes) == 7
    assert found.stable == (True,) * 7
    np.testing.assert_allclose(found.modes.frequency_hz, truth.frequency_hz, rtol=1e-2)
    assert np.all(np.diag(mac(found.modes.shapes, truth.shapes)) > 0.95)
    assert found.second_order is None
    assert any(note.startswith("Mass, damping and stiffness are left out") for note in found.notes)
    assert any("forces act that were not measured" in note for note in found.notes)
    # The model of the order taken has every mode.
    own = found.realization.system.modes().frequency_hz
    gap = np.min(np.abs(own[:, None] - found.modes.frequency_hz), axis=0)
    assert np.all(gap < 0.02 * found.modes.frequency_hz)


def test_a_given_order_is_taken_as_it_is():
    found = identify(ambient(20_000, 4), order=14)
    assert found.realization.orders == (14,)
    assert found.stabilization is None
    np.testing.assert_allclose(found.modes.poles, found.realization.system.modes().poles)


def test_a_given_order_among_others_is_checked_against_them():
    found = identify(ambient(20_000, 5), order=14, orders=range(2, 31, 2))
    assert found.realization.order == 14
    assert len(found.modes) == 7
    assert found.stable.count(True) >= 6


def test_a_mode_that_only_noise_holds_is_not_called_stable():
    """An order too high by four: the noise gets two modes more, which move from one order to the next."""
    found = identify(measured(pulse_recording(paper_chain3(), 200), 0.05), order=10, orders=range(2, 15, 2))
    near = (
        np.min(np.abs(found.modes.frequency_hz[:, None] / chain3().modes().frequency_hz - 1), axis=1) < 0.02
    )
    stable = np.array(found.stable)
    assert np.all(stable[near])
    assert not np.any(stable[~near])


def test_growing_modes_and_short_horizons_are_warned_of():
    found = identify(ambient(400, 0, driven=["x1"]), order=6, n_rows=190)
    growing = np.sum(found.modes.damping_ratio < 0)
    assert growing > 0
    assert sum("grows in time" in warning for warning in found.warnings) == growing
    assert [bool(z >= 0) for z in found.modes.damping_ratio] == list(found.stable)
    found = identify(ambient(20_000, 6), order=14, n_rows=4)
    assert any("less than half a period" in warning for warning in found.warnings)
    assert not any("less than half a period" in note for note in found.notes)


def test_an_order_at_the_limit_of_the_horizon_is_warned_of():
    found = identify(ambient(20_000, 7), order=14, n_rows=3)
    assert any(warning.startswith("Order 14 is close to 14") for warning in found.warnings)


def test_a_record_of_few_periods_is_warned_of():
    # 54 s hold 90 periods of 1.66 Hz, at 0.5 % damping: (2 π 0.0052 90)^-1/2 = 58 %.
    found = identify(ambient(2_000, 8))
    (warning,) = (warning for warning in found.warnings if "periods of the mode" in warning)
    assert "90 periods of the mode at 1.6" in warning
    assert not any("periods of the mode" in warning for warning in identify(ambient(40_000, 8)).warnings)


def test_a_missing_sample_is_named_first():
    recording = ambient(500, 9)
    y = np.array(recording.records[0].outputs)
    y[1, 270] = np.nan
    with pytest.raises(RecordingError, match=r"acceleration_x2.* t = 7\.29 s"):
        identify(replace(recording, records=(output_record(y),)))


@pytest.mark.parametrize(
    ("method", "settings", "says"),
    [("fft", {}, "there are era"), (None, {"blocks": 3}, "no setting 'blocks'"), ("okid_era", {}, "forces")],
)
def test_wrong_requests_are_told(method, settings, says):
    with pytest.raises(IdentificationError, match=says):
        identify(ambient(500, 10), method, **settings)
