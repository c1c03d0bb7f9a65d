"""What figures draw, read from their SVG: error bars of the right modes, causes as long as their evidence."""

from dataclasses import replace

import numpy as np

from lab.diagnosis.restoring import restoring_force
from lab.show.figures.causes import calibration_figure, causes_figure
from lab.show.figures.error_bars import error_bars
from lab.show.figures.responses import coherences, nyquist
from lab.show.figures.restoring import restoring_figure
from lab.show.signals import spectra
from tests.lab.diagnosed import explained, recorded, two_masses
from tests.lab.showcase import chain_result, chain_rig, pulse_recording, random_recording

RIG = chain_rig("chain3_coupled", inputs=["force1", "force2"], outputs=["acc2.x", "acc3.x"])


def test_error_bars_say_what_they_are_held_against():
    result = chain_result(RIG)
    assert "the truth: about 95 %" in error_bars(result).caption
    alone = replace(result, comparison=None, stable=(True, False, True))
    said = error_bars(alone)
    assert "how far the truth may be off. Modes that do not stay put" in said.caption
    assert "relative to the estimate" in said.svg
    bare = replace(result, modes=replace(result.modes, frequency_std=None, damping_std=None))
    assert error_bars(bare) is None
    exact = replace(result, modes=replace(result.modes, frequency_std=np.zeros(3), damping_std=np.zeros(3)))
    assert error_bars(exact) is None


def test_a_nyquist_plot_needs_inputs_and_marks_the_stable_modes():
    result, recording = chain_result(RIG), random_recording(RIG, 5000)
    spectrum = spectra(recording)
    drawn = nyquist(recording, spectrum, replace(result, stable=(True, True, False)))
    top = 1.1 * result.modes.frequency_hz[1]
    assert f"up to {top:.4g} Hz" in drawn.caption
    ambient = replace(
        recording, inputs=(), records=(replace(recording.records[0], inputs=np.zeros((0, 5000))),)
    )
    assert nyquist(ambient, spectra(ambient), result) is None
    assert coherences(ambient, spectra(ambient), result) is None


def test_coherence_needs_averages():
    """Two pulses for two inputs explain everything by construction: nothing worth a picture."""
    recording = pulse_recording(RIG)
    assert coherences(recording, spectra(recording), chain_result(RIG)) is None


def test_causes_and_calibration_are_drawn_where_there_are_any():
    recording = recorded(two_masses())
    diagnosis = explained(two_masses(), recording)
    causes = causes_figure(diagnosis)
    for text in ("cubic stiffness at spring0_1", "bilinear stiffness at spring0_1", "1234", "800.2"):
        assert text in causes.svg
    assert "mass mass0" in calibration_figure(diagnosis).svg
    nothing = replace(diagnosis, findings=(), alternatives=(), calibration={})
    assert causes_figure(nothing) is None
    assert calibration_figure(nothing) is None


def test_a_cloud_of_forces_may_be_shifted_where_nothing_senses_constant_ones():
    recording = recorded(two_masses())
    restoring = restoring_force(explained(two_masses(), recording), recording)
    assert "shifted as a whole" in restoring_figure(restoring, static=False).caption
    assert "shifted as a whole" not in restoring_figure(restoring).caption
