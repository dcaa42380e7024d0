"""Where the program starts. The work is done in a child process, whose death is told in words."""

from __future__ import annotations

import os
import signal
import sys
import warnings

from usdhand.cli.interrupt import Interrupt, end_interrupted, interrupt
from usdhand.cli.parent import wait_for
from usdhand.witness import end_with_parent, listen, without_core_dump


def main() -> None:
    """Run the command line; exit with its code, or with 3 if a file crashed USD."""
    try:
        if hasattr(os, "fork"):
            _work_in_a_child()
        else:
            _work()
    except KeyboardInterrupt:
        end_interrupted()


def _work_in_a_child() -> None:
    # Cheap, and safe: nothing is imported yet, so that no thread runs.
    told, telling = os.pipe()
    parent = os.getpid()
    before = signal.signal(signal.SIGINT, signal.SIG_IGN)  # the child gets it as well
    child = os.fork()
    if child:
        os.close(telling)
        wait_for(child, told)
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
    except Exception:
        if Interrupt.came:  # in the middle of an import, which makes errors of it
            end_interrupted()
        raise
