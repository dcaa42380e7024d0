"""How far long work is, told to whoever wants to know; they may stop it."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from typing import TypeVar

from usdhand.errors import CancelledError

T = TypeVar("T")

# Gets how many steps are done and how many there are; what returns False stops the work.
Progress = Callable[[int, int], object]


def each(items: Iterable[T], total: int, progress: Progress | None) -> Iterator[T]:
    """Yield items, telling ``progress`` before each and at the end.

    Raises
    ------
    CancelledError
        if it returned False.
    """
    for done, item in enumerate(items):
        told(done, total, progress)
        yield item
    told(total, total, progress)


def told(done: int, total: int, progress: Progress | None) -> None:
    """Tell how far it is.

    Raises
    ------
    CancelledError
        if ``progress`` returned False.
    """
    if progress is not None and progress(done, total) is False:
        raise CancelledError(f"Stopped after {done} of {total} steps, as asked.")


class Steps:
    """Counts the steps of several pieces of work as one.

    Raises `CancelledError` where ``progress`` returns False, also right at the beginning.
    """

    def __init__(self, total: int, progress: Progress | None) -> None:
        self.done, self.total, self._progress = 0, total, progress
        self.add(0)

    def add(self, count: int = 1) -> None:
        """Tell that so many more steps are done."""
        self.done += count
        told(self.done, self.total, self._progress)
