"""The time that work still takes, from what it took so far."""

from __future__ import annotations

SOONEST, LEAST = 2.0, 0.03
"""Seconds passed, and share done, before which the pace is not known."""


class TimeLeft:
    """Follows the share of some work that is done."""

    def __init__(self, share: float, now: float) -> None:
        """Begins at a share done already and a time [s]."""
        self.first, self.begun = share, now
        self.share, self.last = share, now

    def reached(self, share: float, now: float) -> None:
        """Tells that a share is done at a time [s]; one that falls a little changes nothing."""
        if share > self.share:
            self.share, self.last = min(share, 1.0), now

    @property
    def share_of_rest(self) -> float:
        """Share done of what there was to do at the beginning."""
        return (self.share - self.first) / (1 - self.first) if self.first < 1 else 1.0

    def seconds(self, now: float) -> float | None:
        """Time left at the pace so far [s]; None while that is not known.

        Between two shares it runs down, and waits at zero.
        """
        done, passed = self.share_of_rest, self.last - self.begun
        if passed < SOONEST or done < LEAST:
            return None
        return max(passed / done * (1 - done) - (now - self.last), 0.0)


def told(left: float | None, passed: float) -> str:
    """What is left, or while that is not known, what has passed; nothing within the first second."""
    if left is not None:
        return f"{in_words(left)} left"
    return f"{in_words(passed)} so far" if passed >= 1 else ""


def in_words(seconds: float) -> str:
    """A time such as 1:05, or 2:00:07."""
    whole = round(seconds)
    hours, minutes = divmod(whole // 60, 60)
    return f"{hours}:{minutes:02}:{whole % 60:02}" if hours else f"{minutes}:{whole % 60:02}"
