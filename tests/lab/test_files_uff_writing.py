"""Universal files of the lab, read back by the lab and by a reader made from the record layouts alone."""

import itertools

import numpy as np
import pytest

from identification.modes import Modes
from identification.recording import Channel, Record, Recording
from identification.response import FrequencyResponse
from lab.errors import FileError
from lab.files.exporting import export_file
from lab.files.importing import read_foreign
from lab.files.importing_modes import save_modes
from lab.files.recording import save
from lab.files.recording_geometry import Geometry, add_geometry
from lab.files.recording_responses import save_responses
from tests.lab import universal

CHANNELS = (
    (Channel("hammer", "N"), Channel("drive", "V")),
    (Channel("a1.x", "m/s^2"), Channel("a1.z", "m/s^2"), Channel("gap", "m"), Channel("turn.y", "rad/s")),
)


@pytest.fixture
def recording():
    rng = np.random.default_rng(4)
    records = [
        Record(
            "impact",
            rng.normal(size=(2, n)),
            rng.normal(size=(4, n)) * 1e-7,
            start_time="2020-01-02T03:04:05",
        )
        for n in (50, 61)
    ]
    return Recording(tuple(records), *CHANNELS, 1651.0, "a test")


def exported(thing, folder, to="data.uff", **settings):
    save(thing, folder / "in.h5")
    return export_file(folder / "in.h5", folder / to, **settings).path


@pytest.mark.parametrize("text", [False, True])
def test_signals_come_back(recording, tmp_path, text):
    found = read_foreign(exported(recording, tmp_path, text=text)).recording
    assert (found.inputs, found.outputs, found.title) == (recording.inputs, recording.outputs, "a test")
    assert found.sample_rate == 1651.0
    for a, b in zip(found.records, recording.records, strict=True):
        assert (a.kind, a.start_time) == (b.kind, b.start_time)
        # Binary numbers are whole; as text, thirteen digits.
        np.testing.assert_allclose(a.outputs, b.outputs, rtol=6e-13 if text else 0)
        np.testing.assert_allclose(a.inputs, b.inputs, rtol=6e-13 if text else 0)


@pytest.mark.parametrize("text", [False, True])
def test_another_reader_finds_the_signals(recording, tmp_path, text):
    sets = universal.read(exported(recording, tmp_path, text=text))
    assert len(sets[151]) == len(sets[164]) == 1
    assert len(sets[58]) == 12
    each = sets[58][2]
    # Direction 1 is X; specific types 12 and 17 are acceleration and time.
    assert (each["kind"], each["node"], each["direction"], each["form"]) == (1, 1, 1, 4)
    assert (each["y_type"], each["y_label"], each["x_type"], each["x_label"]) == (12, "m/s^2", 17, "s")
    assert each["even"]
    assert each["n"] == 50
    assert each["step"] == pytest.approx(1 / 1651, rel=6e-7)
    np.testing.assert_allclose(each["values"], recording.records[0].outputs[0], rtol=6e-13 if text else 0)
    assert [each["y_type"] for each in sets[58][:6]] == [13, 0, 12, 12, 8, 11]
    assert sets[58][5]["direction"] == 5  # about Y


@pytest.mark.parametrize("even", [True, False])
@pytest.mark.parametrize("text", [False, True])
def test_frequency_responses_come_back(tmp_path, text, even):
    rng = np.random.default_rng(5)
    f = 0.3125 * np.arange(1, 33) if even else np.cumsum(rng.uniform(0.1, 1, size=32))
    values = rng.normal(size=(32, 2, 1, 2)) @ [1, 1j]
    response = FrequencyResponse(f, values, 0.0, CHANNELS[0][:1], CHANNELS[1][:2])
    save_responses(response, tmp_path / "in.h5")
    path = export_file(tmp_path / "in.h5", tmp_path / "data.uff", text=text).path
    found = read_foreign(path).response
    assert (found.inputs, found.outputs) == (response.inputs, response.outputs)
    np.testing.assert_allclose(found.values, values, rtol=1e-10 if text else 0)
    # As text, an uneven axis has seven digits.
    np.testing.assert_allclose(found.frequency_hz, f, rtol=0 if not text else 1e-14 if even else 6e-7)
    other = universal.read(path)[58]
    assert [(each["kind"], each["y_label"], each["d_label"], each["d_type"]) for each in other] == [
        (4, "m/s^2", "N", 13)
    ] * 2
    values_there = other[1]["values"].reshape(32, 2 if even else 3)[:, -2:] @ [1, 1j]
    np.testing.assert_allclose(values_there, values[:, 1, 0], rtol=1e-10 if text else 0)


def test_missing_samples_are_refused_rather_than_written_as_zeros(recording, tmp_path):
    outputs = recording.records[0].outputs.copy()
    outputs[1, 3] = np.nan
    broken = Recording((Record("other", np.zeros((0, 50)), outputs),), *CHANNELS, 10.0)
    with pytest.raises(FileError, match="misses samples"):
        exported(broken, tmp_path)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["in.h5"]


POLES = np.array([-0.11 + 3.0j, -0.4 + 20.0j])
DISPLACEMENT = np.array([[1.0, 0.3 - 0.2j], [0.5 + 0.1j, -0.7], [0.25j, 2.0]])


def modal(folder, names, units, powers):
    """A result whose shapes are those above, seen by sensors of displacement, velocity or acceleration."""
    outputs = tuple(Channel(name, unit) for name, unit in zip(names, units, strict=True))
    shapes = DISPLACEMENT * POLES ** np.array(powers)[:, None]
    save_modes(Modes.from_poles(POLES, shapes, outputs), folder / "result.json", {})
    return folder / "result.json"


