"""Recipes turn columns into channels, records and frequency responses."""

import hashlib

import numpy as np
import pytest

from lab.errors import FileError, StudyError
from lab.files.importing import read_foreign, save_imported
from lab.files.importing_columns import AmbiguousFileError
from lab.files.recipe import Recipe, load_recipe, parse_recipe
from lab.files.recording import load
from lab.files.recording_responses import load_responses
from lab.files.units import to_si
from tests.lab import universal

READINGS = np.random.default_rng(8).integers(-900, 900, size=(12, 2)).astype(float)
RECIPE = """
title = "Cart"
kind = "free_decay"
sample_rate = 200.0

[table]
columns = ["I", "X"]

[[inputs]]
name = "current"
column = "I"
unit = "A"
offset = -0.5

[[outputs]]
name = "position"
column = 2
unit = "cm"
sensitivity = 560.0
sign = -1
dof = "x1"
"""


def table(folder, values=READINGS, name="data.csv"):
    folder.mkdir(exist_ok=True)
    np.savetxt(folder / name, values, fmt="%.17g", delimiter=",")
    return folder / name


def test_channels_are_scaled_to_si(tmp_path):
    found = read_foreign(table(tmp_path), parse_recipe(RECIPE)).recording
    # Counts / 560 are centimetres; rounding of a product or two.
    np.testing.assert_allclose(found.records[0].outputs[0], -READINGS[:, 1] / 560 / 100, rtol=1e-15)
    np.testing.assert_array_equal(found.records[0].inputs[0], READINGS[:, 0] + 0.5)
    assert (found.outputs[0].unit, found.outputs[0].dof, found.title) == ("m", "x1", "Cart")
    assert found.records[0].kind == "free_decay"


def test_recipe_and_hash_travel_with_the_recording(tmp_path):
    path = table(tmp_path)
    save_imported(read_foreign(path, parse_recipe(RECIPE)), tmp_path / "out.h5")
    found = load(tmp_path / "out.h5")
    assert found.attributes["recipe"] == RECIPE
    assert found.attributes["source_sha256"] == hashlib.sha256(path.read_bytes()).hexdigest()
    assert found.attributes["source_file"] == "data.csv"
    again = read_foreign(path, parse_recipe(str(found.attributes["recipe"]))).recording
    np.testing.assert_array_equal(found.records[0].outputs, again.records[0].outputs)


def test_samples_are_dropped_marked_and_cut_into_records(tmp_path):
    more = "drop_first = 1\ndrop_last = 2\nmissing = [[3, 5]]\n"
    found = read_foreign(table(tmp_path), parse_recipe(more + RECIPE)).recording
    expected = READINGS[:, 0] + 0.5
    expected[3:5] = np.nan
    np.testing.assert_array_equal(found.records[0].inputs[0], expected[1:-2])
    pieces = '[[records]]\nstop = 4\n[[records]]\nstart = 6\nkind = "random"\nnote = "loud"\n'
    found = read_foreign(table(tmp_path), parse_recipe(RECIPE + pieces)).recording
    assert [(r.kind, r.n_samples, r.note) for r in found.records] == [
        ("free_decay", 4, ""),
        ("random", 6, "loud"),
    ]
    np.testing.assert_array_equal(found.records[1].inputs[0], READINGS[6:, 0] + 0.5)


@pytest.mark.parametrize(("stack", "lengths"), [("time", [36]), ("records", [12, 12, 12])])
def test_a_folder_of_blocks_is_stacked_in_natural_order(tmp_path, stack, lengths):
    for number, name in ((0, "data1.csv"), (1, "data2.csv"), (2, "data10.csv")):
        table(tmp_path / "in", READINGS + 1000 * number, name)
    (tmp_path / "in" / "readme.txt").write_text("not data")
    recipe = parse_recipe(RECIPE + f'[blocks]\nfiles = "data*.csv"\nstack = "{stack}"\n')
    found = read_foreign(tmp_path / "in", recipe).recording
    assert [record.n_samples for record in found.records] == lengths
    joined = np.concatenate([record.inputs[0] for record in found.records])
    np.testing.assert_array_equal(joined, np.concatenate([READINGS[:, 0] + 1000 * k + 0.5 for k in range(3)]))


def test_a_column_of_time_gives_or_checks_the_rate(tmp_path):
    time = 1e3 * np.arange(12) / 64
    recipe = RECIPE.replace("sample_rate = 200.0", 'time = "t"\ntime_unit = "ms"').replace(
        '["I"', '["t", "I"'
    )
    recipe = recipe.replace("column = 2", "column = 3")
    path = table(tmp_path, np.column_stack([time, READINGS]))
    assert read_foreign(path, parse_recipe(recipe)).recording.sample_rate == 64.0
    stated = parse_recipe("sample_rate = 64.0\n" + recipe)
    assert read_foreign(path, stated).recording.sample_rate == 64.0
    with pytest.raises(FileError, match="where the stated 72 Hz puts it"):
        read_foreign(path, parse_recipe("sample_rate = 72.0\n" + recipe))
    time[7:] += 1e3 / 64
    path = table(tmp_path, np.column_stack([time, READINGS]))
    for refused in (recipe, "sample_rate = 64.0\n" + recipe):
        with pytest.raises(FileError, match=r"uneven|puts it"):
            read_foreign(path, parse_recipe(refused))


