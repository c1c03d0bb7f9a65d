"""What a terminal sees of long work: a bar, what is being done, and the time left."""

from __future__ import annotations

import sys
import threading
import time
from typing import Any

import click

from lab.cli.time_left import TimeLeft, told

CLEAR = "\r\x1b[K"
"""Back to the start of the line, which is cleared."""
SHOW_CURSOR = "\x1b[?25h"
"""The bar hides it."""
STEPS = 1000
WIDEST = 30
"""Room for what is being done, so that the bar stays where it is."""
FALL = 0.02
"""Of the share done, from which on a new bar begins."""


class Bar:
    """A bar with the time left on a terminal, and nothing elsewhere; a new one where more work turns up."""

    def __init__(self, quiet: bool) -> None:
        self.shown = sys.stderr.isatty() and not quiet
        self.bar: Any = None
        self.left = TimeLeft(0.0, 0.0)
        self.lock, self.over = threading.Lock(), threading.Event()
        self.clock: threading.Thread | None = None

    def __enter__(self) -> Bar:
        return self

    def __call__(self, what: str, share: float) -> None:
        """Shows what is being done, and the share of the work that is done."""
        if not self.shown:
            return
        with self.lock:
            now = time.monotonic()
            if self.bar is None or share < self.left.share - FALL:
                self._begin(share, now)
            self.left.reached(share, now)
            self.bar.label = f"{what:<{WIDEST}}"
            self.bar.pos = round(STEPS * self.left.share_of_rest)
            self.bar.render_progress()
        if self.clock is None:
            self.clock = threading.Thread(target=self._tick, daemon=True)
            self.clock.start()

    def _begin(self, share: float, now: float) -> None:
        self.left = TimeLeft(share, now)
        self.bar = click.progressbar(
            length=STEPS, width=24, show_eta=False, item_show_func=lambda _: self._info(), file=sys.stderr
        )

    def _info(self) -> str:
        now = time.monotonic()
        return told(self.left.seconds(now), now - self.left.begun)

    def _tick(self) -> None:
        while not self.over.wait(1.0):
            with self.lock:
                self.bar.render_progress()

    def __exit__(self, *error: Any) -> None:
        if self.clock is not None:
            self.over.set()
            self.clock.join()
        if self.bar is not None:
            click.echo(CLEAR + SHOW_CURSOR, nl=False, err=True)
