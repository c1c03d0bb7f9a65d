"""Hands: who does the many pieces of long work: threads of this process and, where they are called, processes beside it."""

from __future__ import annotations

import os
import pickle
import tempfile
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import BrokenExecutor, Executor, Future, ThreadPoolExecutor
from contextlib import contextmanager
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any, TypeVar

from lab.studies.workers import cores, process_pool

Item = TypeVar("Item")
Outcome = TypeVar("Outcome")

AHEAD = 2
"""Pieces at each helper, so that none idles between two."""


@dataclass
class Hands:
    """What this process works with.

    Attributes:
        threads: of this process.
        alone: whether threads would only get in the way, since every core is taken.
        helpers: processes beside this one.
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
def helped(n: int | None = None) -> Iterator[None]:
    """Calls processes to help with what is shared meanwhile; as many as there are further cores when None.

    They begin a Python of their own, which takes about a second, so that this is for long work in programs whose main module
    can be imported.
    """
    n = cores() - 1 if n is None else n
    if n < 1 or HANDS.helpers is not None or HANDS.alone:
        yield
        return
    with tempfile.TemporaryDirectory(prefix="lab-") as folder:
        executor = process_pool(n, _begin)
        for _ in range(n):
            executor.submit(_begun)
        HANDS.helpers, HANDS.n_helpers, HANDS.folder = executor, n, folder
        try:
            yield
        finally:
            HANDS.helpers, HANDS.n_helpers = None, 0
            executor.shutdown(wait=True, cancel_futures=True)


def beside(function: Callable[[Item], Outcome], items: Iterable[Item]) -> Iterator[Outcome]:
    """Outcomes of a function, by threads: for pieces that spend their time in compiled loops."""
    return map(function, items) if HANDS.alone else HANDS.threads.map(function, items)


def shared(function: Callable[[Item], Outcome], items: Sequence[Item]) -> Iterator[Outcome]:
    """Outcomes of a function in the order of its items, by this process and its helpers.

    Args:
        function: what to do; sent to the helpers, so that it may be no local function.
        items: with what.
    """
    if HANDS.helpers is None or len(items) < 2:
        yield from map(function, items)
        return
    order = Path(HANDS.folder) / f"{len(os.listdir(HANDS.folder))}.pickle"
    order.write_bytes(pickle.dumps(function, protocol=pickle.HIGHEST_PROTOCOL))
    waiting, sent = deque(range(len(items))), dict[int, Future[Any]]()
    for number, item in enumerate(items):
        # The far end is theirs, so that outcomes come in order from this one.
        while len(waiting) > 1 and sum(not f.done() for f in sent.values()) < AHEAD * HANDS.n_helpers:
            last = waiting.pop()
            sent[last] = HANDS.helpers.submit(_piece, str(order), items[last])
        if number in sent:
            yield _received(sent[number], function, item)
        else:
            waiting.popleft()
            yield _alone(function, item)


def _received(outcome: Future[Outcome], function: Callable[[Item], Outcome], item: Item) -> Outcome:
    """What a helper made of an item, or this process where the helper is gone."""
    try:
        return outcome.result()
    except BrokenExecutor:
        return function(item)


def _alone(function: Callable[[Item], Outcome], item: Item) -> Outcome:
    """The outcome while helpers have the other cores."""
    HANDS.alone = True
    try:
        return function(item)
    finally:
        HANDS.alone = False


def _begin() -> None:
    HANDS.alone = True


def _begun() -> None:
    """Loads what a helper will need."""
    from lab import kernel as kernel
    from lab.diagnosis import diagnose as diagnose


@lru_cache(maxsize=1)
def _ordered(path: str) -> Callable[[Any], Any]:
    """What is to be done; the same for many items."""
    found: Callable[[Any], Any] = pickle.loads(Path(path).read_bytes())
    return found


def _piece(path: str, item: Any) -> Any:
    return _ordered(path)(item)
