"""Output folders: whole or absent, and nothing of the user's is lost."""

import pytest

from lab.errors import FileError
from lab.files.folder import output_folder


def tree(folder):
    return {str(path.relative_to(folder)): path.is_file() and path.read_text() for path in folder.rglob("*")}


def write(path, text, **options):
    with output_folder(path, **options) as folder:
        (folder / "result.json").write_text(text)


class StopError(Exception):
    """Something that goes wrong half-way."""


def fail(path, **options):
    with output_folder(path, **options) as folder:
        (folder / "result.json").write_text("half")
        raise StopError


def test_appears_whole_with_its_parents(tmp_path):
    write(tmp_path / "a/b/out", "one")
    assert tree(tmp_path) == {"a": False, "a/b": False, "a/b/out": False, "a/b/out/result.json": "one"}


def test_is_not_there_before_the_end(tmp_path):
    with output_folder(tmp_path / "out") as folder:
        assert folder.parent == tmp_path
        assert not (tmp_path / "out").exists()


def test_a_failure_leaves_nothing_behind(tmp_path):
    (tmp_path / "mine").mkdir()
    with pytest.raises(StopError):
        fail(tmp_path / "a/b/out")
    assert tree(tmp_path) == {"mine": False}


def test_an_empty_folder_is_taken(tmp_path):
    (tmp_path / "out").mkdir()
    write(tmp_path / "out", "one")
    assert tree(tmp_path) == {"out": False, "out/result.json": "one"}


def test_earlier_output_needs_force(tmp_path):
    write(tmp_path / "out", "one")
    with pytest.raises(FileError, match="exists already; choose another --out or add --force"):
        write(tmp_path / "out", "two")
    assert (tmp_path / "out/result.json").read_text() == "one"
    write(tmp_path / "out", "two", force=True)
    assert tree(tmp_path) == {"out": False, "out/result.json": "two"}


def test_a_failure_with_force_keeps_the_earlier_output(tmp_path):
    write(tmp_path / "out", "one")
    with pytest.raises(StopError):
        fail(tmp_path / "out", force=True)
    assert tree(tmp_path) == {"out": False, "out/result.json": "one"}


def test_a_failed_swap_puts_the_earlier_output_back(tmp_path, monkeypatch):
    write(tmp_path / "out", "one")
    rename = type(tmp_path).rename

    def stubborn(self, target):
        if self.name.endswith(".part"):
            raise OSError(28, "No space left on device")
        return rename(self, target)

    monkeypatch.setattr(type(tmp_path), "rename", stubborn)
    with pytest.raises(FileError, match="No space left"):
        write(tmp_path / "out", "two", force=True)
    assert tree(tmp_path) == {"out": False, "out/result.json": "one"}


def test_force_never_replaces_what_the_lab_did_not_write(tmp_path):
    (tmp_path / "out").mkdir()
    (tmp_path / "out/thesis.tex").write_text("years of work")
    with pytest.raises(FileError, match=r"'thesis.tex', which the lab did not write"):
        write(tmp_path / "out", "two", force=True)
    assert (tmp_path / "out/thesis.tex").read_text() == "years of work"


def test_a_file_in_the_way_is_refused(tmp_path):
    (tmp_path / "out").write_text("mine")
    with pytest.raises(FileError, match="is a file"):
        write(tmp_path / "out", "two", force=True)
    with pytest.raises(FileError, match="cannot be made"):
        write(tmp_path / "out/below", "two")
    assert tree(tmp_path) == {"out": "mine"}


def test_the_working_folder_is_refused(tmp_path, monkeypatch):
    (tmp_path / "here").mkdir()
    monkeypatch.chdir(tmp_path / "here")
    with pytest.raises(FileError, match="is the working folder"):
        write(".", "one")
    assert tree(tmp_path) == {"here": False}
