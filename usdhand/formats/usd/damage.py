"""What USD prints and raises on files that are damaged, as sentences and errors for people."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import wraps
from inspect import signature
from pathlib import Path
from typing import Any, ParamSpec, TypeVar

import numpy as np
from pxr import Tf, UsdUtils

from usdhand.errors import InputError

LONGEST = 200  # characters of what USD says; it quotes damaged lines of any length

P = ParamSpec("P")
R = TypeVar("R")


@contextmanager
def usd_diagnostics() -> Iterator[list[str]]:
    """Collect what USD would print to stderr, as plain sentences."""
    delegate = UsdUtils.CoalescingDiagnosticDelegate()
    messages: list[str] = []
    shown, sys.excepthook = sys.excepthook, _not_shown
    try:
        yield messages
    finally:
        sys.excepthook = shown
        messages += [sentence(d) for d in delegate.TakeUncoalescedDiagnostics()]
        del delegate


def _not_shown(*_: object) -> None:
    """Stand for what shows errors that nobody handles: USD has it show those of its values."""


@contextmanager
def damage_refused(path: str | Path) -> Iterator[None]:
    """Turn what USD raises on data that it cannot unpack into an error for people.

    Raises
    ------
    InputError
        if the file is damaged inside: it opens, but its values cannot be read.
    """
    with usd_diagnostics():
        try:
            yield
        except Tf.ErrorException as error:
            raise _damaged(path, first_line(*map(sentence, error.args))) from error
        except UnicodeError as error:
            raise _damaged(path, "a text in it is not UTF-8") from error
        except np.linalg.LinAlgError as error:
            raise _damaged(path, "transforms have values that are not numbers") from error
        except MemoryError as error:
            raise _damaged(path, "a value is larger than the memory") from error
        except TypeError as error:
            if not any(name in str(error) for name in ("to_python", "UnregisteredValue")):
                raise
            raise _damaged(path, "a value is of no known type") from error


def refuses_damage(function: Callable[P, R]) -> Callable[P, R]:
    """Guard a function whose first argument is a file, or knows its own: see `damage_refused`."""
    first = next(iter(signature(function).parameters))

    @wraps(function)
    def guarded(*args: P.args, **kwargs: P.kwargs) -> R:
        of: Any = args[0] if args else kwargs[first]
        with damage_refused(of if isinstance(of, (str, Path)) else of.path):
            return function(*args, **kwargs)

    return guarded


def sentence(diagnostic: Any) -> str:
    """What a diagnostic of USD says."""
    try:
        return str(diagnostic.commentary).strip()
    except UnicodeDecodeError:  # it quotes bytes of a damaged file
        return "it has bytes that are not text"


def first_line(*texts: str) -> str:
    """The start of what was said, without control characters."""
    lines = "\n".join(texts).strip().splitlines()
    text = "".join(c if c.isprintable() else "?" for c in lines[0]) if lines else "no reason given"
    return text.rstrip(".") if len(text) <= LONGEST else f"{text[:LONGEST]}..."


def _damaged(path: str | Path, why: str) -> InputError:
    return InputError(f"{path}: the file is damaged, values cannot be read ({why}).")
