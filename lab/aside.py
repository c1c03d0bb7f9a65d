"""A second process that makes one call while this one goes on, as drawing and searching would only take turns in one.

It is started before there is anything to do and loads what the call takes; the arguments follow when they are known. It is an
offer: where it cannot be had, or the call fails in it, `done` is false and the caller makes the call itself, so that
results and errors are the same either way.
"""

from __future__ import annotations

import gc
import importlib
import os
import pickle
import subprocess
import sys
from contextlib import suppress
from typing import Any


class Aside:
    """A process that loads a module and waits for the arguments of one call; it ends with the `with` block."""

    def __init__(self, module: str, function: str) -> None:
        """Starts it.

        Args:
            module: where the function lives.
            function: its name; it writes files and gives nothing back.
        """
        self.process: subprocess.Popen[bytes] | None = None
        if _cores() < 2 or not sys.executable or hasattr(sys, "frozen"):
            return
        with suppress(OSError):
            self.process = subprocess.Popen(
                [sys.executable, "-P", "-m", "lab.aside", module, function],
                stdin=subprocess.PIPE,
                stdout=subprocess.DEVNULL,
                stderr=subprocess.DEVNULL,
                # What this process finds, the other finds too, wherever it comes from.
                env={**os.environ, "PYTHONPATH": os.pathsep.join(path or os.getcwd() for path in sys.path)},
            )

    def __enter__(self) -> Aside:
        return self

    def begin(self, *arguments: Any, **options: Any) -> bool:
        """Begins the call; false where it cannot, as when an argument is bound to this process.

        Args:
            arguments: of the function.
            options: likewise, by name.
        """
        if self.process is None or self.process.stdin is None:
            return False
        try:
            call = pickle.dumps((arguments, options))
        except Exception:  # whatever keeps an object from travelling
            return False
        try:
            with self.process.stdin as pipe:
                pipe.write(call)
        except OSError:
            return False
        return True

    def done(self) -> bool:
        """Waits for the end of the call; whether it ended well."""
        return self.process is not None and self.process.wait() == 0

    def __exit__(self, *error: Any) -> None:
        if self.process is None:
            return
        self.process.kill()
        self.process.wait()
        if self.process.stdin is not None:
            with suppress(OSError):
                self.process.stdin.close()


def _cores() -> int:
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def _serve(module: str, function: str) -> None:
    """Makes the call that comes in, if one comes."""
    call = getattr(importlib.import_module(module), function)
    # It makes one call and ends: nothing is worth collecting.
    gc.disable()
    given = sys.stdin.buffer.read()
    if given:
        arguments, options = pickle.loads(given)
        call(*arguments, **options)
    sys.stdin.close()
    # Nothing is left to write, and tidying up the memory takes long.
    os._exit(0 if given else 1)


if __name__ == "__main__":
    _serve(*sys.argv[1:])
