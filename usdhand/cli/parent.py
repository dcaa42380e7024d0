"""The process that waits for the one that works, and tells how it ended."""

from __future__ import annotations

import os
import signal
import sys
from typing import NoReturn

from usdhand.errors import CrashedError, UnforeseenError, UsdHandError
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
    if -code in FAULTS:
        error = _crash(code, opened.decode(errors="backslashreplace"))
        if "--json" in sys.argv:
            _report(error)
        sys.stderr.write(f"Error: {error}\n")
        code = error.exit_code
    elif code < 0:
        if -code == signal.SIGKILL:
            sys.stderr.write(f"Error: usdhand was ended by {died_of(code)}.\n")
        code = 128 - code
    sys.stderr.flush()
    os._exit(code)


def _crash(code: int, opened: str) -> UsdHandError:
    """What a crash means: that of a file that had been opened is the file's."""
    how = died_of(code)
    if not opened:
        return UnforeseenError(f"usdhand crashed ({how}).")
    return CrashedError(f"{opened}: {crashed(how)}")


def _report(error: UsdHandError) -> NoReturn:
    """Let the command line report the crash instead of working; it exits by itself."""
    from usdhand.cli.command import Crash
    from usdhand.cli.main import main

    Crash.error = error
    main()
    sys.exit(error.exit_code)
