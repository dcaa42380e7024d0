"""What can go wrong, as one tree: each error knows the exit code of the command line."""

from __future__ import annotations


class UsdHandError(Exception):
    """Base of all errors that a person should read: says what is wrong, where, and what to do.

    Attributes
    ----------
    exit_code : of the command line
    code : of the problem that stands for the error in an Outcome
    """

    exit_code = 1
    code = "failed"


class UsageError(UsdHandError):
    """The arguments contradict each other or cannot be carried out (exit 2)."""

    exit_code = 2
    code = "usage"


class OutputError(UsageError):
    """The output exists, equals an input, or cannot be written (exit 2)."""

    code = "output"


class InputError(UsdHandError):
    """A file is missing, unreadable, or holds motion that cannot be used (exit 3)."""

    exit_code = 3
    code = "input"


class CrashedError(InputError):
    """USD crashed while it read a file (exit 3)."""

    code = "crashed"


class UnforeseenError(UsdHandError):
    """An error that nobody expected (exit 1)."""

    code = "unforeseen"


class HandNotFoundError(UsdHandError):
    """No hand was found, or two candidates claim the same place (exit 4)."""

    exit_code = 4
    code = "hand-not-found"


class QualityError(UsdHandError):
    """A quality limit that was asked for cannot be met (exit 5)."""

    exit_code = 5
    code = "quality"


class CancelledError(UsdHandError):
    """Work was stopped by whoever watched its progress (exit 130)."""

    exit_code = 130
    code = "cancelled"


class InterruptedBuildError(UsdHandError):
    """A build of a library was interrupted; what was read is kept (exit 130)."""

    exit_code = 130
    code = "interrupted"


class TerminatedBuildError(UsdHandError):
    """A build of a library was ended by SIGTERM; what was read is kept (exit 143)."""

    exit_code = 143
    code = "terminated"
