"""Universal files written by hand from the record layouts come out as the numbers that went in."""

import numpy as np
import pytest

from lab.errors import FileError
from lab.files.importing import read_foreign
from lab.files.importing_columns import AmbiguousFileError
from lab.files.recipe import parse_recipe
from tests.lab import universal

RATE = 200.0
TIME = np.arange(40) / RATE
SIGNAL = np.random.default_rng(1).normal(size=40)
FORCE = np.random.default_rng(2).normal(size=40)
SIX, TWELVE = 6e-6, 6e-12
"""Relative rounding of numbers written with 6 and 12 digits: half a unit of the last."""


def written(folder, *sets, name="test.uff"):
    path = folder / name
    path.write_bytes(b"".join(sets))
    return path


def pair(**about):
    """A force and an acceleration at one point."""
    force = universal.function(FORCE, TIME, **({"type": 13, "label": "N"} | about))
    return force + universal.function(SIGNAL, TIME, **about)


@pytest.mark.parametrize(
    ("about", "tolerance"),
    [
        ({"double": True}, TWELVE),
        ({"double": False}, SIX),
        ({"double": True, "even": False}, TWELVE),
        ({"double": False, "even": False}, SIX),
        ({"binary": "<"}, 0),
        ({"binary": ">"}, 0),
        ({"binary": "<", "even": False}, 0),
        ({"binary": ">", "double": False}, 6e-8),  # 24 bits
    ],
)
def test_every_form_of_a_time_signal_is_read(tmp_path, about, tolerance):
    found = read_foreign(written(tmp_path, pair(**about))).recording
    assert found.sample_rate == pytest.approx(RATE, rel=1e-14)
    assert [(c.name, c.unit) for c in (*found.inputs, *found.outputs)] == [
        ("force 1+Z", "N"),
        ("acceleration 1+Z", "m/s^2"),
    ]
    np.testing.assert_allclose(found.records[0].outputs[0], SIGNAL, rtol=tolerance)
    np.testing.assert_allclose(found.records[0].inputs[0], FORCE, rtol=tolerance)


@pytest.mark.parametrize("about", [{}, {"even": False}, {"binary": "<"}, {"binary": ">", "even": False}])
def test_every_form_of_a_frequency_response_is_read(tmp_path, about):
    f = 0.5 * np.arange(1, 31)
    H = np.random.default_rng(3).normal(size=(30, 2, 2)) @ [1, 1j]
    about = {
        "kind": 4,
        "x_type": 18,
        "below_type": 13,
        "below_label": "N",
        "ref_node": 7,
        "ref_direction": -1,
    } | about
    sets = [universal.function(H[:, k], f, node=k + 1, **about) for k in range(2)]
    found = read_foreign(written(tmp_path, *sets)).response
    assert [c.name for c in found.outputs] == ["acceleration 1+Z", "acceleration 2+Z"]
    assert [(c.name, c.unit) for c in found.inputs] == [("force 7-X", "N")]
    np.testing.assert_allclose(found.frequency_hz, f, rtol=1e-14)
    np.testing.assert_allclose(found.values[:, :, 0], H, rtol=0 if "binary" in about else 1e-9)
    # Twelve digits of a number that is small beside its partner count for the absolute value.
    assert np.abs(found.values[:, :, 0] - H).max() < 1e-11


def test_labels_and_the_unit_system_give_si(tmp_path):
    # Forces in pounds, lengths in inches: numbers in the file are SI times 1 / 0.0254 and 1 / 4.448….
    inch, pound = 0.0254, 4.4482216152605
    system = universal.units(1 / inch, 1 / pound, code=7)
    silent = [{"label": "NONE"}, {"type": 13, "label": "NONE"}]
    labelled = [{"label": "in/s^2"}, {"type": 13, "label": "lbf"}]
    for labels in (silent, labelled):
        sets = [universal.function(SIGNAL, TIME, binary="<", **about) for about in labels]
        found = read_foreign(written(tmp_path, system, *sets)).recording
        np.testing.assert_allclose(found.records[0].outputs[0], SIGNAL * inch, rtol=1e-14)
        np.testing.assert_allclose(found.records[0].inputs[0], SIGNAL * pound, rtol=1e-14)


def test_a_label_alone_is_believed(tmp_path):
    found = read_foreign(written(tmp_path, universal.function(SIGNAL, TIME, label="g", binary="<"))).recording
    np.testing.assert_allclose(found.records[0].outputs[0], SIGNAL * 9.80665, rtol=1e-15)


@pytest.mark.parametrize(("believed", "factor"), [("labels", 9.80665), ("dataset 164", 1.0)])
def test_a_label_against_the_unit_system_is_asked_for(tmp_path, believed, factor):
    sets = universal.units(1.0, 1.0), universal.function(SIGNAL, TIME, label="g", binary="<")
    path = written(tmp_path, *sets)
    with pytest.raises(FileError, match="labels"):
        read_foreign(path)
    found = read_foreign(path, parse_recipe(f'uff_units = "{believed}"')).recording
    np.testing.assert_allclose(found.records[0].outputs[0], SIGNAL * factor, rtol=1e-15)


