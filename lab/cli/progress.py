"""What a terminal sees of long work: bars with the time left, and what is being done for how long."""

from __future__ import annotations

import sys
import threading
import time
from collections.abc import Callable
from typing import Any

import click

CLEAR = "\r\x1b[K"
"""Back to the start of the line, which is cleared."""


def _terminal(quiet: bool) -> bool:
    return sys.stderr.isatty() and not quiet


class Progress:
    """A bar with the time left on a terminal, nothing elsewhere; behind its end, what is done then."""

    def __init__(self, label: str, quiet: bool, *, then: str) -> None:
        self.bar: Any = None
        self.doing, self.then = Doing(quiet), then
        if _terminal(quiet):
            self.bar = click.progressbar(length=1, label=label, file=sys.stderr)

    def __enter__(self) -> Callable[..., None]:
        if self.bar is not None:
            self.bar.__enter__()
        return self.show

    def show(self, n: int, *, total: int) -> None:
        """Moves the bar on by n of a total."""
        if self.bar is None:
            return
        self.bar.length = total
        self.bar.update(n)
        if self.bar.pos >= total:
            self._end_bar()
            self.doing.__enter__()(self.then)

    def _end_bar(self) -> None:
        self.bar.__exit__(None, None, None)
        self.bar = None

    def __exit__(self, *error: Any) -> None:
        if self.bar is not None:
            self._end_bar()
        self.doing.__exit__()


class Doing:
    """What is being done and for how long, on one line of a terminal, and nothing elsewhere."""

    def __init__(self, quiet: bool) -> None:
        self.shown = _terminal(quiet)
        self.what, self.since = "", 0.0
        self.over = threading.Event()
        self.clock: threading.Thread | None = None

    def __enter__(self) -> Callable[[str], None]:
        return self.show

    def show(self, what: str) -> None:
        """Tells what is being done."""
        if not self.shown:
            return
        self.what, self.since = what, time.monotonic()
        self._draw()
        if self.clock is None:
            self.clock = threading.Thread(target=self._tick, daemon=True)
            self.clock.start()

    def _tick(self) -> None:
        while not self.over.wait(1.0):
            self._draw()

    def _draw(self) -> None:
        seconds = int(time.monotonic() - self.since)
        passed = f" {seconds // 60}:{seconds % 60:02}" if seconds else ""
        click.echo(f"{CLEAR}{self.what} …{passed}", nl=False, err=True)

    def __exit__(self, *error: Any) -> None:
        if self.clock is not None:
            self.over.set()
            self.clock.join()
            click.echo(CLEAR, nl=False, err=True)