def test_frequency_responses_in_decibel_and_degrees(tmp_path):
    f = np.arange(1, 9) * 0.3125
    H = np.random.default_rng(9).normal(size=(8, 2)) @ [1, 1j]
    columns = np.column_stack([f, 20 * np.log10(np.abs(H)), np.degrees(np.angle(H))])
    recipe = """
[frequency]
column = 1
unit = "Hz"
[[inputs]]
name = "hammer"
unit = "kN"
[[outputs]]
name = "tip"
unit = "g"
sign = -1
[[responses]]
output = "tip"
input = "hammer"
magnitude = 2
phase = 3
magnitude_unit = "dB"
phase_unit = "deg"
"""
    found = read_foreign(table(tmp_path, columns), parse_recipe(recipe))
    save_imported(found, tmp_path / "out.h5")
    response = load_responses(tmp_path / "out.h5")
    # g per kN in m/s^2 per N, turned round; logarithm and angle cost a few digits.
    np.testing.assert_allclose(response.values[:, 0, 0], -H * 9.80665e-3, rtol=1e-13)
    np.testing.assert_array_equal(response.frequency_hz, f)
    assert (response.outputs[0].unit, response.inputs[0].unit, response.dt) == ("m/s^2", "N", 0.0)
    assert response.scale == "known"
    with pytest.raises(FileError, match="frequency responses and no samples"):
        load(tmp_path / "out.h5")
    # The same readings, taken for jerk per force of unknown scale, on some lines.
    more = recipe.replace(
        'unit = "Hz"', 'unit = "Hz"\nlowest = 0.6\nhighest = 1.9\nscale = "unknown per input"'
    )
    found = read_foreign(table(tmp_path, columns), parse_recipe(more + "derivatives = 1\n"))
    save_imported(found, tmp_path / "jerk.h5")
    jerk = load_responses(tmp_path / "jerk.h5")
    assert jerk.scale == "unknown per input"
    np.testing.assert_array_equal(jerk.frequency_hz, f[1:6])
    np.testing.assert_allclose(
        jerk.values[:, 0, 0], (response.values[:, 0, 0] / (2j * np.pi * f))[1:6], rtol=1e-13
    )
    # A line at 0 Hz has no derivative to be undone; an integral has.
    columns[0, 0] = 0.0
    with pytest.raises(FileError, match="tells nothing at 0 Hz; set lowest above 0"):
        read_foreign(table(tmp_path, columns), parse_recipe(recipe + "derivatives = 1\n"))
    save_imported(
        read_foreign(table(tmp_path, columns), parse_recipe(recipe + "derivatives = -1\n")), tmp_path / "0.h5"
    )
    assert load_responses(tmp_path / "0.h5").values[0, 0, 0] == 0
    with pytest.raises(FileError, match="no line lies between 7 and inf Hz; there are 8 from 0 to"):
        read_foreign(
            table(tmp_path, columns), parse_recipe(recipe.replace('unit = "Hz"', 'unit = "Hz"\nlowest = 7.0'))
        )


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("kind = ", "not TOML"),
        ("colour = 1", "unknown key 'colour' at the top"),
        ('[[outputs]]\nname = "a"\nunits = "N"', "unknown key 'units' in"),
        ('[[outputs]]\nunit = "N"', "'name' is missing"),
        ('kind = "loud"', "kind = 'loud'"),
        ("sample_rate = 0.0", "greater than 0"),
        ('sample_rate = "?"\n[[outputs]]\nname = "a"\nfactor = "2"', "factor = '2'"),
        ('[[outputs]]\nname = "a"\nsensitivity = 0.0', "must not be zero"),
        ('[[outputs]]\nname = "a"\nsign = 2', "sign = 2"),
        ('[blocks]\nfiles = "*"\nstack = "?"', "stack = '?'"),
        ("missing = [[1]]", "missing"),
        ('[frequency]\ncolumn = 1\nunit = "Hz"', "belong together"),
        (
            '[frequency]\ncolumn = 1\nunit = "Hz"\n[[responses]]\noutput = "a"\ninput = "b"\nmagnitude = 2',
            "needs value",
        ),
        ("record = 1\n[[records]]\nstart = 1", "cannot be combined"),
    ],
)
def test_a_wrong_recipe_is_one_line(tmp_path, text, says):
    (tmp_path / "r.toml").write_text(text)
    with pytest.raises(StudyError, match=says) as raised:
        load_recipe(tmp_path / "r.toml")
    assert "\n" not in str(raised.value)
    assert "r.toml" in str(raised.value)


