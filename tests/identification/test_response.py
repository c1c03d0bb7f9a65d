"""Frequency responses as data: channels taken by name."""

import numpy as np
import pytest

from identification.errors import RecordingError
from identification.recording import Channel
from identification.response import FrequencyResponse


@pytest.fixture
def response():
    values = np.arange(2 * 3 * 2).reshape(2, 3, 2)  # (line, output, input)
    inputs, outputs = (tuple(Channel(name, "N") for name in names) for names in ("uv", "abc"))
    spread = {"coherence": values[:, :, 0] / 100, "variance": values / 10}
    return FrequencyResponse(np.array([1.0, 2.0]), values, 0.01, inputs, outputs, **spread)


def test_selected_channels_come_in_the_order_asked(response):
    few = response.select(inputs=["v"], outputs=["c", "a"])
    assert [channel.name for channel in (*few.inputs, *few.outputs)] == ["v", "c", "a"]
    for line in range(2):
        for i, output in enumerate((2, 0)):
            assert few.values[line, i, 0] == response.values[line, output, 1]
            assert few.variance[line, i, 0] == response.variance[line, output, 1]
            assert few.coherence[line, i] == response.coherence[line, output]
    assert few.dt == response.dt


def test_all_channels_stay_where_none_is_named(response):
    np.testing.assert_array_equal(response.select().values, response.values)


def test_a_channel_that_is_not_there_is_told(response):
    with pytest.raises(RecordingError, match="output channel 'd' does not exist; there are a, b, c"):
        response.select(outputs=["d"])
