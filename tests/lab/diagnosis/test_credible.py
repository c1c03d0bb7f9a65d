"""What has evidence is named only where it is believable."""

from types import SimpleNamespace

import numpy as np
import pytest

from lab.diagnosis import diagnose as module
from lab.diagnosis.candidate import Candidate


def candidate(gain, error, direction=None):
    fit = SimpleNamespace(residual=np.zeros((1, 100)), causes=("cause",), error=error)
    return Candidate("stiffness_drift", "spring", fit, gain, direction)


@pytest.fixture
def state(monkeypatch):
    monkeypatch.setattr(module, "held_out_error", lambda misfit, fit: fit.error)
    return SimpleNamespace(misfit=SimpleNamespace(colour=2.0), held_out=(0.9,))


def test_what_runs_away_on_data_kept_aside_gives_way_to_the_next(state):
    away, sound = candidate(50.0, 2.8), candidate(30.0, 0.5)
    assert module._credible([away, sound], 20.0, state, None) == [sound]
    # An error of the root of two is that of a right motion out of step.
    assert module._credible([candidate(50.0, 1.4), sound], 20.0, state, None)[0].gain == 50.0


def test_what_was_there_before_gives_way_to_the_next(state):
    old, new = candidate(50.0, 0.5), candidate(30.0, 0.5)
    known = SimpleNamespace(shows=lambda cause, gain, samples: gain == 50.0 and samples == 50.0)
    assert module._credible([old, new], 20.0, state, known) == [new]


def test_own_changes_and_what_has_no_evidence_are_left_alone(state):
    own, weak = candidate(50.0, 2.8, np.ones(1)), candidate(10.0, 2.8)
    assert module._credible([own, weak], 20.0, state, None) == [own, weak]
    assert module._credible([weak], 20.0, state, None) == [weak]
    assert module._credible([candidate(50.0, 2.8)], 20.0, state, None) == []
