"""Progress: how much of some long work is done, told to whoever listens, part by part."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, replace
from itertools import accumulate, pairwise
from typing import TypeVar

Progress = Callable[[str, float], None]
"""Told what is being done, and which share is done of all work known so far, 0 to 1; it falls where more turns up."""

Item = TypeVar("Item")


@dataclass(frozen=True)
class Work:
    """Some work as a part of a whole; nothing happens where no one listens.

    Attributes:
        listener: told how far the whole is.
        what: is being done.
        start, end: shares of the whole that are done before this part and after it.
    """

    listener: Progress | None = None
    what: str = ""
    start: float = 0.0
    end: float = 1.0

    def __call__(self, what: str, share: float) -> None:
        """Tells what is being done and how much of this part is: work is a listener of what it consists of."""
        if self.listener is not None:
            self.listener(what, self.start + (self.end - self.start) * share)

    def done(self, share: float = 1.0) -> None:
        """Tells that so much of this part is done."""
        self(self.what, share)

    def called(self, what: str) -> Work:
        """The same work under another name, told as begun."""
        self(what, 0.0)
        return replace(self, what=what)

    def parts(self, *costs: float) -> list[Work]:
        """What this work consists of, one after the other, each as long as it costs in any unit."""
        ends = [sum_ / sum(costs) for sum_ in accumulate(costs, initial=0.0)]
        length = self.end - self.start
        return [
            replace(self, start=self.start + length * a, end=self.start + length * b)
            for a, b in pairwise(ends)
        ]

    def each(self, items: Iterable[Item], n: int | None = None) -> Iterator[Item]:
        """The items, this part being done when all of them are dealt with.

        Args:
            items: to go through.
            n: how many there are; their length when None.
        """
        if self.listener is None:
            yield from items
            return
        items = list(items) if n is None else items
        total = len(items) if n is None else n  # type: ignore[arg-type]
        for number, item in enumerate(items, 1):
            yield item
            self.done(number / total)


UNHEARD = Work()
"""Work of which no one wants to know."""
