"""Who does the work: processes of this machine, a Dask cluster, or any other executor."""

from __future__ import annotations

import multiprocessing
import sys
import time
from collections.abc import Callable, Iterator
from concurrent.futures import Executor, Future
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from typing import Any

from lab.errors import StudyError
from lab.processes import cores, one_thread_each, process_pool


@dataclass
class Crew:
    """An executor, how many runs it does at a time, and how to get a new one when it breaks.

    Attributes:
        hire: gives an executor.
        size: number of runs done at a time, which may change.
        renewable: whether `hire` gives a new executor each time.
    """

    hire: Callable[[], Executor]
    size: Callable[[], int]
    renewable: bool = False
    executor: Executor = field(init=False)

    def __post_init__(self) -> None:
        self.executor = self.hire()

    def submit(self, function: Callable[..., Any], *arguments: Any) -> Future[Any]:
        """The call's outcome to come."""
        return self.executor.submit(function, *arguments)

    def renew(self) -> None:
        """Replaces a broken executor."""
        self.executor.shutdown(wait=False)
        self.executor = self.hire()


@contextmanager
def local_crew(workers: int | None = None) -> Iterator[Crew]:
    """Processes of this machine, one run each at a time; as many as there are cores when None."""
    n = workers or cores()
    before = set(multiprocessing.active_children())
    # Each has one thread, or sums would depend on the number of cores.
    with one_thread_each():
        crew = Crew(lambda: process_pool(n), lambda: n, renewable=True)
        try:
            yield crew
        except BaseException:
            # Runs in progress are lost either way; waiting for them would only keep the user waiting.
            for child in set(multiprocessing.active_children()) - before:
                child.terminate()
            raise
        finally:
            crew.executor.shutdown(cancel_futures=True)


@contextmanager
def dask_crew(address: str) -> Iterator[Crew]:
    """The workers of a Dask cluster.

    Args:
        address: of its scheduler, such as tcp://10.0.0.1:8786.

    Raises:
        StudyError: the package distributed is missing, or nobody answers.
    """
    try:
        from distributed import Client
    except ImportError:
        raise StudyError(
            "--scheduler needs the package distributed, which is not installed; install the group cluster, "
            "or use --workers"
        ) from None
    try:
        client = Client(address, timeout=10, set_as_default=False)
    except (OSError, ValueError) as error:
        raise StudyError(
            f"no Dask scheduler answers at {address} ({type(error).__name__}); "
            "start one with 'dask scheduler', or use --workers"
        ) from None
    with client, client.get_executor(pure=False) as executor:
        yield Crew(lambda: executor, _now_and_then(lambda: max(1, sum(client.nthreads().values()))))


def mpi_crew() -> Crew | None:
    """The workers of an MPI job started as `mpiexec -n N python -m mpi4py.futures -m lab study …`; None outside one."""
    with suppress(ImportError):
        if "mpi4py.futures" in sys.modules:
            from mpi4py.futures import MPIPoolExecutor

            executor = MPIPoolExecutor()
            return Crew(lambda: executor, lambda: max(1, executor.num_workers))
    return None


def _now_and_then(ask: Callable[[], int], seconds: float = 5.0) -> Callable[[], int]:
    """The same question, asked anew only when the answer is old: workers come and go, but asking takes time."""
    asked, answer = -float("inf"), 0

    def size() -> int:
        nonlocal asked, answer
        if time.monotonic() - asked > seconds:
            answer, asked = ask(), time.monotonic()
        return answer

    return size
