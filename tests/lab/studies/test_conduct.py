"""Studies from file to report: resumed, extended, refused, and told of."""

import json
from concurrent.futures import ThreadPoolExecutor

import h5py
import numpy as np
import pytest

import lab
from lab.errors import FileError, StudyError
from lab.studies import journal
from lab.studies.outcome import study_document
from lab.studies.wording import study_summary
from tests.lab.studies.small import STUDY, Here, conducted, rows, written


@pytest.fixture(scope="module")
def complete(tmp_path_factory):
    """A study done without a break: its file, folder and outcome."""
    folder = tmp_path_factory.mktemp("complete")
    path = written(folder)
    counted = []
    progress = lambda n, *, total: counted.append((n, total))  # noqa: E731
    outcome = conducted(path, folder / "out", progress=progress, command="lab study study.toml")
    assert sum(n for n, _ in counted) == 12
    assert {total for _, total in counted} == {12}
    return path, folder / "out", outcome


def test_the_folder_holds_journal_table_and_report(complete):
    path, out, outcome = complete
    assert sorted(each.name for each in out.iterdir()) == ["report.html", "study.h5", "study.jsonl"]
    assert outcome.n_failed == 0
    with h5py.File(out / "study.h5") as file:
        assert (file.attrs["format"], file.attrs["version"]) == ("modal-study", 1)
        assert file.attrs["study"] == path.read_text("utf-8")
        assert file["runs/frequency_error"].shape == (12, 3)
        assert np.isfinite(file["runs/collected/f1"][:]).all()
    report = (out / "report.html").read_text("utf-8")
    for each in ("A small study", "instruments.noise_percent", "lab study study.toml", "repeats = 3", "<svg"):
        assert each in report


def test_the_outcome_reads_well(complete):
    outcome = complete[2]
    text = study_summary(outcome)
    assert "12 runs: 4 points, 3 repeats" in text
    assert len(text.splitlines()) <= 24
    document = study_document(outcome)
    json.dumps(document, allow_nan=False)
    assert [point["setting"] for point in document["points"]] == [outcome.study.setting(k) for k in range(4)]
    assert document["points"][0]["statistics"]["frequency_error"]["runs"] == 3
    assert outcome["seconds"].kind == "mean"
    with pytest.raises(KeyError, match="there are"):
        outcome["nothing"]


def test_a_finished_study_is_told_again_and_not_done_again(complete):
    path, out, outcome = complete
    before = (out / "study.jsonl").read_bytes()

    class Idle(Here):
        def submit(self, function, /, *arguments):
            raise AssertionError("nothing is left to do")

    again = lab.study(path, out, executor=Idle())
    assert (out / "study.jsonl").read_bytes() == before
    assert study_document(again) == study_document(outcome)


def test_stopped_anywhere_it_goes_on(complete, tmp_path):
    path, out, _ = complete
    content = (out / "study.jsonl").read_bytes()
    half = tmp_path / "out"
    half.mkdir()
    # In the middle of a line.
    (half / "study.jsonl").write_bytes(content[: len(content) // 2])
    left = 12 - (content[: len(content) // 2].count(b"\n") - 1)
    done = []
    conducted(path, half, progress=lambda n, *, total: done.append((n, total)))
    assert (sum(n for n, _ in done), {total for _, total in done}) == (left, {left})
    assert rows(half) == rows(out)


def test_threads_in_any_order_give_the_same(complete, tmp_path):
    path, out, _ = complete
    with ThreadPoolExecutor(3) as executor:
        lab.study(path, tmp_path / "out", executor=executor, workers=3)
    assert rows(tmp_path / "out") == rows(out)


def test_more_values_and_repeats_add_runs_to_those_there_are(complete, tmp_path):
    _, out, _ = complete
    grown = tmp_path / "out"
    grown.mkdir()
    (grown / "study.jsonl").write_bytes((out / "study.jsonl").read_bytes())
    text = STUDY.replace("[1.0, 2.0]", "[2.0, 0.5, 1.0]").replace("repeats = 3", "repeats = 4")
    done = []
    conducted(written(tmp_path / "new", text), grown, progress=lambda n, *, total: done.append(n))
    assert sum(done) == 3 * 2 * 4 - 12
    # As if it had been asked for at once.
    conducted(written(tmp_path / "new", text), tmp_path / "afresh")
    assert rows(grown) == rows(tmp_path / "afresh")


def test_another_study_needs_another_folder_or_force(complete, tmp_path):
    _, out, _ = complete
    used = tmp_path / "out"
    used.mkdir()
    (used / "study.jsonl").write_bytes((out / "study.jsonl").read_bytes())
    other = written(
        tmp_path / "other", STUDY.replace("seed = 7", "seed = 8").replace("repeats = 3", "repeats = 1")
    )
    with pytest.raises(StudyError, match="another seed"):
        conducted(other, used)
    # As a kill leaves it while the table is written.
    (used / ".study.h5.part").write_bytes(b"half")
    assert conducted(other, used, force=True).study.n_runs == 4
    (used / "mine.txt").write_text("")
    with pytest.raises(FileError, match=r"mine\.txt"):
        conducted(other, used, force=True)


def test_failing_runs_are_recorded_and_the_rest_goes_on(tmp_path):
    text = STUDY.replace("[6, 8]", "[60, 6]").replace(
        "result.modes.0.frequency_hz", "result.modes.0.frequncy_hz"
    )
    outcome = conducted(written(tmp_path, text), tmp_path / "out")
    assert outcome.n_failed == 6
    ((error, n),) = outcome.failures.items()
    assert (error.partition(":")[0], n) == ("OrderError", 6)
    assert list(outcome["frequency_error"].n) == [0, 3, 0, 3]
    told = study_summary(outcome)
    assert "12 runs, 6 of them failed" in told
    assert "6 runs failed: OrderError" in told
    assert "f1 = 'result.modes.0.frequncy_hz' of [collect] is in no run" in " ".join(told.split())
    assert "6 of 12 runs failed" in (tmp_path / "out/report.html").read_text("utf-8")


def test_a_path_to_a_table_ends_the_study_with_the_next_step(tmp_path):
    path = written(tmp_path, STUDY.replace("modes.0.frequency_hz", "modes.0"))
    with pytest.raises(StudyError, match="leads to a table or list"):
        conducted(path, tmp_path / "out")


def test_runs_of_another_study_in_the_journal_are_told(complete, tmp_path):
    path, out, _ = complete
    (tmp_path / "study.jsonl").write_bytes((out / "study.jsonl").read_bytes() + b'{"run": 12}\n')
    with pytest.raises(FileError, match="has a run 12; expected 0 to 11"):
        conducted(path, tmp_path)


def test_a_scheduler_has_its_own_workers(tmp_path):
    with pytest.raises(StudyError, match="either --scheduler or --workers"):
        lab.study(written(tmp_path), tmp_path / "out", scheduler="tcp://127.0.0.1:1", workers=2)


def test_a_header_is_all_that_decides(complete):
    _, out, outcome = complete
    assert journal.read_header(out / "study.jsonl") == json.loads(json.dumps(journal.header(outcome.study)))
