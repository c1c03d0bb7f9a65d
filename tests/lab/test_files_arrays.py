"""Arrays of NumPy, JSON and MATLAB files as columns."""

import json
import pickle

import h5py
import numpy as np
import pytest
import scipy.io

from lab.errors import FileError
from lab.files.arrays import read_json, read_numpy
from lab.files.matlab import read_matlab
from lab.files.recipe_parts import ArraysPart

X = np.random.default_rng(7).normal(size=(5, 3))
H = X[:, 0] + 1j * X[:, 1]


def npz(path):
    np.savez(path, x=X, v=X[:, 0], row=X[:1], rate=50.0, name="tower", H=H)


def matlab5(path):
    variables = {"x": X, "v": X[:, :1], "row": X[:1], "rate": 50.0, "name": "tower", "H": H}
    scipy.io.savemat(path, variables)


def matlab73(path):
    """As MATLAB writes it: axes in reverse, complex numbers as pairs, texts as codes, behind a block of 512 bytes."""
    with h5py.File(path, "w", userblock_size=512) as file:
        file["x"], file["v"], file["row"] = X.T, X[:, :1].T, X[:1].T
        file["rate"] = np.array([[50.0]])
        file["name"] = np.array([[ord(letter)] for letter in "tower"], dtype=np.uint16)
        file["name"].attrs["MATLAB_class"] = np.bytes_("char")
        pairs = np.zeros((1, 5), dtype=[("real", "f8"), ("imag", "f8")])
        pairs["real"], pairs["imag"] = H.real, H.imag
        file["H"] = pairs
        file["#refs#/a"] = X
    with path.open("r+b") as file:
        file.write(b"MATLAB 7.3 MAT-file".ljust(512))


def as_json(path):
    path.write_text(
        json.dumps({"x": X.tolist(), "v": X[:, 0].tolist(), "row": X[:1].tolist(), "rate": 50.0, "name": "t"})
    )


FORMS = {
    "a.npz": (npz, read_numpy),
    "five.mat": (matlab5, read_matlab),
    "seven.mat": (matlab73, read_matlab),
    "a.json": (as_json, read_json),
}


@pytest.fixture(params=FORMS)
def form(request, tmp_path):
    write, read = FORMS[request.param]
    write(tmp_path / request.param)
    return lambda **part: read(tmp_path / request.param, ArraysPart(**part))


def test_vectors_scalars_and_matrices_are_told_apart(form):
    found = form()
    np.testing.assert_array_equal(found.real("v"), X[:, 0])
    np.testing.assert_array_equal(found.real("row"), X[0])
    assert found.scalars == {"rate": 50.0}
    assert found.unclear == {"x": (5, 3)}
    with pytest.raises(FileError, match="samples"):
        found.real("x[1]")
    if "H" in found.columns:
        np.testing.assert_array_equal(found.columns["H"], H)
        with pytest.raises(FileError, match="complex"):
            found.real("H")


def test_a_recipe_says_where_time_runs(form):
    np.testing.assert_array_equal(form(samples="rows").real("x[2]"), X[:, 1])
    np.testing.assert_array_equal(form(samples="columns").real("x[2]"), X[1])


def test_fields_of_structures_have_dotted_names(tmp_path):
    scipy.io.savemat(tmp_path / "s.mat", {"test": {"acc": {"x": X[:, 0]}}})
    (tmp_path / "s.json").write_text(json.dumps({"test": {"acc": {"x": X[:, 0].tolist()}}}))
    for found in (
        read_matlab(tmp_path / "s.mat", ArraysPart()),
        read_json(tmp_path / "s.json", ArraysPart()),
    ):
        np.testing.assert_array_equal(found.real("test.acc.x"), X[:, 0])


def test_a_bare_array_is_called_array(tmp_path):
    np.save(tmp_path / "a.npy", X)
    np.testing.assert_array_equal(
        read_numpy(tmp_path / "a.npy", ArraysPart(samples="rows")).real("array[3]"), X[:, 2]
    )


@pytest.mark.parametrize(
    "content", [b"", b"nonsense", b"\x93NUMPY\1\0", b"PK\3\4 broken", b"\x89HDF\r\n\x1a\n broken"]
)
@pytest.mark.parametrize("name", ["a.npy", "a.npz", "a.mat", "a.json"])
def test_a_damaged_file_is_one_line(tmp_path, name, content):
    (tmp_path / name).write_bytes(content)
    read = {".mat": read_matlab, ".json": read_json}.get(name[1:], read_numpy)
    with pytest.raises(FileError, match="cannot be read") as raised:
        read(tmp_path / name, ArraysPart())
    assert "\n" not in str(raised.value)


def test_objects_are_refused_because_they_could_run_foreign_code(tmp_path):
    (tmp_path / "a.npy").write_bytes(pickle.dumps({"a": 1}))
    np.savez(tmp_path / "a.npz", a=np.array([{}], dtype=object))
    for name in ("a.npy", "a.npz"):
        with pytest.raises(FileError, match="cannot be read"):
            read_numpy(tmp_path / name, ArraysPart())
