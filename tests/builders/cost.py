"""What a call costs, told so that a busy machine makes no difference."""

from __future__ import annotations

import os
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from types import FrameType


def processor_seconds() -> float:
    """Seconds of the processor for this process, and for those it started that have ended."""
    spent = os.times()
    return spent.user + spent.system + spent.children_user + spent.children_system


@contextmanager
def at_most(seconds: float) -> Iterator[None]:
    """What is done within takes less than these seconds of the processor, also if it fails."""
    begun = processor_seconds()
    try:
        yield
    finally:
        assert processor_seconds() - begun < seconds


def function_calls(call: Callable[[], object]) -> int:
    """How many functions a call enters, of Python and of C: the same in every run."""
    count = 0

    def entered(_: FrameType, event: str, __: object) -> None:
        nonlocal count
        count += event in ("call", "c_call")

    before = sys.getprofile()
    sys.setprofile(entered)
    try:
        call()
    finally:
        sys.setprofile(before)
    return count
