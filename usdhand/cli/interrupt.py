"""Ctrl-C: remembered, since an import that it falls into makes another error of it."""

from __future__ import annotations

import sys
from typing import NoReturn


class Interrupt:
    """Whether it came."""

    came = False


def interrupt(*_: object) -> NoReturn:
    """Handle SIGINT.

    Raises
    ------
    KeyboardInterrupt
        always.
    """
    Interrupt.came = True
    raise KeyboardInterrupt


def end_interrupted() -> NoReturn:
    """Say so, and exit with 130."""
    sys.stderr.write("Interrupted.\n")
    sys.exit(130)
