"""Where the program starts. The work is done in a child process, whose death is told in words."""

from __future__ import annotations

import os
import signal
import sys
import warnings
from typing import NoReturn

from usdhand.cli.interrupt import Interrupt, end_interrupted, interrupt
from usdhand.witness import FAULTS, crashed, died_of, end_with_parent, listen, without_core_dump

FORWARDED = ("SIGTERM", "SIGHUP")


def main() -> None:
    """Run the command line; exit with its code, or with 3 if a file crashed USD."""
    if not hasattr(os, "fork"):
        _work()
        return
    # Cheap, and safe: nothing is imported yet, so that no thread runs.
    told, telling = os.pipe()
    parent = os.getpid()
    before = signal.signal(signal.SIGINT, signal.SIG_IGN)  # the child gets it as well
    child = os.fork()
    if child:
        os.close(telling)
        _wait(child, told)
    os.close(told)
    signal.signal(signal.SIGINT, interrupt if before is signal.default_int_handler else before)
    end_with_parent(parent)
    without_core_dump()
    if "--debug" not in sys.argv:
        _without_noise()
    listen(lambda path: os.write(telling, os.fsencode(path) + b"\0"))
    _work()


def _without_noise() -> None:
    """Let nothing but our own words reach stderr: C++ libraries print to its number."""
    own = os.dup(2)
    sys.stderr = open(own, "w", buffering=1, errors="backslashreplace")  # noqa: PTH123, SIM115
    null = os.open(os.devnull, os.O_WRONLY)
    os.dup2(null, 2)
    os.close(null)


def _work() -> None:
    if not sys.warnoptions:  # numpy's are for developers: results are checked
        warnings.simplefilter("ignore")
    try:
        from usdhand.cli.main import main as verbs

        verbs()
    except KeyboardInterrupt:
        end_interrupted()
    except Exception:
        if Interrupt.came:  # in the middle of an import, which makes errors of it
            end_interrupted()
        raise


def _wait(child: int, told: int) -> NoReturn:
    """Wait for the child, pass signals on to it, and exit as it did."""

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
