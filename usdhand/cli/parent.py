"""The process that waits for the one that works, and tells how it ended."""

from __future__ import annotations

import os
import signal
import sys
from typing import NoReturn

from usdhand.witness import FAULTS, crashed, died_of

FORWARDED = ("SIGTERM", "SIGHUP")


def wait_for(child: int, told: int) -> NoReturn:
    """Wait for the child, pass signals on to it, and exit as it did.

    ``told`` is a pipe through which the child names each file that it opens.
    """

    def forward(number: int, _: object) -> None:
        try:
            os.kill(child, number)
        except ProcessLookupError:
            return

    for name in FORWARDED:
        if signal.getsignal(number := getattr(signal, name)) is signal.SIG_DFL:
            signal.signal(number, forward)
    names = b""
    while more := os.read(told, 65536):
        names = (names + more)[-65536:]
    opened = names.rpartition(b"\0")[0].rpartition(b"\0")[2]
    _, status = os.waitpid(child, 0)
    code = os.waitstatus_to_exitcode(status)
    if code < 0:
        text, code = _end(code, opened.decode(errors="backslashreplace"))
        sys.stderr.write(text)
        sys.stderr.flush()
    os._exit(code)


def _end(code: int, opened: str) -> tuple[str, int]:
    """What to say of a child that a signal ended, and the exit code."""
    how = died_of(code)
    if -code == signal.SIGKILL:
        return f"Error: usdhand was ended by {how}.\n", 128 - code
    if -code not in FAULTS:
        return "", 128 - code
    if not opened:
        return f"Error: usdhand crashed ({how}).\n", 1
    return f"Error: {opened}: {crashed(how)}\n", 3
