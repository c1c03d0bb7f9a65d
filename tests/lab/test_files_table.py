"""Text tables in the ways that loggers write them."""

import gzip

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from lab.errors import FileError
from lab.files.recipe_parts import TablePart
from lab.files.table import read_table

NUMBERS = np.array([[0.0, 1.5, -2e-3], [0.1, -1.25, 4.0], [0.2, 7.0, 8e10]])


def table(folder, text, name="t.csv", **part):
    (folder / name).write_bytes(text if isinstance(text, bytes) else text.encode())
    return read_table(folder / name, TablePart(**part))


def body(separator, decimal=".", end="\n"):
    return (
        end.join(separator.join(repr(float(v)).replace(".", decimal) for v in row) for row in NUMBERS) + end
    )


@pytest.mark.parametrize("head", ["", "a{0}b{0}c\n", "# logger 7\n\n# a{0}b{0}c\n", '"a"{0}"b"{0}"c"\n'])
@pytest.mark.parametrize("separator", [",", ";", "\t", " ", ", ", " ; "])
def test_delimiters_and_headers_are_found(tmp_path, separator, head):
    found = table(tmp_path, head.format(separator) + body(separator))
    np.testing.assert_array_equal(np.array(list(found.columns.values())).T, NUMBERS)
    assert found.named == bool(head)
    assert list(found.columns) == (["a", "b", "c"] if head else ["column 1", "column 2", "column 3"])


@pytest.mark.parametrize(
    "text",
    [
        body(",", end="\r\n"),
        "\ufeff" + body(","),
        body(",").replace("\n", ",\n"),
        body(",").encode("utf-16"),
        # The time would be part of the name of the test, which all workers must agree on.
        gzip.compress(body(",").encode(), mtime=0),
    ],
)
def test_line_ends_marks_and_packing_do_not_matter(tmp_path, text):
    found = table(tmp_path, text)
    np.testing.assert_array_equal(np.array(list(found.columns.values())).T, NUMBERS)


@pytest.mark.parametrize("separator", [";", "\t", " "])
def test_a_decimal_comma_is_read_when_stated(tmp_path, separator):
    found = table(tmp_path, body(separator, decimal=","), decimal=",")
    np.testing.assert_array_equal(np.array(list(found.columns.values())).T, NUMBERS)


@pytest.mark.parametrize(
    ("head", "names", "units"),
    [
        ("t [s],force (N),x\n", ["t", "force", "x"], {"t": "s", "force": "N"}),
        ("t,force,acc\ns,kN,m/s²\n", ["t", "force", "acc"], {"t": "s", "force": "kN", "acc": "m/s²"}),
        ("t,force (left),acc\n", ["t", "force (left)", "acc"], {}),
        ("a comment, with a comma\n", ["column 1", "column 2", "column 3"], {}),
    ],
)
def test_units_are_taken_where_the_header_states_them(tmp_path, head, names, units):
    found = table(tmp_path, head + body(","))
    assert (list(found.columns), found.units) == (names, units)


def test_missing_samples_are_marked(tmp_path):
    found = table(tmp_path, "1,2\nNaN,--\n3,\n", missing=["--", ""], header_lines=0)
    np.testing.assert_array_equal(
        np.array(list(found.columns.values())).T, [[1, 2], [np.nan, np.nan], [3, np.nan]]
    )


@given(
    st.lists(st.lists(st.floats(allow_nan=False, allow_infinity=False), min_size=2, max_size=2), min_size=1)
)
def test_numbers_come_back_to_the_last_digit(tmp_path_factory, rows):
    text = "\n".join(",".join(map(repr, row)) for row in rows)
    found = table(tmp_path_factory.mktemp("t"), text)
    np.testing.assert_array_equal(np.array(list(found.columns.values())).T, rows)


@pytest.mark.parametrize(
    ("text", "part", "says"),
    [
        ("", {}, "no line of numbers"),
        ("only words\n", {}, "no line of numbers"),
        ("1,2\n3\n", {}, "line 2 has 1 columns; expected 2"),
        ("1,2\n3,x\n", {}, "line 2 holds 'x'"),
        ("1,2\n\n3,4\n", {}, "line 2 is empty"),
        ("1,2\n3,\n", {}, "line 2"),
        ("a,a\n1,2\n", {}, "'a' appears twice"),
        ("1,2\n", {"columns": ["a"]}, "has 2 columns"),
        ("1,2\n", {"header_lines": 3}, "leaves no numbers"),
        (b"\0\1\2", {}, "not text"),
        (b"\x1f\x8bbroken", {}, "damaged gzip"),
        ("1,5;2,5\n", {}, "no line of numbers"),
    ],
)
def test_a_malformed_table_is_one_line(tmp_path, text, part, says):
    with pytest.raises(FileError, match=says) as raised:
        table(tmp_path, text, **part)
    assert "\n" not in str(raised.value)
