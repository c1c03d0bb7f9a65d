"""Runs handed out in batches, a bounded number at a time, and taken in as they come."""

from __future__ import annotations

import json
import queue
from collections import Counter, deque
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import BrokenExecutor, Future
from itertools import islice
from typing import NamedTuple

from lab.errors import StudyError
from lab.studies.evaluate import Task, failure, perform
from lab.studies.plan import Run
from lab.studies.workers import Crew

BATCH_SECONDS = 0.3
"""Aim for the time of a batch: long beside the cost of handing it out, short beside what anybody waits for."""
BATCHES_PER_SECOND = 100.0
"""So many a scheduler hands out with ease: the batches of a larger crew last longer."""
AHEAD = 2
"""Batches per worker handed out at a time: one in work, one ready."""
MAX_DEATHS = 2
"""A run whose worker dies so often, each time alone at work, is to blame for it."""
MAX_GIVEN_UP = 10
"""So many runs in a row that kill their workers are the fault of the workers."""


class _Given(NamedTuple):
    batch: tuple[Run, ...]
    hired: int
    alone: bool


def dispatch(
    task: Task,
    runs: Iterator[Run],
    n_runs: int,
    crew: Crew,
    keep: Callable[[Sequence[str]], None],
    *,
    work: Callable[[Task, Sequence[Run]], list[str]] = perform,
) -> None:
    """Performs runs on a crew; a run that its worker does not survive is kept as failed.

    Args:
        task: what the runs share.
        runs: what to do.
        n_runs: how many they are.
        crew: who does it.
        keep: called with the outcomes of a batch as soon as it is done.
        work: what is done with a batch.
    """
    _Dispatch(task, runs, n_runs, crew, keep, work).go()


class _Dispatch:
    def __init__(
        self,
        task: Task,
        runs: Iterator[Run],
        n_runs: int,
        crew: Crew,
        keep: Callable[[Sequence[str]], None],
        work: Callable[[Task, Sequence[Run]], list[str]],
    ) -> None:
        self.task, self.runs, self.left, self.crew, self.keep, self.work = (
            task,
            runs,
            n_runs,
            crew,
            keep,
            work,
        )
        self.done: queue.SimpleQueue[Future[list[str]]] = queue.SimpleQueue()
        self.given: dict[Future[list[str]], _Given] = {}
        self.suspects: deque[Run] = deque()
        self.deaths: Counter[int] = Counter()
        self.given_up: list[str] = []
        self.hired = 0
        self.batch_size = 1

    def go(self) -> None:
        while True:
            self._hand_out()
            if not self.given:
                if self.suspects:
                    continue
                return self._keep([])
            future = self.done.get()
            given = self.given.pop(future)
            try:
                lines = future.result()
            except Exception as error:
                if not _worker_died(error):
                    raise
                self._bury(given, error)
            else:
                self._keep(lines)
                self._adapt(lines)

    def _hand_out(self) -> None:
        if self.suspects:
            # One at a time, so that the next death names the run.
            if not self.given:
                self._give((self.suspects.popleft(),), alone=True)
            return
        size = self.crew.size()
        while len(self.given) < AHEAD * size and self.left and not self.suspects:
            # The last batches are short, so that all workers end together.
            n = max(1, min(self.batch_size, self.left // (AHEAD * size)))
            batch = tuple(islice(self.runs, n))
            self.left -= len(batch)
            self._give(batch)

    def _give(self, batch: tuple[Run, ...], *, alone: bool = False) -> None:
        try:
            future = self.crew.submit(self.work, self.task, batch)
        except BrokenExecutor as error:
            # It broke between two batches.
            return self._bury(_Given(batch, self.hired, alone), error)
        self.given[future] = _Given(batch, self.hired, alone)
        future.add_done_callback(self.done.put)

    def _keep(self, lines: Sequence[str]) -> None:
        """Keeps outcomes, after those of the runs given up before: the crew is alive, so those were to blame."""
        self.keep([*self.given_up, *lines])
        self.given_up.clear()

    def _adapt(self, lines: Sequence[str]) -> None:
        """Batches that last long enough, growing step by step since the first runs are slow."""
        seconds = sum(json.loads(line)["seconds"] for line in lines) / len(lines)
        fitting = max(BATCH_SECONDS, self.crew.size() / BATCHES_PER_SECOND) / max(seconds, 1e-6)
        self.batch_size = max(1, min(round(fitting), 4 * self.batch_size))

    def _bury(self, given: _Given, error: Exception) -> None:
        """Has the runs of a dead worker done again, by a new crew where the old one broke."""
        if isinstance(error, BrokenExecutor) and given.hired == self.hired:
            if not self.crew.renewable:
                raise error
            self.crew.renew()
            self.hired += 1
        for run in given.batch:
            self.deaths[run.number] += given.alone
            if self.deaths[run.number] >= MAX_DEATHS:
                self.given_up.append(_obituary(run, error))
            else:
                self.suspects.append(run)
        if len(self.given_up) >= MAX_GIVEN_UP:
            raise StudyError(
                f"{MAX_GIVEN_UP} runs in a row killed their workers ({failure(error)}); expected workers with enough "
                "memory that can import lab, and in a script 'if __name__ == \"__main__\":' before the call; mend "
                "that and do the same again, what was finished is kept"
            )


def _obituary(run: Run, error: Exception) -> str:
    told = f"WorkerDied: the worker did not survive this run ({failure(error)})"
    return json.dumps({"run": run.number, "seed": run.seed, "seconds": None, "error": told})


def _worker_died(error: Exception) -> bool:
    # Dask is optional, so its error is known by name.
    return isinstance(error, BrokenExecutor) or type(error).__name__ == "KilledWorker"
