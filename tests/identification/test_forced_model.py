"""Inputs fitted to modes: exact without noise, whatever state the records begin in."""

from dataclasses import replace

import numpy as np
import pytest

from identification.errors import IdentificationError, RecordingError
from identification.forced_model import forced_matrices, forced_model
from tests.ambient import ambient
from tests.systems import chain3, chain7, instrumented, noisy, paper_chain3, pulse_recording, recorded


@pytest.mark.parametrize("kind", ["random", "pulse"])
def test_the_modes_of_a_structure_give_its_matrices_and_responses(kind):
    system, truth = paper_chain3("coupled"), chain3("coupled")
    if kind == "pulse":
        recording = pulse_recording(system, 300)
    else:
        rng = np.random.default_rng(0)
        start = [rng.standard_normal(6), np.zeros(6)]
        recording = recorded(system, [rng.standard_normal((2, 300)) for _ in start], initial=start)
    modes = system.modes().normalized()
    model = forced_model(recording, modes)
    f = np.linspace(0.01, 9, 50)
    # Least squares with exact data: rounding times a condition number of some thousands, squared.
    np.testing.assert_allclose(model.system.frequency_response(f), system.frequency_response(f), atol=1e-9)
    assert max(np.max(np.abs(e)) for e in model.residuals) < 1e-9
    found = forced_matrices(recording, modes, dofs=truth.dofs).matrices
    for name in ("mass", "damping", "stiffness"):
        exact = getattr(truth, name)
        np.testing.assert_allclose(getattr(found, name), exact, atol=1e-8 * np.max(np.abs(exact)))


def test_poles_move_to_where_they_are_likeliest():
    system = paper_chain3()
    recording = recorded(system, [np.random.default_rng(1).standard_normal((2, 400))])
    shifted = system.modes().normalized()
    shifted = type(shifted)(
        shifted.frequency_hz * 1.01, shifted.damping_ratio, shifted.shapes, shifted.outputs
    )
    found = forced_model(recording, shifted, likeliest=True).system.modes()
    np.testing.assert_allclose(found.frequency_hz, system.modes().frequency_hz, rtol=1e-7)


def test_without_modes_or_forces_there_is_no_model():
    system = paper_chain3()
    recording = recorded(system, [np.ones((2, 50))])
    with pytest.raises(IdentificationError, match="no mode"):
        forced_model(recording, system.modes().take([]))
    modes = instrumented(chain7(), ambient(300, 0).outputs, ()).modes()
    with pytest.raises(RecordingError, match="no measured inputs"):
        forced_matrices(ambient(300, 0), modes)


def test_matrices_are_those_of_the_likeliest_model_and_their_error_bars_are_true():
    system, truth, rng = paper_chain3(), chain3(), np.random.default_rng(2)
    clean = recorded(system, [rng.standard_normal((2, 600))])
    modes = system.modes().normalized()
    # Shapes that are off by 3 %, as those of spectra are: far more than the noise leaves open.
    shapes = modes.shapes * (1 + 0.03 * rng.standard_normal(modes.shapes.shape))
    started = replace(modes, shapes=shapes)
    deviations = []
    for _ in range(16):
        record = replace(clean.records[0], outputs=noisy(clean.records[0].outputs, 0.02, rng))
        found, sentence = forced_matrices(replace(clean, records=(record,)), started, dofs=truth.dofs)
        assert "likeliest" in sentence
        for name in ("mass", "damping", "stiffness"):
            error = getattr(found, name) - getattr(truth, name)
            deviations.append((error / getattr(found, f"{name}_std"))[np.triu_indices(3)])
    z = np.array(deviations).reshape(16, -1)
    # Eighteen entries of one test share six modes with three numbers each: at least some ten are independent, so that
    # the mean square of 16 tests is known to √(2 / 160) = 11 %; three of that.
    assert np.mean(z**2) == pytest.approx(1, abs=0.34)


def test_error_bars_of_matrices_can_be_left_out():
    system = paper_chain3()
    recording = recorded(system, [np.random.default_rng(3).standard_normal((2, 300))])
    found = forced_matrices(recording, system.modes().normalized(), dofs=chain3().dofs, uncertainty=False)
    assert found.matrices.mass_std is None
