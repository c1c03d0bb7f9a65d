"""What long work tells while it goes on: shares that rise to the end, and fall only where more work turned up."""

import itertools

import numpy as np
import pytest

import identification
import lab
from lab.effects import EFFECTS


class Listener:
    """Keeps what it was told, in rounds that begin where the share falls."""

    def __init__(self):
        self.rounds = [[]]

    def __call__(self, what, share):
        assert 0 <= share <= 1 + 1e-12
        # Sums of shares are rounded.
        if self.rounds[-1] and share < self.rounds[-1][-1][1] - 1e-9:
            self.rounds.append([])
        self.rounds[-1].append((what, share))

    def names(self, number=0):
        return list(dict.fromkeys(what for what, _ in self.rounds[number]))

    def reached(self, number=0):
        return self.rounds[number][-1][1]

    def largest_step(self, number=0):
        return max(b - a for a, b in itertools.pairwise([0.0, *(share for _, share in self.rounds[number])]))


@pytest.fixture(scope="module")
def rig():
    return lab.load_model("chain3_uncoupled").connected(
        inputs=["force1", "force3"], outputs=["acc1.x", "acc2.x", "acc3.x"]
    )


@pytest.fixture(scope="module")
def recording(rig):
    hidden = EFFECTS["cubic_stiffness"]("spring2_3", k3=3.0).apply(rig)
    noisy = lab.instrument(hidden, noise_percent=1.0)
    return lab.simulate(noisy, lab.Random(rms=1.0), sample_rate=5.0, duration=200.0, seed=1)


def test_a_diagnosis(rig, recording):
    heard = Listener()
    effects = {name: EFFECTS[name] for name in ("cubic_stiffness", "quadratic_damping", "sensor_gain")}
    found = lab.diagnose(recording, rig, effects=effects, progress=heard)
    assert [finding.effect.cause for finding in found.findings] == ["cubic_stiffness"]
    assert heard.names() == [
        "calibrating",
        "searching for a first cause",
        "fitting what was found",
        "simulating what was found",
    ]
    assert len(heard.rounds) == 1
    assert heard.reached() == pytest.approx(1.0)
    # Nobody looks at a bar that stands still for a third of the work.
    assert heard.largest_step() < 0.3


def test_an_identification(recording):
    heard = Listener()
    identification.identify(recording, progress=heard)
    assert heard.names() == ["identifying", "finding error bars"]
    assert len(heard.rounds) == 1
    assert heard.reached() == pytest.approx(1.0)
    assert heard.largest_step() < 0.1


@pytest.mark.parametrize(
    ("target", "settings"),
    [
        ("modes", {}),
        ("matrices", {}),
        ("diagnosis", {"causes": ("cubic_stiffness", "stiffness_change")}),
    ],
)
def test_a_placement(rig, target, settings):
    heard = Listener()
    lab.place(rig, 2, n_actuators=2, target=target, progress=heard, **settings)
    assert heard.names() == ["placing"]
    assert len(heard.rounds) == 1
    # Where signals are compared, that comes last; for modes it is told as begun, half of the work.
    assert heard.reached() == pytest.approx(0.5 if target == "modes" else 1.0)


def test_listening_changes_nothing(rig, recording):
    plain = identification.identify(recording)
    heard = identification.identify(recording, progress=Listener())
    np.testing.assert_array_equal(plain.modes.frequency_std, heard.modes.frequency_std)
