"""A study from its file to its report: what is left to do is done, and what all runs say is told."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Executor
from contextlib import AbstractContextManager, nullcontext
from pathlib import Path
from typing import Any

import h5py

from lab.errors import FileError, StudyError
from lab.files.folder import output_folder
from lab.studies import journal
from lab.studies.dispatch import dispatch
from lab.studies.evaluate import Task
from lab.studies.outcome import Outcome
from lab.studies.plan import Study, load_study
from lab.studies.statistics import statistics
from lab.studies.table import columns_of, write_table
from lab.studies.workers import Crew, dask_crew, local_crew, mpi_crew

Progress = Callable[..., None]
"""Called with the number of runs finished since the last call, and `total`, how many were left to do at the start."""


def study(
    study: Study | str | Path,
    out: str | Path,
    *,
    workers: int | None = None,
    scheduler: str | None = None,
    executor: Executor | None = None,
    force: bool = False,
    command: str = "",
    progress: Progress | None = None,
) -> Outcome:
    """What many runs of a scenario say together; a study that was stopped goes on where it stopped.

    Args:
        study: what is asked, or the file that says it.
        out: folder with study.jsonl (every run as soon as it is finished), and at the end study.h5 and report.html.
        workers: processes of this machine; as many as there are cores when None.
        scheduler: address of a Dask scheduler, whose workers are taken instead.
        executor: any other executor that does the work instead, `workers` runs at a time.
        force: start afresh, and replace an earlier output there.
        command: how the study was called, for the report.
        progress: told how far it is.

    Raises:
        LabError: something in the study is wrong, or the folder cannot be written or holds another study.
    """
    if not isinstance(study, Study):
        study = load_study(study)
    if scheduler is not None and (workers is not None or executor is not None):
        raise StudyError("a scheduler has its own workers; give either --scheduler or --workers")
    folder = Path(out)
    _prepare(folder, study, force)
    with journal.Journal(folder / journal.NAME) as book:
        done = _finished(folder / journal.NAME, study)
        left = study.n_runs - done.count(1)
        if left:
            # What an earlier, smaller study came to is not what this one comes to.
            for name in ("study.h5", "report.html"):
                (folder / name).unlink(missing_ok=True)
            with _crew(workers, scheduler, executor) as crew:
                _work(study, done, left, crew, book, progress)
        return _tell(folder, study, command)


def _prepare(folder: Path, study: Study, force: bool) -> None:
    """A journal of this study in the folder, with the runs already finished."""
    book = folder / journal.NAME
    if force and book.is_file():
        with journal.Journal(book):
            # Nobody else is writing it, so what a kill left half written is of no use.
            for half in folder.glob(".*.part"):
                half.unlink()
    if force or not book.is_file():
        with output_folder(folder, force=force) as hidden:
            journal.create(hidden / journal.NAME, study)
        return
    renumber = journal.renumbering(journal.read_header(book), study, book)
    if renumber is not None:
        with journal.Journal(book):
            known = ({**each, "run": renumber(each["run"])} for each in journal.outcomes(book))
            journal.create(book, study, known)


def _finished(book: Path, study: Study) -> bytearray:
    """One byte per run: whether it is finished."""
    done = bytearray(study.n_runs)
    for outcome in journal.outcomes(book):
        number = outcome.get("run") if isinstance(outcome, dict) else None
        if not isinstance(number, int) or not 0 <= number < len(done):
            raise FileError(f"{book}: has a run {number!r}; expected 0 to {len(done) - 1}; delete that line")
        done[number] = 1
    return done


def _crew(
    workers: int | None, scheduler: str | None, executor: Executor | None
) -> AbstractContextManager[Crew]:
    if scheduler is not None:
        return dask_crew(scheduler)
    if executor is not None:
        return nullcontext(Crew(lambda: executor, lambda: workers or 1))
    return nullcontext(found) if workers is None and (found := mpi_crew()) else local_crew(workers)


def _work(
    study: Study, done: bytearray, left: int, crew: Crew, book: journal.Journal, progress: Progress | None
) -> None:
    def keep(lines: Sequence[str]) -> None:
        book.write(lines)
        if progress is not None:
            progress(len(lines), total=left)

    def runs() -> Iterator[Any]:
        return (study.run(number) for number, finished in enumerate(done) if not finished)

    dispatch(Task(dict(study.scenario), str(study.folder), dict(study.collect)), runs(), left, crew, keep)


def _tell(folder: Path, study: Study, command: str) -> Outcome:
    """study.h5 and report.html, and what they say."""
    # Imported here because drawing is slow to load and `lab` must come up without it.
    from lab.show.study_report import write_study_report

    book = folder / journal.NAME
    columns = columns_of(book)
    write_table(folder / "study.h5", study, book, columns)
    with h5py.File(folder / "study.h5", "r") as file:
        found = statistics(file)
    absent = tuple(name for name in study.collect if f"collected/{name}" not in columns.present)
    outcome = Outcome(study, tuple(found), dict(columns.errors), columns.n_failed, absent)
    hidden = folder / ".report.html.part"
    write_study_report(hidden, outcome, command=command)
    hidden.replace(folder / "report.html")
    return outcome