@pytest.mark.parametrize(
    ("about", "says"),
    [
        ({"label": "NONE"}, "no unit"),
        ({"type": 0}, "input or an output"),
        ({"label": "V"}, "is of type 12"),
        ({"label": "furlong"}, "unit 'furlong' is unknown"),
        ({"type": 9, "label": "N"}, "input or an output"),
    ],
)
def test_what_the_file_leaves_open_is_asked_for_and_a_recipe_settles_it(tmp_path, about, says):
    path = written(tmp_path, universal.function(SIGNAL, TIME, binary="<", **about))
    with pytest.raises(FileError, match=says):
        read_foreign(path)
    name = {0: "1+Z", 9: "reaction 1+Z"}.get(about.get("type"), "acceleration 1+Z")
    recipe = f'[[outputs]]\nname = "top"\ncolumn = "{name}"\nunit = "mm/s^2"\nsign = -1\n'
    found = read_foreign(path, parse_recipe(recipe)).recording
    np.testing.assert_allclose(found.records[0].outputs[0], -1e-3 * SIGNAL, rtol=1e-15)


def test_a_channel_that_comes_again_begins_the_next_record(tmp_path):
    found = read_foreign(written(tmp_path, pair(binary="<") * 3)).recording
    assert len(found.records) == 3


def test_signals_without_a_point_go_by_their_id_line(tmp_path):
    about = {"node": 0, "direction": 0, "binary": "<"}
    sets = [universal.function(SIGNAL * k, TIME, ids=(f"acc {k}", *("NONE",) * 4), **about) for k in (1, 2)]
    found = read_foreign(written(tmp_path, *sets)).recording
    assert [channel.name for channel in found.outputs] == ["acc 1", "acc 2"]
    assert len(found.records) == 1
    nameless = universal.function(SIGNAL, TIME, **about)
    with pytest.raises(FileError, match="without point"):
        read_foreign(written(tmp_path, nameless, nameless))


def test_the_starting_recipe_names_the_channels(tmp_path):
    path = written(tmp_path, universal.function(SIGNAL, TIME, type=0, entity="top", label="g", binary="<"))
    with pytest.raises(AmbiguousFileError) as raised:
        read_foreign(path)
    found = read_foreign(path, parse_recipe(raised.value.recipe)).recording
    # The unit stays that of the file, which must not be taken twice.
    np.testing.assert_allclose(found.records[0].outputs[0], SIGNAL * 9.80665, rtol=1e-15)


def test_a_step_of_six_digits_takes_the_better_rate_and_refuses_another(tmp_path):
    rate = 1651.0
    path = written(tmp_path, universal.function(SIGNAL, np.arange(40) / rate))
    plain = read_foreign(path).recording.sample_rate
    assert plain != rate
    assert plain == pytest.approx(rate, rel=SIX)
    assert read_foreign(path, parse_recipe("sample_rate = 1651.0")).recording.sample_rate == rate
    with pytest.raises(FileError, match="does not fit"):
        read_foreign(path, parse_recipe("sample_rate = 1652.0"))


def test_uneven_time_is_refused_unless_rounding_is_to_blame(tmp_path):
    t = np.arange(4000) / 1651.0
    short = written(tmp_path, universal.function(np.zeros(1000), t[:1000], even=False), name="short.uff")
    # Below 1 s, the sixth digit of time is a thousandth of a sample; beyond, a hundredth.
    assert read_foreign(short).recording.sample_rate == pytest.approx(1651.0, rel=SIX)
    path = written(tmp_path, universal.function(np.zeros(4000), t, even=False))
    with pytest.raises(FileError, match="only rounding is to blame"):
        read_foreign(path)
    assert read_foreign(path, parse_recipe("sample_rate = 1651.0")).recording.sample_rate == 1651.0
    gap = np.where(t > 1, t + 0.01, t)
    path = written(tmp_path, universal.function(np.zeros(4000), gap, even=False, binary="<"))
    with pytest.raises(FileError, match="uneven"):
        read_foreign(path)
    with pytest.raises(FileError, match="stated 1651"):
        read_foreign(path, parse_recipe("sample_rate = 1651.0"))


def test_modes_and_geometry_are_read(tmp_path):
    pole = -0.3 + 12.5j
    shape = {4: [1 + 2j, 0, 0.5], 9: [-3 + 0.25j, 0, 0]}
    sets = [
        universal.units(1e3, 1e3, code=5),
        universal.nodes({4: (0.0, 500.0, -1.0), 9: (1000.0, 0.0, 0.0)}),
        universal.trace([4, 9, 0, 9, 4]),
        universal.mode(1, shape, pole=pole),
    ]
    found = read_foreign(written(tmp_path, *sets))
    np.testing.assert_allclose(found.geometry.positions, [[0, 0.5, -1e-3], [1, 0, 0]], rtol=1e-12)
    assert found.geometry.lines == ((4, 9), (9, 4))
    modes = found.modes
    # The layout holds six digits, which the numbers above need not exceed.
    np.testing.assert_allclose(modes.poles, [pole], rtol=1e-12)
    assert [c.name for c in modes.outputs] == ["acceleration 4+X", "acceleration 4+Z", "acceleration 9+X"]
    np.testing.assert_allclose(modes.shapes[:, 0], np.array([1 + 2j, 0.5, -3 + 0.25j]) * 1e-3, rtol=1e-12)


