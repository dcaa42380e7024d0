"""What people see: text, warnings, progress."""

from __future__ import annotations

from typing import TYPE_CHECKING

import click

if TYPE_CHECKING:
    from rich.progress import Progress, TaskID

    from usdhand.problems import Problem

LONGEST = 2000  # characters of a line
LEAST_STEPS = 3  # with fewer, no bar is shown


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


class Bar:
    """A progress bar for whoever is watching; nothing where stderr is no terminal."""

    def __init__(self) -> None:
        self._progress: Progress | None = None
        self._task: TaskID | None = None
        self._doing = ""

    def __call__(self, doing: str, done: int, total: int) -> None:
        """Show how far it is."""
        if doing != self._doing:
            self.close()
            self._doing = doing
            self._open(doing, total)
        if self._progress is not None and self._task is not None:
            self._progress.update(self._task, completed=done, total=total)
            if done >= total:
                self.close()

    def close(self) -> None:
        """Take the bar away."""
        if self._progress is not None:
            self._progress.stop()
            self._progress = None

    def _open(self, doing: str, total: int) -> None:
        if total < LEAST_STEPS:
            return
        from rich.console import Console
        from rich.progress import Progress

        console = Console(stderr=True)
        if console.is_terminal:
            self._progress = Progress(console=console, transient=True)
            self._task = self._progress.add_task(doing, total=total)
            self._progress.start()
