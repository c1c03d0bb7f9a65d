"""Recording files: what goes in comes out, in SI, and nothing odd is accepted silently."""

import h5py
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from identification.recording import KINDS, QUANTITIES, Channel, Record, Recording
from lab.errors import FileError
from lab.files.recording import RecordingWriter, load, save

TEXT = st.text(st.characters(exclude_categories=["Cs", "Cc"]), max_size=12)
NAMES = st.text(st.characters(exclude_categories=["Cs", "Cc"]), min_size=1, max_size=8)
NUMBERS = st.floats(allow_nan=True, allow_infinity=True)


@st.composite
def channels(draw, min_size):
    names = draw(st.lists(NAMES, min_size=min_size, max_size=3, unique=True))
    factor = st.floats(allow_nan=False, allow_infinity=False)
    return tuple(
        Channel(name, draw(st.sampled_from(sorted(QUANTITIES))), draw(TEXT), draw(factor)) for name in names
    )


@st.composite
def recordings(draw):
    inputs, outputs = draw(channels(0)), draw(channels(1))
    facts = st.dictionaries(
        st.sampled_from(["operator", "room", "wetness"]), st.floats(allow_nan=False) | TEXT
    )
    records = []
    for _ in range(draw(st.integers(1, 3))):
        n = draw(st.integers(0, 7))
        driven = draw(st.booleans())
        u = draw(hnp.arrays(float, (len(inputs) if driven else 0, n), elements=NUMBERS))
        y = draw(hnp.arrays(float, (len(outputs), n), elements=NUMBERS))
        kind = draw(st.sampled_from(KINDS))
        records.append(Record(kind, u, y, draw(TEXT), draw(TEXT), draw(facts)))
    rate = draw(st.floats(1e-3, 1e6))
    return Recording(tuple(records), inputs, outputs, rate, draw(TEXT), draw(TEXT), draw(facts))


@given(recordings())
def test_round_trip_keeps_everything(tmp_path_factory, recording):
    path = tmp_path_factory.mktemp("round") / "r.h5"
    save(recording, path)
    for lazy in (False, True):
        again = load(path, lazy=lazy)
        for name in ("inputs", "outputs", "sample_rate", "title", "source", "attributes"):
            assert getattr(again, name) == getattr(recording, name)
        for a, b in zip(again.records, recording.records, strict=True):
            assert (a.kind, a.start_time, a.note, a.attributes) == (
                b.kind,
                b.start_time,
                b.note,
                b.attributes,
            )
            np.testing.assert_array_equal(a.inputs[:, :], b.inputs)
            np.testing.assert_array_equal(a.outputs[:, :], b.outputs)


def bench(n_samples=50, n_outputs=2):
    rng = np.random.default_rng(1)
    record = Record(
        "random", rng.standard_normal((1, n_samples)), rng.standard_normal((n_outputs, n_samples))
    )
    outputs = tuple(Channel(f"a{k}", "m/s^2") for k in range(n_outputs))
    return Recording((record,), (Channel("f", "N"),), outputs, 100.0)


def test_the_file_is_laid_out_as_agreed(tmp_path):
    save(bench(), tmp_path / "r.h5")
    with h5py.File(tmp_path / "r.h5") as file:
        assert file.attrs["format"] == "modal-recording"
        assert file.attrs["version"] == 1
        group = file["records/0"]
        assert group.attrs["kind"] == "random"
        assert group.attrs["sample_rate"] == 100.0
        for side, names, units in (("inputs", ["f"], ["N"]), ("outputs", ["a0", "a1"], ["m/s^2"] * 2)):
            data = group[side]
            assert data.dtype == np.float64
            assert data.chunks[0] == data.shape[0]
            assert list(data.attrs["names"]) == names
            assert list(data.attrs["units"]) == units


def write_by_hand(path, values, units, dtype="f8"):
    """A file as somebody else would write it: only what the format demands."""
    with h5py.File(path, "w") as file:
        file.attrs.update(format="modal-recording", version=1)
        group = file.create_group("records/0")
        group.attrs.update(kind="ambient", sample_rate=200)
        data = group.create_dataset("outputs", data=np.asarray(values, dtype))
        data.attrs["names"] = [f"c{k}" for k in range(len(values))]
        data.attrs["units"] = units


@pytest.mark.parametrize("lazy", [False, True])
@pytest.mark.parametrize("dtype", ["f4", "f8", "i2"])
def test_reading_converts_to_si(tmp_path, lazy, dtype):
    write_by_hand(tmp_path / "r.h5", [[1, 2, 4], [8, 16, 32]], ["g", "mm"], dtype)
    recording = load(tmp_path / "r.h5", lazy=lazy)
    assert [channel.unit for channel in recording.outputs] == ["m/s^2", "m"]
    assert recording.inputs == ()
    y = recording.records[0].outputs
    expected = np.array([[1, 2, 4], [8, 16, 32]]) * [[9.80665], [1e-3]]
    for key in (
        np.s_[:, :],
        np.s_[:, 1:3],
        np.s_[1:, ::2],
        np.s_[0, :],
        np.s_[1],
        np.s_[[0, 1], 1:],
        np.s_[1, 2],
    ):
        np.testing.assert_array_equal(y[key], expected[key])


def test_large_files_stay_on_disk(tmp_path, monkeypatch):
    save(bench(), tmp_path / "r.h5")
    monkeypatch.setattr("lab.files.recording_reader.IN_MEMORY", 100)
    recording = load(tmp_path / "r.h5")
    assert not isinstance(recording.records[0].outputs, np.ndarray)
    blocks = [y for _, y in recording.records[0].blocks(7)]
    np.testing.assert_array_equal(np.concatenate(blocks, axis=1), bench().records[0].outputs)


