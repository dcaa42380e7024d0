"""What people see: text, warnings, errors."""

from __future__ import annotations

from typing import TYPE_CHECKING

import click

from usdhand.errors import UnforeseenError, UsdHandError

if TYPE_CHECKING:
    from usdhand.problems import Problem

LONGEST = 2000  # characters of a line


def say(text: str) -> None:
    """Print for people; bytes of file names that are no text as escapes."""
    click.echo(_printable(text))


def complain(text: str) -> None:
    """Print to stderr what went wrong; what it quotes of a damaged file may be of any length."""
    lines = _printable(text).splitlines()
    short = (
        x if len(x) <= LONGEST else f"{x[: LONGEST // 2]} ... {x[-LONGEST // 2 :]}" for x in lines
    )
    click.echo("\n".join(short), err=True)


def _printable(text: str) -> str:
    return text.encode("utf-8", "backslashreplace").decode("utf-8")


def show(problem: Problem) -> None:
    """Print a problem to stderr: `Warning: FILE: MESSAGE (WHERE)`."""
    text = str(problem)
    if problem.file and problem.file not in text:
        text = f"{problem.file}: {text}"
    complain(f"{problem.severity.capitalize()}: {text}")


def foreseen(error: Exception) -> UsdHandError:
    """Return an error as one of ours; one that nobody expected is told in one line."""
    if isinstance(error, UsdHandError):
        return error
    said = " ".join(str(error).split()).encode("utf-8", "backslashreplace").decode()[:200]
    name = type(error).__name__
    what = f"{name}: {said}" if said else name
    return UnforeseenError(f"an unexpected error ({what}); usdhand --debug shows where")
