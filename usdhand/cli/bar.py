"""A progress bar."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from rich.progress import Progress, TaskID

LEAST_STEPS = 3  # with fewer, no bar is shown


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