@pytest.mark.parametrize(
    ("old", "new", "says"),
    [
        ("sample_rate = 200.0", "", "no sample rate"),
        ("sample_rate = 200.0", 'sample_rate = "fs"', "no single number"),
        ('unit = "cm"', "", "no unit"),
        ('unit = "cm"', 'unit = "?"', "unit '\\?' is unknown"),
        ("column = 2", "column = 3", "column 3 does not exist"),
        ('column = "I"', 'column = "J"', "there are I, X"),
        ("sample_rate", "drop_first = 12\nsample_rate", "make no record"),
    ],
)
def test_what_a_recipe_leaves_open_is_one_line(tmp_path, old, new, says):
    with pytest.raises((FileError, StudyError), match=says) as raised:
        read_foreign(table(tmp_path), parse_recipe(RECIPE.replace(old, new, 1)))
    assert "\n" not in str(raised.value)


def test_the_starting_recipe_reads_the_file_once_its_questions_are_answered(tmp_path):
    path = table(tmp_path)
    with pytest.raises(AmbiguousFileError) as raised:
        read_foreign(path)
    start = raised.value.recipe
    with pytest.raises(FileError, match="unit '\\?' is unknown"):
        read_foreign(path, parse_recipe(start))
    assert path.read_text().splitlines()[0] in start
    answered = start.replace('sample_rate = "?"', "sample_rate = 10.0").replace('unit = "?"', 'unit = "mm"')
    found = read_foreign(path, parse_recipe(answered)).recording
    np.testing.assert_allclose(found.records[0].outputs, READINGS.T * 1e-3, rtol=1e-15)


@pytest.mark.parametrize("name", ["data.xls", "data", "data.h5"])
def test_an_unknown_suffix_is_one_line(tmp_path, name):
    (tmp_path / name).write_text("1,2\n")
    with pytest.raises(FileError, match="expected one of"):
        read_foreign(tmp_path / name)


def test_two_channels_of_one_name_are_one_line(tmp_path):
    recipe = RECIPE + '[[outputs]]\nname = "position"\ncolumn = "I"\nunit = "A"\n'
    with pytest.raises(FileError, match="appears twice"):
        read_foreign(table(tmp_path), parse_recipe(recipe))


def test_a_pattern_must_stay_in_its_folder(tmp_path):
    table(tmp_path)
    (tmp_path / "in").mkdir()
    recipe = parse_recipe(RECIPE + '[blocks]\nfiles = "../*.csv"\nstack = "time"\n')
    with pytest.raises(FileError, match="leaves the folder"):
        read_foreign(tmp_path / "in", recipe)


def test_nothing_is_left_behind_when_writing_fails(tmp_path):
    found = read_foreign(table(tmp_path), parse_recipe(RECIPE))
    with pytest.raises(FileError, match="cannot be written"):
        save_imported(found, tmp_path / "none" / "out.h5")
    assert sorted(path.name for path in tmp_path.iterdir()) == ["data.csv"]


def test_units_of_the_recipe_are_those_of_the_lab():
    assert to_si("cm") == ("m", 0.01)
    assert Recipe().kind is None


def test_signals_and_responses_of_one_file_lie_in_one_recording(tmp_path):
    f = np.arange(1, 9) * 0.5
    H = np.random.default_rng(11).normal(size=(8, 2)) @ [1, 1j]
    about = {"kind": 4, "x_type": 18, "below_type": 13, "below_label": "N", "ref_node": 1, "ref_direction": 1}
    signal = universal.function(READINGS[:, 0], np.arange(12) / 50, binary="<")
    (tmp_path / "both.uff").write_bytes(signal + universal.function(H, f, binary="<", **about))
    save_imported(read_foreign(tmp_path / "both.uff"), tmp_path / "out.h5")
    np.testing.assert_array_equal(load(tmp_path / "out.h5").records[0].outputs[0], READINGS[:, 0])
    np.testing.assert_array_equal(load_responses(tmp_path / "out.h5").values[:, 0, 0], H)


@pytest.mark.parametrize("name", ["text.uff", "binary.uff", "table.csv"])
def test_a_file_with_bytes_changed_or_lost_is_read_or_refused_in_one_line(tmp_path, name):
    rng = np.random.default_rng(12)
    t = np.arange(12) / 50
    whole = {
        "text.uff": universal.nodes({1: (0, 0, 1.0)})
        + universal.units(1.0, 1.0)
        + universal.function(READINGS[:, 0], t)
        + universal.mode(1, {1: [1j, 0, 2.0]}, pole=-1 + 9j),
        "binary.uff": universal.function(READINGS[:, 0], t, binary="<"),
        "table.csv": b"I,X\n" + b"".join(b"%g,%g\n" % tuple(row) for row in READINGS),
    }[name]
    recipe = (
        parse_recipe(RECIPE.partition("[table]")[0] + RECIPE.partition('"X"]\n')[2])
        if name == "table.csv"
        else None
    )
    messages = []
    for _ in range(60):
        broken = bytearray(whole)
        start = int(rng.integers(len(whole)))
        if rng.random() < 0.5:
            broken[start] = int(rng.integers(256))
        else:
            del broken[start : start + int(rng.integers(1, 60))]
        (tmp_path / name).write_bytes(broken)
        try:
            read_foreign(tmp_path / name, recipe)
        except FileError as error:
            messages.append(str(error))
    assert messages
    assert not [message for message in messages if "\n" in message]
