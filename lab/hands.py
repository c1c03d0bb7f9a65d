"""Hands: who does the many pieces of long work: threads of this process and, where they are called, processes beside it."""

from __future__ import annotations

import importlib
import multiprocessing
import os
import pickle
import tempfile
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import Executor, Future, ThreadPoolExecutor
from contextlib import contextmanager
from dataclasses import dataclass
from functools import lru_cache, partial
from pathlib import Path
from typing import Any, TypeVar

from lab.processes import cores, one_thread_each, process_pool

Item = TypeVar("Item")
Outcome = TypeVar("Outcome")

AHEAD = 2
"""Pieces at each helper, so that none idles between two."""
MOST = 7
"""Helpers that are called where nobody says how many: each loads the whole program, and pieces are not endless."""


@dataclass
class Hands:
    """What this process works with.

    Attributes:
        threads: of this process.
        alone: whether threads would only get in the way, since every core is taken.
        helpers: processes beside this one; None where nobody called any.
        n_helpers: how many.
        folder: where they find what to do.
    """

    threads: ThreadPoolExecutor
    alone: bool = False
    helpers: Executor | None = None
    n_helpers: int = 0
    folder: str = ""


HANDS = Hands(ThreadPoolExecutor(min(os.cpu_count() or 1, 8)))


@contextmanager
def helped(*modules: str, n: int | None = None) -> Iterator[None]:
    """Calls processes that help for as long as this lasts.

    Each begins a Python of its own, which takes about a second: this is for long work, in programs whose main module may be
    imported again. Where a helper fails or is lost, its piece is done here, so that results and errors are the same.

    Args:
        modules: that they load at once.
        n: how many; when None, one for each further core, up to `MOST`.
    """
    n = min(cores() - 1, MOST) if n is None else n
    if n < 1 or HANDS.helpers is not None or HANDS.alone:
        yield
        return
    before = set(multiprocessing.active_children())
    with tempfile.TemporaryDirectory(prefix="lab-", ignore_cleanup_errors=True) as folder:
        executor = process_pool(n, by_itself)
        with one_thread_each():
            for _ in range(n):
                executor.submit(_load, modules)
        own = set(multiprocessing.active_children()) - before
        HANDS.helpers, HANDS.n_helpers, HANDS.folder = executor, n, folder
        try:
            yield
        finally:
            HANDS.helpers, HANDS.n_helpers = None, 0
            executor.shutdown(wait=False, cancel_futures=True)
            for helper in own:
                helper.kill()
                helper.join()


def beside(function: Callable[[Item], Outcome], items: Iterable[Item]) -> Iterator[Outcome]:
    """Outcomes of a function, by threads: for pieces that spend their time in compiled loops."""
    return map(function, items) if HANDS.alone else HANDS.threads.map(function, items)


def shared(function: Callable[[Item], Outcome], items: Sequence[Item]) -> Iterator[Outcome]:
    """Outcomes of a function in the order of its items, by this process and its helpers.

    Args:
        function: what to do; helpers get a copy, so that it may neither be a local function nor remember anything.
        items: with what.
    """
    task = _task(function) if HANDS.helpers is not None and len(items) > 1 else None
    if task is None:
        yield from map(function, items)
        return
    waiting, sent = deque(range(len(items))), dict[int, Future[Any]]()
    try:
        for number, item in enumerate(items):
            # The far end is theirs, so that outcomes come in order from this one.
            while len(waiting) > 1 and sum(not f.done() for f in sent.values()) < AHEAD * HANDS.n_helpers:
                last = waiting.pop()
                sent[last] = _sent(_piece, task, last, items[last])
            if number not in sent:
                waiting.popleft()
            if number not in sent or _is_first(task, number):
                yield _alone(function, item)
            else:
                yield _received(sent[number], partial(function, item))
    finally:
        Path(task).unlink(missing_ok=True)


def meanwhile(function: Callable[..., Outcome], *arguments: Any, **options: Any) -> Callable[[], Outcome]:
    """How to get the outcome of a call that a helper makes while this process goes on; made when asked for where none helps."""
    here = partial(function, *arguments, **options)
    if HANDS.helpers is None:
        return here
    return partial(_received, _sent(function, *arguments, **options), here)


def _task(function: Callable[[Any], Any]) -> str | None:
    """The file that tells helpers what to do; None where it cannot be told."""
    try:
        told = pickle.dumps(function, protocol=pickle.HIGHEST_PROTOCOL)
        handle, path = tempfile.mkstemp(dir=HANDS.folder)
        with os.fdopen(handle, "wb") as file:
            file.write(told)
    except (pickle.PicklingError, TypeError, AttributeError, OSError):
        return None
    return path


def _sent(function: Callable[..., Any], *arguments: Any, **options: Any) -> Future[Any]:
    """The outcome to come; a failed one where no helper is left."""
    lost: Future[Any] = Future()
    lost.set_exception(RuntimeError("no helper is left"))
    if HANDS.helpers is None:
        return lost
    try:
        return HANDS.helpers.submit(function, *arguments, **options)
    except (RuntimeError, OSError):
        return lost


def _received(outcome: Future[Outcome], here: Callable[[], Outcome]) -> Outcome:
    """What a helper found; found here where it did not get there, so that every error is met in this process."""
    try:
        return outcome.result()
    except Exception:
        return here()


def _alone(function: Callable[[Item], Outcome], item: Item) -> Outcome:
    """The outcome while helpers have the other cores."""
    HANDS.alone = True
    try:
        return function(item)
    finally:
        HANDS.alone = False


def by_itself() -> None:
    """Makes this process one of several that have the cores between them."""
    HANDS.alone = True


def _load(modules: Sequence[str]) -> None:
    for module in modules:
        importlib.import_module(module)


def _piece(task: str, number: int, item: Any) -> Any:
    if not _is_first(task, number):
        raise RuntimeError("another process has begun it")
    return _told(task)(item)


def _is_first(task: str, number: int) -> bool:
    """Whether this process is the first to begin an item; the file that says so stays, for those who come late."""
    try:
        os.close(os.open(f"{task}.{number}", os.O_CREAT | os.O_EXCL))
    except OSError:
        return False
    return True


@lru_cache(maxsize=1)
def _told(path: str) -> Callable[[Any], Any]:
    """What is to be done; the same for many items."""
    found: Callable[[Any], Any] = pickle.loads(Path(path).read_bytes())
    return found
