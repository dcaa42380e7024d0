"""Work on many files in processes of their own, where a file can crash USD and nothing else."""

from __future__ import annotations

import os
import pickle
import queue
import signal
import subprocess
import sys
import threading
from collections.abc import Callable, Generator, Sequence
from dataclasses import dataclass
from typing import Any, Generic, TypeVar

from usdhand.errors import CrashedError, UnforeseenError, UsdHandError
from usdhand.witness import crashed, died_of, end_with_parent, listen, without_core_dump

T = TypeVar("T")
R = TypeVar("R")
PATIENCE_S = 5.0  # for a process to end that was told to


def each_apart(
    function: Callable[[T], R], items: Sequence[T], jobs: int = 1
) -> Generator[tuple[T, R | UsdHandError], None, None]:
    """Call a function for each item in other processes, and yield what comes of it.

    A process holds one item at a time, so that it is known which one it died of; a new process
    goes on with the next. With one process, results come in order. A single item, which takes
    nothing else with it, is worked on here, and what nobody expected is raised.

    Parameters
    ----------
    function : one that can be pickled, as must be items and results
    jobs : processes

    Yields
    ------
    The item, and its result or the error that it ended with: `CrashedError` for one that the
    process died of.
    """
    if len(items) == 1:
        yield items[0], _tried(function, items[0])
        return
    tasks: queue.SimpleQueue[T | _End] = queue.SimpleQueue()
    results: queue.SimpleQueue[tuple[T, R | UsdHandError]] = queue.SimpleQueue()
    workers = [_Worker(function, tasks, results) for _ in range(max(1, min(jobs, len(items))))]
    for item in items:
        tasks.put(item)
    for _ in workers:
        tasks.put(_End())
    try:
        for worker in workers:
            worker.start()
        for _ in items:
            yield results.get()
    finally:
        for worker in workers:
            worker.stop()
        for worker in workers:
            worker.join()


class _End:
    """Stands behind the last item."""


class _Worker(threading.Thread, Generic[T, R]):
    """Keeps a process at work. It makes the process itself, since that ends with its thread."""

    def __init__(
        self,
        function: Callable[[T], R],
        tasks: queue.SimpleQueue[T | _End],
        results: queue.SimpleQueue[tuple[T, R | UsdHandError]],
    ) -> None:
        super().__init__(daemon=True)
        self._function, self._tasks, self._results = function, tasks, results
        self._child: _Child | None = None
        self._stopped = threading.Event()

    def run(self) -> None:
        while not self._stopped.is_set():
            item = self._tasks.get()
            if isinstance(item, _End):
                break
            child = self._child = self._child or _Child(self._function)
            if self._stopped.is_set():
                child.process.terminate()
            answer = child.ask(item)
            if isinstance(answer, CrashedError):
                child.end()
                self._child = None
            self._results.put((item, answer))
        if self._child is not None:
            self._child.end()

    def stop(self) -> None:
        """Let the process end; at once if it is at work, which then cleans up what it began."""
        self._stopped.set()
        if self._child is not None:
            self._child.process.terminate()


@dataclass(frozen=True)
class _Answer:
    """What a process sends: a file that it opens, or what came of an item."""

    opening: str = ""
    value: Any = None


class _Child:
    """A process that calls a function for one item after the other."""

    def __init__(self, function: Callable[..., Any]) -> None:
        found = f"import sys; sys.path[:] = {sys.path!r}"
        start = f"{found}; from usdhand.workers import serve; serve()"
        self.process = subprocess.Popen(
            [sys.executable, "-W", "ignore", "-c", start],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
        )
        self._first = pickle.dumps((os.getpid(), function))

    def ask(self, item: Any) -> Any:
        """Return what came of an item, or the error that stands for it."""
        process, opened = self.process, ""
        assert process.stdin is not None
        assert process.stdout is not None
        try:
            process.stdin.write(self._first + pickle.dumps(item))
            process.stdin.flush()
            self._first = b""
            while isinstance(answer := pickle.load(process.stdout), _Answer) and answer.opening:
                opened = answer.opening
            return answer.value
        except (EOFError, OSError, pickle.UnpicklingError):
            process.kill()
            how = died_of(process.wait())
            return CrashedError(f"{opened or item}: {crashed(how)}")

    def end(self) -> None:
        """Wait for the end of the process, which comes once there is nothing more to do."""
        for pipe in (self.process.stdin, self.process.stdout):
            if pipe is not None:
                try:
                    pipe.close()
                except OSError:  # it is gone already
                    continue
        try:
            self.process.wait(PATIENCE_S)
        except subprocess.TimeoutExpired:
            self.process.kill()
            self.process.wait()


def serve() -> None:
    """Be the process: take items from stdin, and send answers to what was stdout."""
    items, answers = sys.stdin.buffer, os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)  # what USD prints must not get among the answers
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the parent is told, and decides
    without_core_dump()

    def send(answer: _Answer) -> None:
        pickle.dump(answer, answers)
        answers.flush()

    listen(lambda path: send(_Answer(path)))

    def whatever(function: Callable[[Any], Any], item: Any) -> Any:
        try:
            return _tried(function, item)
        except Exception as error:
            said = f"{type(error).__name__}: {error}"
            return UnforeseenError(f"{item}: an unexpected error ({said}).")

    try:
        parent, function = pickle.load(items)
        end_with_parent(parent)
        while True:
            send(_Answer(value=whatever(function, pickle.load(items))))
    except EOFError:
        return


def _tried(function: Callable[[Any], Any], item: Any) -> Any:
    try:
        return function(item)
    except UsdHandError as error:
        return error
