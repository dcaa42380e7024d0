"""Which file is being opened, told before it is: USD may crash on it and not return."""

from __future__ import annotations

import os
import signal
from collections.abc import Callable

_listeners: list[Callable[[str], object]] = []

# Signals by which a process dies of a fault of its own, as USD does on some damaged files.
FAULTS = {
    getattr(signal, name)
    for name in ("SIGSEGV", "SIGBUS", "SIGABRT", "SIGFPE", "SIGILL", "SIGTRAP", "SIGSYS")
    if hasattr(signal, name)
}


def opening(path: str) -> None:
    """Tell that a file is about to be opened."""
    for listener in _listeners:
        listener(path)


def listen(listener: Callable[[str], object]) -> None:
    """Tell ``listener`` of every file that this process opens from now on."""
    _listeners.append(listener)


def end_with_parent(parent: int) -> None:
    """Let this process end when its parent does, however that ends; on Linux only.

    What is begun is cleaned up: it gets SIGTERM.
    """
    if os.name != "posix" or not os.path.isdir("/proc/self"):  # noqa: PTH112
        return
    import ctypes

    pr_set_pdeathsig = 1
    ctypes.CDLL(None).prctl(pr_set_pdeathsig, signal.SIGTERM)
    if os.getppid() != parent:  # it has ended already
        os._exit(128 + signal.SIGTERM)


def without_core_dump() -> None:
    """Let a crash of this process leave no file."""
    try:
        import resource
    except ImportError:  # not on this system
        return
    resource.setrlimit(resource.RLIMIT_CORE, (0, resource.getrlimit(resource.RLIMIT_CORE)[1]))


def died_of(code: int) -> str:
    """Say how a process ended, from its return code as subprocess has it."""
    if code >= 0:
        return f"exit code {code}"
    try:
        name = signal.Signals(-code).name
    except ValueError:
        name = f"signal {-code}"
    if name == "SIGKILL":
        return "SIGKILL, which often means that the memory was not enough"
    return name


def crashed(how: str) -> str:
    """What is said of the file that was opened last, after its path."""
    return f"USD crashed while this file was read ({how}): it is damaged, or USD has a fault."
