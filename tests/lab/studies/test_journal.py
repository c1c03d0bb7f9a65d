"""The journal: whatever cuts it short, its whole lines are there and the rest is written again."""

import json

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from lab.errors import FileError, StudyError
from lab.studies import journal
from tests.lab.studies.small import STUDY, loaded

LINES = [json.dumps({"run": k, "seed": k, "seconds": 0.5, "score": {"verdict": "Ω" * k}}) for k in range(4)]


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    """A study and the bytes of its journal with four runs."""
    folder = tmp_path_factory.mktemp("whole")
    study, path = loaded(folder), folder / journal.NAME
    journal.create(path, study)
    with journal.Journal(path) as book:
        book.write(LINES[:3])
        book.write(LINES[3:])
    return study, path.read_bytes()


@settings(max_examples=60)
@given(st.data())
def test_cut_anywhere_it_goes_on_where_the_last_whole_line_ends(whole, tmp_path_factory, data):
    _, content = whole
    start = content.index(b"\n") + 1
    cut = data.draw(st.integers(start, len(content)))
    path = tmp_path_factory.mktemp("cut") / journal.NAME
    path.write_bytes(content[:cut])
    survived = content[:cut].count(b"\n") - 1
    assert [each["run"] for each in journal.outcomes(path)] == list(range(survived))
    with journal.Journal(path) as book:
        book.write(LINES[survived:])
    assert path.read_bytes() == content


def test_what_is_written_is_on_disk_at_once(whole, tmp_path):
    study, _ = whole
    path = tmp_path / journal.NAME
    journal.create(path, study)
    with journal.Journal(path) as book:
        for k, line in enumerate(LINES):
            book.write([line])
            assert len(list(journal.outcomes(path))) == k + 1


def test_one_writer_at_a_time(whole, tmp_path):
    pytest.importorskip("fcntl")
    path = tmp_path / journal.NAME
    path.write_bytes(whole[1])
    with journal.Journal(path), pytest.raises(FileError, match="another study is writing it"):
        journal.Journal(path)
    with journal.Journal(path):
        pass


def test_damage_in_the_middle_is_told(whole, tmp_path):
    path = tmp_path / journal.NAME
    path.write_bytes(whole[1].replace(b'{"run": 1,', b'{"run; 1,'))
    with pytest.raises(FileError, match="line 3 is damaged"):
        list(journal.outcomes(path))
    path.write_text("hello\n")
    with pytest.raises(FileError, match="is no journal of a study"):
        journal.read_header(path)


def renumbering(tmp_path, text):
    """Of the runs of the small study in the one that `text` describes."""
    path = tmp_path / "old" / journal.NAME
    old, new = loaded(tmp_path / "old"), loaded(tmp_path / "new", text)
    journal.create(path, old)
    return old, new, journal.renumbering(journal.read_header(path), new, path)


def test_the_same_study_keeps_its_numbers(tmp_path):
    assert renumbering(tmp_path, STUDY.replace("A small", "The same"))[2] is None


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("repeats = 3", "repeats = 4"),
        ("[1.0, 2.0]", "[0.5, 1.0, 1.5, 2.0]"),
        ("[6, 8]", "[8, 10, 6]"),
    ],
)
def test_an_extended_study_keeps_what_each_run_is(tmp_path, old, new):
    before, after, renumber = renumbering(tmp_path, STUDY.replace(old, new))
    for number in range(before.n_runs):
        run, same = before.run(number), after.run(renumber(number))
        assert (same.setting, same.seed) == (run.setting, run.seed)


@pytest.mark.parametrize(
    ("old", "new", "complaint"),
    [
        ("repeats = 3", "repeats = 2", "has 3 repeats, the study asks for 2"),
        ("[1.0, 2.0]", "[1.0, 3.0]", "has runs with instruments.noise_percent = 2.0"),
        ("seed = 7", "seed = 8", "another seed"),
        ("f1 =", "f2 =", "another collect"),
        ("[6, 8]", "[6, 8]\ntest.runs = [1]", "varies other keys"),
    ],
)
def test_another_study_is_refused(tmp_path, old, new, complaint):
    with pytest.raises(StudyError) as caught:
        renumbering(tmp_path, STUDY.replace(old, new))
    assert complaint in str(caught.value)
    assert "--force" in str(caught.value)


def test_another_model_is_refused(tmp_path):
    model = tmp_path / "m.xml"
    model.write_text("<mujoco/>")
    text = STUDY.replace("[vary]", f'[vary]\nmodel = ["{model}"]')
    path = tmp_path / journal.NAME
    study = loaded(tmp_path, text)
    journal.create(path, study)
    model.write_text("<mujoco> </mujoco>")
    with pytest.raises(StudyError, match="another models"):
        journal.renumbering(journal.read_header(path), study, path)