@pytest.mark.parametrize("size", [1, 7, 49, 50, 400])
def test_blocks_of_any_size_give_the_same_data(tmp_path, monkeypatch, size):
    monkeypatch.setattr("lab.files.recording_writer.CHUNK", 8 * 2 * 16)
    whole = bench(403).records[0]
    with RecordingWriter(tmp_path / "r.h5", bench().inputs, bench().outputs, 100.0) as writer:
        for _ in range(2):
            writer.start("random")
            for u, y in whole.blocks(size):
                writer.append(u, y)
    for record in load(tmp_path / "r.h5").records:
        np.testing.assert_array_equal(record.inputs, whole.inputs)
        np.testing.assert_array_equal(record.outputs, whole.outputs)


def test_float32_halves_the_file(tmp_path):
    long = bench(100_000)
    save(long, tmp_path / "double.h5")
    save(long, tmp_path / "single.h5", dtype=np.float32)
    sizes = [(tmp_path / name).stat().st_size for name in ("double.h5", "single.h5")]
    assert sizes[1] < 0.6 * sizes[0]
    single = load(tmp_path / "single.h5").records[0].outputs
    np.testing.assert_array_equal(single, np.asarray(long.records[0].outputs, np.float32))


def test_same_recording_same_bytes(tmp_path):
    for name in ("a.h5", "b.h5"):
        save(bench(), tmp_path / name)
    assert (tmp_path / "a.h5").read_bytes() == (tmp_path / "b.h5").read_bytes()


def test_a_failed_writing_leaves_the_old_file_and_nothing_else(tmp_path):
    path = tmp_path / "r.h5"
    save(bench(), path)
    before = path.read_bytes()

    class BrokenError(Exception):
        pass

    def fail():
        with RecordingWriter(path, bench().inputs, bench().outputs, 100.0) as writer:
            writer.start("random")
            writer.append(np.zeros((1, 5)), np.zeros((2, 5)))
            raise BrokenError

    with pytest.raises(BrokenError):
        fail()
    assert path.read_bytes() == before
    assert [each.name for each in tmp_path.iterdir()] == ["r.h5"]


def test_reserved_attributes_are_refused(tmp_path):
    with pytest.raises(FileError, match="'kind' belongs to the format"):
        RecordingWriter(tmp_path / "r.h5", (), bench().outputs, 1.0, attributes={"kind": "x"})
    assert list(tmp_path.iterdir()) == []


def damage(path, how):
    with h5py.File(path, "r+") as file:
        how(file)


def rename_format(file):
    file.attrs["format"] = "holiday-pictures"


def other_version(file):
    file.attrs["version"] = 2


def no_records(file):
    del file["records"]


def no_outputs(file):
    del file["records/0/outputs"]


def no_units(file):
    del file["records/0/outputs"].attrs["units"]


def odd_unit(file):
    file["records/0/outputs"].attrs["units"] = ["m/s^2", "furlong"]


def one_name(file):
    file["records/0/outputs"].attrs["names"] = ["a0"]


def odd_kind(file):
    file["records/0"].attrs["kind"] = "earthquake"


def rate_as_text(file):
    file["records/0"].attrs["sample_rate"] = "fast"


def negative_rate(file):
    file["records/0"].attrs["sample_rate"] = -1.0


def text_for_numbers(file):
    attributes = dict(file["records/0/outputs"].attrs)
    del file["records/0/outputs"]
    file["records/0/outputs"] = np.array([[b"a"], [b"b"]])
    file["records/0/outputs"].attrs.update(attributes)


def lengths_differ(file):
    file["records/0/inputs"].resize(7, axis=1)


@pytest.mark.parametrize(
    ("how", "says"),
    [
        (rename_format, "format is 'holiday-pictures'; expected 'modal-recording'"),
        (other_version, "version is 2; this lab reads version 1"),
        (no_records, "holds no record"),
        (no_outputs, "has no dataset 'outputs'"),
        (no_units, "has no attribute 'units'"),
        (odd_unit, "unit 'furlong' is unknown"),
        (one_name, "1 names and 2 units"),
        (odd_kind, "'earthquake' is unknown; expected one of pulse"),
        (rate_as_text, "sample_rate = fast; expected a number"),
        (negative_rate, "expected a positive number"),
        (text_for_numbers, "expected numbers"),
        (lengths_differ, "expected equal lengths"),
    ],
)
def test_odd_files_are_refused_in_one_line(tmp_path, how, says):
    path = tmp_path / "r.h5"
    save(bench(), path)
    damage(path, how)
    with pytest.raises(FileError) as caught:
        load(path)
    assert says in str(caught.value)
    assert str(path) in str(caught.value)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("share", [0.01, 0.3, 0.9, 0.999])
def test_truncated_files_are_refused(tmp_path, share):
    path = tmp_path / "r.h5"
    save(bench(5000), path)
    whole = path.read_bytes()
    path.write_bytes(whole[: int(share * len(whole))])
    with pytest.raises(FileError, match="damaged"):
        load(path)


def test_other_files_are_refused(tmp_path):
    (tmp_path / "notes.txt").write_text("hello")
    with pytest.raises(FileError, match="not an HDF5 file"):
        load(tmp_path / "notes.txt")
    with pytest.raises(FileError, match="no such file"):
        load(tmp_path / "absent.h5")
    with pytest.raises(FileError, match="is a folder"):
        load(tmp_path)