def test_normal_modes_are_read_and_sorted(tmp_path):
    sets = [
        universal.mode(k, {1: [float(k), 0, 0]}, kind=8, frequency=f, damping=0.01 * k)
        for k, f in ((1, 9.0), (2, 4.0))
    ]
    modes = read_foreign(written(tmp_path, *sets)).modes
    assert modes.frequency_hz.tolist() == [4.0, 9.0]
    assert modes.damping_ratio.tolist() == [0.02, 0.01]
    assert modes.shapes.tolist() == [[2, 1]]
    assert modes.outputs[0].unit == "m"


def test_geometry_without_unit_is_left_out_with_a_note_until_a_recipe_states_it(tmp_path):
    path = written(tmp_path, universal.nodes({1: (1.0, 0, 0)}), universal.function(SIGNAL, TIME))
    found = read_foreign(path)
    assert found.geometry is None
    assert any("length_unit" in note for note in found.notes)
    found = read_foreign(path, parse_recipe('length_unit = "mm"'))
    assert found.geometry.positions.tolist() == [[1e-3, 0, 0]]


def test_padding_is_cut_and_other_functions_are_named(tmp_path):
    padded = universal.function(np.append(SIGNAL, 0.0), np.arange(41) / RATE, n=40)
    other = universal.function(SIGNAL, TIME, kind=2, x_type=18, node=5)
    found = read_foreign(written(tmp_path, padded, other))
    assert found.recording.n_samples == 40
    assert any("type 2 left out" in note for note in found.notes)


def test_line_ends_of_other_systems_are_read(tmp_path):
    text = pair().replace(b"\n", b"\r\n")
    binary = universal.function(SIGNAL, TIME, binary="<")
    # Some programs end the binary numbers with a line break.
    broken = binary[: -len(b"    -1\n")] + b"\r\n    -1\r\n"
    for content, tolerance in ((text, TWELVE), (broken, 0)):
        found = read_foreign(written(tmp_path, content)).recording
        np.testing.assert_allclose(found.records[0].outputs[0], SIGNAL, rtol=tolerance)


def test_real_shapes_with_rotations_have_rotations_in_radians(tmp_path):
    text = universal.mode(1, {3: [1.0, 0, 0]}, kind=8, frequency=2.0).decode()
    values = "".join(f"{value:13.5e}" for value in (1.0, 0.0, 0.0, 0.0, 0.5, 0.0))
    lines = text.splitlines()
    lines[7], lines[-2] = lines[7][:-1] + "6", values
    system = universal.units(1e3, 1.0)
    modes = read_foreign(written(tmp_path, system, ("\n".join(lines) + "\n").encode())).modes
    assert [(c.name, c.unit) for c in modes.outputs] == [
        ("displacement 3+X", "m"),
        ("displacement 3+RY", "rad"),
    ]
    np.testing.assert_allclose(modes.shapes[:, 0], [1e-3, 0.5], rtol=1e-12)


WHOLE = universal.function(SIGNAL, TIME)


@pytest.mark.parametrize(
    ("content", "says"),
    [
        (b"", "no data set"),
        (b"hello\n", "no data set"),
        (WHOLE[: len(WHOLE) // 2], "no data set"),
        (WHOLE + WHOLE[: len(WHOLE) // 2], "cut off"),
        (universal.function(SIGNAL, TIME, n=41), "promises 41"),
        (universal.function(SIGNAL, TIME, n=41, binary="<"), "promises 41"),
        (WHOLE.replace(b"    58", b"    99", 1), "nothing to import"),
        (WHOLE.replace(b"e-0", b"x-0"), "damaged"),
        (
            universal.function(SIGNAL, TIME, binary="<").replace(
                b"     2          11", b"     3          11"
            ),
            "floating-point",
        ),
        (universal.function(SIGNAL, TIME[::-1]), "time step"),
        (universal.units(0.0, 1.0) + WHOLE, "positive"),
        (universal.units(1.0, 1.0) + universal.units(2.0, 1.0) + WHOLE, "two unit systems"),
        (WHOLE + universal.function(SIGNAL[:20], TIME[:20], node=2), "differ in length"),
        (universal.function(SIGNAL, TIME, type=13, label="N"), "no response"),
        (universal.mode(1, {1: [1.0, 0, 0]}, pole=1j, kind=2), "specific types"),
        (universal.mode(1, {1: [1.0, 0, 0]}, pole=0j), "eigenvalue"),
    ],
)
def test_a_damaged_file_is_one_line(tmp_path, content, says):
    with pytest.raises(FileError, match=says) as raised:
        read_foreign(written(tmp_path, content))
    assert "\n" not in str(raised.value)