def test_shapes_of_mixed_sensors_are_written_as_displacement(tmp_path):
    names, units = ("p1.x", "p1.z", "p2.y"), ("m", "m/s", "m/s^2")
    path = export_file(modal(tmp_path, names, units, [0, 1, 2]), tmp_path / "modes.uff").path
    written = universal.read(path)[55]
    for k, each in enumerate(written):
        # Structural, complex eigenvalue, three translations, displacement, complex, three values.
        assert each["about"] == [1, 3, 2, 8, 5, 3]
        # Six digits are what the layout holds.
        assert each["pole"] == pytest.approx(POLES[k], rel=6e-6)
        expected = np.zeros((2, 3), dtype=complex)
        expected[0, 0], expected[0, 2], expected[1, 1] = DISPLACEMENT[:, k]
        there = np.array([each["shape"][node] for node in (1, 2)])
        np.testing.assert_allclose(there, expected, rtol=1e-5, atol=1e-15)
    modes = read_foreign(path).modes
    np.testing.assert_allclose(modes.poles, POLES, rtol=6e-6)
    np.testing.assert_allclose(modes.shapes, DISPLACEMENT, rtol=1e-5, atol=1e-15)
    assert [c.name for c in modes.outputs] == ["displacement 1+X", "displacement 1+Z", "displacement 2+Y"]


POINTS = """
lines = [[3, 8]]
[channels]
a = { node = 3, direction = "-X", position = [0.0, 0.0, -1.0] }
b = { node = 8, direction = "+Y", position = [1.0, 0.5, 0.0] }
"""


def test_a_table_of_points_gives_geometry_and_signs(tmp_path):
    (tmp_path / "points.toml").write_text(POINTS)
    result = modal(tmp_path, ("a", "b", "c"), ("m", "m", "m"), [0, 0, 0])
    done = export_file(result, tmp_path / "modes.uff", points=tmp_path / "points.toml")
    assert any("'c' left out" in note for note in done.notes)
    sets = universal.read(done.path)
    assert sets[15] == [{3: (0, 0, -1), 8: (1, 0.5, 0)}]
    np.testing.assert_allclose(sets[55][0]["shape"][3][0], -DISPLACEMENT[0, 0], rtol=1e-5)
    assert read_foreign(done.path).geometry.lines == ((3, 8),)


def test_geometry_goes_through(recording, tmp_path):
    # More lines than one trace of 250 nodes holds.
    nodes = tuple(range(1, 201))
    positions = np.random.default_rng(6).integers(-9, 9, size=(200, 3)) / 4
    geometry = Geometry(nodes, positions, tuple(itertools.pairwise(nodes)))
    save(recording, tmp_path / "in.h5")
    add_geometry(geometry, tmp_path / "in.h5")
    found = read_foreign(export_file(tmp_path / "in.h5", tmp_path / "data.uff").path).geometry
    assert (found.nodes, found.lines) == (geometry.nodes, geometry.lines)
    np.testing.assert_array_equal(found.positions, positions)


def test_a_model_tells_where_its_sensors_are(tmp_path):
    from lab import catalogue
    from lab.rig import Rig

    rig = Rig.load(catalogue.find("models", "chain3_uncoupled"))
    modes = rig.connected(outputs=["pos1", "acc2.x", "acc3.x"]).modes()
    save_modes(modes, tmp_path / "result.json", {})
    path = export_file(tmp_path / "result.json", tmp_path / "modes.uff", model="chain3_uncoupled").path
    sets = universal.read(path)
    # Positions as the model file gives them; every mass is tied to every other.
    places = {(1.0, 0.5, 0.15): 1, (2.0, 0.0, 0.15): 2, (0.0, 0.0, 0.15): 0}
    assert set(sets[15][0].values()) == set(places)
    assert len(read_foreign(path).geometry.lines) == 3
    truth = rig.second_order().modes()
    by_mass = [next(node for node, at in sets[15][0].items() if places[at] == k) for k in range(3)]
    for k, each in enumerate(sets[55]):
        shape = np.array([each["shape"][node][0] for node in by_mass])
        ratio = shape / truth.shapes[:, k]
        np.testing.assert_allclose(ratio, ratio[0], rtol=3e-5)  # two numbers of six digits


@pytest.mark.parametrize(
    ("names", "settings", "says"),
    [
        (("a", "b", "c"), {}, "give --model or --points"),
        (("p.x", "q.x", "r.x"), {"model": "no_such_model"}, "no_such_model"),
        (("p.x", "q.x", "r.x"), {"points": "missing.toml"}, "cannot be read"),
    ],
)
def test_modes_without_a_place_are_refused(tmp_path, names, settings, says):
    from lab.errors import LabError

    result = modal(tmp_path, names, ("m", "m", "m"), [0, 0, 0])
    with pytest.raises(LabError, match=says):
        export_file(result, tmp_path / "modes.uff", **settings)
    assert not (tmp_path / "modes.uff").exists()


@pytest.mark.parametrize(
    "text", ["x", "[channels]\na = 1", '[channels]\na = { node = 0, direction = "+X" }', "lines = [[1, 2]]"]
)
def test_a_wrong_table_of_points_is_one_line(tmp_path, text):
    from lab.errors import StudyError
    from lab.files.exporting_points import load_points

    (tmp_path / "p.toml").write_text(text)
    with pytest.raises(StudyError) as raised:
        load_points(tmp_path / "p.toml")
    assert "\n" not in str(raised.value)
