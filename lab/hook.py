"""Hook: a callback that the whole process has once, as MuJoCo's are, held by several threads at a time."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from threading import Lock


class Hook:
    """Set by the first who holds it and put back by the last, in whichever thread and order they come and go."""

    def __init__(self, set_callback: Callable[[], Callable[[], None]]) -> None:
        """A hook not set yet; `set_callback` sets it, and returns what puts back what was there before."""
        self._set, self._lock, self._holders = set_callback, Lock(), 0

    @contextmanager
    def held(self) -> Iterator[None]:
        """The hook stays set within this block."""
        with self._lock:
            if not self._holders:
                self._put_back = self._set()
            self._holders += 1
        try:
            yield
        finally:
            with self._lock:
                self._holders -= 1
                if not self._holders:
                    self._put_back()
