"""Processes of this machine: how many make sense, and how they begin and end."""

from __future__ import annotations

import gc
import multiprocessing
import os
import signal
import threading
from collections.abc import Callable, Iterator
from concurrent.futures import ProcessPoolExecutor
from contextlib import contextmanager

LIBRARIES = ("OMP", "OPENBLAS", "MKL")


def process_pool(n: int, begin: Callable[[], None] | None = None) -> ProcessPoolExecutor:
    """Fresh processes, which share nothing with this one; each begins with `begin`, and ends when this one does."""
    spawn = multiprocessing.get_context("spawn")
    return ProcessPoolExecutor(n, mp_context=spawn, initializer=_settle, initargs=(begin, gc.get_threshold()))


def _settle(begin: Callable[[], None] | None, threshold: tuple[int, int, int]) -> None:
    """Makes a worker leave stopping to its parent, leave with it, and look for garbage as often as it does."""
    gc.set_threshold(*threshold)
    if begin is not None:
        begin()
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    parent = multiprocessing.parent_process()
    assert parent is not None

    def leave() -> None:
        parent.join()
        os._exit(1)

    threading.Thread(target=leave, daemon=True).start()


def cores() -> int:
    """Cores that this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


@contextmanager
def one_thread_each() -> Iterator[None]:
    """Lets processes that begin meanwhile do their linear algebra with one thread each."""
    names = [f"{library}_NUM_THREADS" for library in LIBRARIES]
    before = {name: os.environ.get(name) for name in names}
    os.environ.update(dict.fromkeys(names, "1"))
    try:
        yield
    finally:
        for name, value in before.items():
            if value is None:
                os.environ.pop(name, None)
            else:
                os.environ[name] = value
