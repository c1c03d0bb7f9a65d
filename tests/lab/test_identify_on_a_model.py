"""Modes of a recording without degrees of freedom, shown on a model that knows where its channels are."""

import numpy as np
import pytest

from identification.recording import Channel, Record, Recording
from identification.systems import StateSpace
from lab.errors import UnknownNameError
from lab.files.model import load_model
from lab.matching import placed


@pytest.fixture
def nameless():
    rig = load_model("chain7").connected(inputs=["force2"], outputs=["acc2.x", "acc5.x"])
    bare = tuple(
        tuple(type(channel)(channel.name, channel.unit) for channel in side)
        for side in (rig.inputs, rig.outputs)
    )
    y = np.random.default_rng(1).standard_normal((3, 400))
    return Recording((Record("random", y[:1], y[1:]),), *bare, 50.0), rig


def test_channels_take_the_places_that_the_model_has(nameless):
    recording, rig = nameless
    found = placed(recording, load_model("chain7"))
    assert [c.dof for c in found.inputs] == [c.dof for c in rig.inputs]
    assert [c.dof for c in found.outputs] == [c.dof for c in rig.outputs]
    assert all(c.dof for c in found.outputs)


def test_a_channel_that_the_model_lacks_stays_and_others_must_fit(nameless):
    recording, _ = nameless
    renamed = [type(c)(name, c.unit) for c, name in zip(recording.outputs, ("acc2.x", "spare"), strict=True)]
    found = placed(Recording(recording.records, recording.inputs, tuple(renamed), 50.0), load_model("chain7"))
    assert [bool(c.dof) for c in found.outputs] == [True, False]
    strange = tuple(type(c)(f"channel {k}", c.unit) for k, c in enumerate(recording.outputs))
    with pytest.raises(UnknownNameError, match=r"none of the outputs channel 0, channel 1 reads a place"):
        placed(Recording(recording.records, recording.inputs, strange, 50.0), load_model("chain7"))


@pytest.mark.parametrize("dt", [0.0, 0.1])
def test_a_response_at_no_frequency_has_no_lines(dt):
    """As asked for the modes of a recording in which none was found."""
    inputs = tuple(Channel(f"force{k}", "N") for k in range(3))
    outputs = (Channel("acc", "m/s^2"),)
    matrices = -np.eye(2), np.ones((2, 3)), np.ones((1, 2)), np.zeros((1, 3))
    system = StateSpace(*matrices, dt, inputs, outputs)
    assert system.frequency_response(np.zeros(0)).shape == (0, 1, 3)
