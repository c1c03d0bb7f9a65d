"""What the lab writes for other programs says the same as its own files."""

import csv
import json

import numpy as np
import pytest
import scipy.io

from identification.recording import Channel, Record, Recording
from lab.errors import FileError
from lab.files.exporting import export_file
from lab.files.importing import read_foreign
from lab.files.recipe import parse_recipe
from lab.files.recording import save

MASS = np.array([[2.0, 0.1], [0.1, 1 / 3]])
STIFFNESS = np.array([[5.0, -1.0 - 1e-15], [-1.0, np.pi]])
RESULT = {
    "format": "modal-result",
    "version": 1,
    "title": "two masses",
    "modes": [
        {"frequency_hz": 0.2, "damping_ratio": 0.01, "shape": {"a.x": [1.0, 0.5], "b.x": [-0.25, 0.0]}}
    ],
    "second_order": {
        "dofs": ["x1", "x2"],
        "mass": MASS.tolist(),
        "damping": (0.1 * MASS).tolist(),
        "stiffness": STIFFNESS.tolist(),
        "mass_std": (0.01 * MASS).tolist(),
        "damping_std": None,
        "stiffness_std": None,
    },
}


@pytest.fixture
def recording():
    rng = np.random.default_rng(10)
    inputs, outputs = (Channel('f, "left"', "N"),), (Channel("a.x", "m/s^2"), Channel("b.x", "m/s^2"))
    records = [Record("random", rng.normal(size=(1, n)), rng.normal(size=(2, n))) for n in (9, 7)]
    return Recording(tuple(records), inputs, outputs, 610.3515625)


@pytest.fixture
def folder(recording, tmp_path):
    (tmp_path / "out").mkdir()
    save(recording, tmp_path / "out" / "recording.h5")
    (tmp_path / "out" / "result.json").write_text(json.dumps(RESULT))
    return tmp_path / "out"


def test_csv_holds_every_digit_and_comes_back(recording, folder, tmp_path):
    path = export_file(folder, tmp_path / "data.csv").path
    with path.open(newline="") as file:
        head, *rows = csv.reader(file)
    assert head == ["record", "time [s]", 'f, "left" [N]', "a.x [m/s^2]", "b.x [m/s^2]"]
    values = np.array(rows, dtype=float)
    np.testing.assert_array_equal(values[:9, 3:].T, recording.records[0].outputs)
    np.testing.assert_array_equal(values[9:, 2], recording.records[1].inputs[0])
    np.testing.assert_array_equal(values[9:, 1], np.arange(7) / 610.3515625)


def test_csv_comes_back_through_a_recipe(recording, folder, tmp_path):
    plain = Recording(recording.records, (Channel("f", "N"),), recording.outputs, recording.sample_rate)
    save(plain, folder / "recording.h5")
    path = export_file(folder, tmp_path / "data.csv").path
    recipe = (
        'kind = "random"\nsample_rate = 610.3515625\ntime = "time"\nrecord = "record"\n'
        '[[inputs]]\nname = "f"\n[[outputs]]\nname = "a.x"\n[[outputs]]\nname = "b.x"\n'
    )
    found = read_foreign(path, parse_recipe(recipe)).recording
    assert (found.inputs, found.outputs, found.sample_rate) == (
        plain.inputs,
        plain.outputs,
        plain.sample_rate,
    )
    for a, b in zip(found.records, plain.records, strict=True):
        np.testing.assert_array_equal(a.inputs, b.inputs)
        np.testing.assert_array_equal(a.outputs, b.outputs)


def test_matlab_gets_matrices_and_modes(folder, tmp_path):
    path = export_file(folder, tmp_path / "matrices.mat").path
    found = scipy.io.loadmat(path)
    np.testing.assert_array_equal(found["M"], MASS)
    np.testing.assert_array_equal(found["K"], STIFFNESS)
    np.testing.assert_array_equal(found["M_std"], 0.01 * MASS)
    assert "K_std" not in found
    assert [str(each[0][0]) for each in found["dofs"]] == ["x1", "x2"]
    np.testing.assert_array_equal(found["shapes"], [[1 + 0.5j], [-0.25]])


def test_matlab_gets_signals(recording, folder, tmp_path):
    path = export_file(folder, tmp_path / "data.mat").path
    found = scipy.io.loadmat(path)
    np.testing.assert_array_equal(found["outputs_1"], recording.records[1].outputs)
    assert found["sample_rate"].item() == recording.sample_rate
    assert [str(each[0][0]) for each in found["output_units"]] == ["m/s^2", "m/s^2"]


@pytest.mark.parametrize(
    ("name", "matrix"), [("M", MASS), ("K", STIFFNESS), ("stiffness", STIFFNESS), ("C", 0.1 * MASS)]
)
def test_matrix_market_holds_every_digit(folder, tmp_path, name, matrix):
    path = export_file(folder, tmp_path / f"{name}.mtx").path
    head, comment, size, *numbers = path.read_text().splitlines()
    symmetric = bool(np.array_equal(matrix, matrix.T))
    assert head == f"%%MatrixMarket matrix array real {'symmetric' if symmetric else 'general'}"
    assert "x1, x2" in comment
    assert size == "2 2"
    # Column by column; of a symmetric matrix the lower half.
    expected = [*matrix[:, 0], *matrix[1:, 1]] if symmetric else matrix.T.ravel()
    assert [float(text) for text in numbers] == list(expected)


@pytest.mark.parametrize(
    ("to", "settings", "says"),
    [
        ("a.xls", {}, "expected .uff"),
        ("a.mat", {}, "say which with --what"),
        ("a.uff", {}, "say which with --what"),
        ("a.csv", {"what": "modes"}, "cannot be written as .csv"),
        ("a.mtx", {}, "expected one of M.mtx, C.mtx, K.mtx"),
        ("none/M.mtx", {}, "cannot be written"),
    ],
)
def test_what_cannot_be_exported_is_one_line_and_leaves_nothing(folder, tmp_path, to, settings, says):
    with pytest.raises(FileError, match=says) as raised:
        export_file(folder, tmp_path / to, **settings)
    assert "\n" not in str(raised.value)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["out"]


@pytest.mark.parametrize(
    ("change", "to", "says"),
    [
        ({"second_order": None}, "M.mtx", "holds no mass"),
        ({"second_order": None, "modes": []}, "matrices.mat", "neither modes nor matrices"),
        ({"modes": []}, "modes.uff", "no mode"),
        ({"modes": [{"frequency_hz": 1.0}]}, "modes.uff", "damaged"),
        ({"format": "other"}, "modes.uff", "expected 'modal-result'"),
    ],
)
def test_a_poor_result_is_one_line(folder, tmp_path, change, to, says):
    (folder / "result.json").write_text(json.dumps(RESULT | change))
    with pytest.raises(FileError, match=says):
        export_file(folder, tmp_path / to)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["out"]


def test_units_of_shapes_come_from_a_recording(folder, tmp_path):
    (folder / "recording.h5").rename(tmp_path / "elsewhere.h5")
    with pytest.raises(FileError, match="--recording"):
        export_file(folder / "result.json", tmp_path / "modes.uff")
    done = export_file(folder / "result.json", tmp_path / "modes.uff", recording=tmp_path / "elsewhere.h5")
    modes = read_foreign(done.path).modes
    pole = 2 * np.pi * 0.2 * (-0.01 + 1j * np.sqrt(1 - 1e-4))
    # Accelerations over λ², with six digits.
    np.testing.assert_allclose(modes.shapes[:, 0], np.array([1 + 0.5j, -0.25]) / pole**2, rtol=1e-5)
