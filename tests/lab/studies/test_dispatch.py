"""Dispatch: every run once, few at a time, and a worker's death costs nobody else anything."""

import json
import threading
from concurrent.futures import BrokenExecutor

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from lab.errors import StudyError
from lab.studies.dispatch import AHEAD, BATCH_SECONDS, BATCHES_PER_SECOND, dispatch
from lab.studies.evaluate import Task
from lab.studies.plan import Run
from lab.studies.workers import Crew
from tests.lab.studies.small import Following, Here

TASK = Task({}, "", {})


def line(run, seconds=0.001):
    return json.dumps({"run": run.number, "seed": run.seed, "seconds": seconds, "score": {}})


def dispatched(n, crew):
    kept = []
    dispatch(
        TASK,
        (Run(k, {}, k) for k in range(n)),
        n,
        crew,
        lambda lines: kept.append([json.loads(x) for x in lines]),
    )
    return kept


@settings(max_examples=30)
@given(st.integers(0, 200), st.integers(1, 5), st.lists(st.floats(1e-5, 2.0), min_size=1, max_size=7))
def test_every_run_is_done_once_and_few_at_a_time(n, size, seconds):
    executor = Following(lambda task, batch: [line(run, seconds[run.number % len(seconds)]) for run in batch])
    kept = dispatched(n, Crew(lambda: executor, lambda: size))
    assert sorted(each["run"] for lines in kept for each in lines) == list(range(n))
    assert executor.most <= AHEAD * size


def test_batches_grow_for_short_runs_and_shrink_towards_the_end():
    executor = Following(lambda task, batch: [line(run, BATCH_SECONDS / 100) for run in batch])
    sizes = [len(lines) for lines in dispatched(2000, Crew(lambda: executor, lambda: 1)) if lines]
    assert max(sizes) == 100
    assert sizes[0] == sizes[-1] == 1


def test_batches_of_a_large_crew_last_so_long_that_one_scheduler_keeps_up():
    sizes, crew = [], Crew(Here, lambda: 300)
    runs = (Run(k, {}, k) for k in range(20_000))
    dispatch(
        TASK,
        runs,
        20_000,
        crew,
        lambda lines: sizes.append(len(lines)),
        work=lambda _, batch: [line(run, 0.3) for run in batch],
    )
    # Three hundred workers, each busy with ten runs of 0.3 s: a hundred batches a second.
    assert max(sizes) == 300 / BATCHES_PER_SECOND / 0.3


def test_long_runs_go_one_by_one():
    executor = Following(lambda task, batch: [line(run, 1.0) for run in batch])
    assert {len(lines) for lines in dispatched(20, Crew(lambda: executor, lambda: 2)) if lines} == {1}


class Mortal:
    """Executors of which one breaks for good when it comes to a run that kills."""

    def __init__(self, kills, seconds=0.001):
        self.kills, self.hired, self.seconds, self.lock, self.done = kills, 0, seconds, threading.Lock(), []

    def hire(self):
        self.hired += 1
        broken = threading.Event()

        def each(task, batch):
            for run in batch:
                if self.kills(run.number):
                    broken.set()
                if broken.is_set():
                    raise BrokenExecutor("a process died")
            with self.lock:
                self.done += [run.number for run in batch]
            return [line(run, self.seconds) for run in batch]

        return Following(each)


def test_a_run_that_kills_its_worker_is_recorded_and_the_rest_goes_on():
    mortal = Mortal(lambda number: number in (0, 57))
    kept = [each for lines in dispatched(100, Crew(mortal.hire, lambda: 3, renewable=True)) for each in lines]
    assert sorted(each["run"] for each in kept) == list(range(100))
    failed = {each["run"]: each["error"] for each in kept if "error" in each}
    assert failed.keys() == {0, 57}
    assert all("the worker did not survive this run" in error for error in failed.values())


def test_a_worker_killed_from_outside_costs_no_run():
    once = iter([True])
    mortal = Mortal(lambda number: number == 31 and next(once, False))
    kept = [each for lines in dispatched(100, Crew(mortal.hire, lambda: 3, renewable=True)) for each in lines]
    assert sorted(each["run"] for each in kept) == list(range(100))
    assert not [each for each in kept if "error" in each]


def test_workers_that_never_live_are_told_of_and_no_run_is_blamed():
    kept = []
    crew = Crew(Mortal(lambda number: True).hire, lambda: 2, renewable=True)
    with pytest.raises(StudyError, match="10 runs in a row killed their workers"):
        dispatch(TASK, (Run(k, {}, k) for k in range(100)), 100, crew, kept.extend)
    assert kept == []


def test_a_broken_executor_of_the_user_is_his_to_mend():
    with pytest.raises(BrokenExecutor):
        dispatched(5, Crew(Mortal(lambda number: True).hire, lambda: 2))


def test_a_fault_of_the_lab_is_not_a_failed_run():
    def each(task, batch):
        raise ZeroDivisionError

    with pytest.raises(ZeroDivisionError):
        dispatched(5, Crew(lambda: Following(each), lambda: 2))
