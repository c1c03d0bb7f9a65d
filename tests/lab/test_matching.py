"""A recording meets a model by the names of its channels."""

import pytest

from lab.errors import FileError, LabError, StudyError, UnknownNameError
from lab.matching import matched, read_mapping, renamed, same_channels
from tests.lab.diagnosed import recorded, two_masses


@pytest.fixture(scope="module")
def rig():
    return two_masses()


@pytest.fixture(scope="module")
def recording(rig):
    return recorded(rig, n_records=1)


def written(tmp_path, text):
    path = tmp_path / "names.toml"
    path.write_text(text, encoding="utf-8")
    return read_mapping(path)


def test_the_rig_has_the_channels_of_the_recording_in_their_order(rig, recording):
    fewer = recording.select(outputs=["pos1"])
    everything = rig.connected(inputs=None, outputs=["pos0", "acc0.x", "pos1"])
    assert [channel.name for channel in matched(everything, fewer).outputs] == ["pos1"]
    turned = recording.select(outputs=["pos1", "acc0.x"])
    assert matched(everything, turned).outputs == rig.outputs[::-1]
    assert matched(everything, turned).inputs == rig.inputs


def test_channels_of_the_lab_connect_beyond_those_connected_before(rig, recording):
    fewer = rig.connected(outputs=["pos1"])
    assert matched(fewer, recording).outputs == rig.outputs


def test_a_channel_that_the_model_lacks(rig, recording):
    other = renamed(recording, {"pos1": "laser"})
    with pytest.raises(UnknownNameError) as failed:
        matched(rig, other)
    said = str(failed.value)
    assert "output channel 'laser'" in said
    listed = said.partition("the model has ")[2].partition(";")[0].split(", ")
    assert {"acc0.x", "vel0", "pos0", "acc1.x", "vel1", "pos1"} <= set(listed)
    assert "--map" in said
    assert "\n" not in said
    with pytest.raises(UnknownNameError, match="input channel 'hammer'"):
        matched(rig, renamed(recording, {"force0": "hammer"}))


def test_a_channel_of_another_unit(rig, recording):
    swapped = renamed(recording, {"pos1": "acc0.x", "acc0.x": "pos1"})
    with pytest.raises(LabError, match=r"'pos1' is recorded in m/s\^2, .* in m;"):
        matched(rig, swapped)


def test_names_are_mapped_on_both_sides_or_on_one(recording, tmp_path):
    text = '"force0" = "hammer"\nacc0.x = "top.x"\n[outputs]\npos1 = "laser"\n'
    new = renamed(recording, written(tmp_path, text))
    assert [channel.name for channel in (*new.inputs, *new.outputs)] == ["hammer", "top.x", "laser"]
    assert new.records is recording.records


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("pos1 = 3", "'pos1' is renamed to 3; expected a name"),
        ("pos1 = ", "is not TOML"),
        ('[outputs]\nforce0 = "x"', "no output channel 'force0'; there are acc0.x, pos1"),
        ('[inputs]\npos1 = "x"', "no input channel 'pos1'; there are force0"),
        ('pos9 = "x"', "no channel 'pos9'; there are force0, acc0.x, pos1"),
        ('pos1 = "acc0.x"', "'acc0.x' would appear twice"),
    ],
)
def test_a_mistake_in_the_map_is_one_line(recording, tmp_path, text, says):
    with pytest.raises((StudyError, UnknownNameError)) as failed:
        renamed(recording, written(tmp_path, text))
    assert says in str(failed.value)
    assert "\n" not in str(failed.value)


def test_a_map_that_cannot_be_read(tmp_path):
    with pytest.raises(FileError, match=r"names\.toml: cannot be read"):
        read_mapping(tmp_path / "names.toml")


def test_a_baseline_is_cut_to_the_channels_of_the_recording(recording):
    fewer = recording.select(outputs=["pos1"])
    assert [channel.name for channel in same_channels(recording, fewer).outputs] == ["pos1"]
    with pytest.raises(
        UnknownNameError, match=r"the baseline has no output channel 'acc0.x'; there are pos1"
    ):
        same_channels(fewer, recording)
