"""Replay: as accurate as asked for, by whatever way it gets there."""

import numpy as np
import pytest

from lab import replay as module
from lab.effects import EFFECTS
from lab.excitation import Random
from lab.replay import replay
from lab.rig import Rig
from lab.simulate import simulate

ACCURACY = 1e-3


@pytest.fixture(scope="module", params=["cubic_stiffness", "freeplay", "stiffness_change"])
def case(request):
    sizes = {"cubic_stiffness": {"k3": 2.0}, "freeplay": {"half_gap": 0.05}}
    size = sizes.get(request.param, {"relative_change": 0.3})
    rig = Rig.load("models/chain3_coupled.xml").connected(inputs=["force1"], outputs=["acc1.x", "acc3.x"])
    rig = EFFECTS[request.param]("spring2_3", **size).apply(rig)
    recording = simulate(rig, Random(rms=1.0), sample_rate=5.0, duration=60.0, seed=4)
    (truth,) = replay(rig, recording, accuracy=1e-7)
    return rig, recording, truth


def error(found, truth):
    return np.max(np.sqrt(np.mean((found - truth) ** 2, axis=1) / np.mean(truth**2, axis=1)))


@pytest.fixture
def runs(monkeypatch):
    """Substeps of every simulation that was asked for."""
    asked = []

    def counted(*arguments, **options):
        asked.append(options.get("substeps"))
        return simulate(*arguments, **options)

    monkeypatch.setattr(module, "simulate", counted)
    return asked


def test_it_is_as_accurate_as_asked_for(case):
    rig, recording, truth = case
    (found,) = replay(rig, recording, accuracy=ACCURACY)
    assert error(found, truth) <= ACCURACY


def test_what_others_found_too_is_not_refined(case, runs):
    rig, recording, truth = case
    (found,) = replay(rig, recording, accuracy=0.2, expected=[truth])
    # Substeps as told, not as a search for the accuracy finds them.
    assert len(runs) == 1
    assert runs[0] is not None
    # Two answers by different means that agree within the accuracy err by less than it, unless both err alike.
    assert error(found, truth) <= 0.2


@pytest.mark.parametrize("wrong", [lambda y: 1.01 * y, lambda y: np.full_like(y, np.nan)])
def test_what_others_found_otherwise_is_not_believed(case, runs, wrong):
    rig, recording, truth = case
    (found,) = replay(rig, recording, accuracy=ACCURACY, expected=[wrong(truth)])
    assert len(runs) > 1
    assert error(found, truth) <= ACCURACY
