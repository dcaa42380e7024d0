"""Everything odd that a run meets and that does not stop it, as one type."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

from usdhand.display import displayed

Severity = Literal["note", "warning", "error"]

LISTED = 3  # names that a message shows before it says "and N more"
CHOICES = 8  # the same, where the user is to choose one


@displayed()
@dataclass(frozen=True)
class Problem:
    """Something that a person should know.

    Attributes
    ----------
    code : a stable name for scripts, such as "guessed-units"
    message : what is odd, and what to do where something can be done
    where : prim, joint or frame
    severity : a "note" is good to know, nothing is wrong; a "warning" may need care; an
        "error" is something that could not be done, or will be shown wrongly
    file : the file that it is about
    """

    code: str
    message: str
    where: str = ""
    severity: Severity = "warning"
    file: str = ""

    def __str__(self) -> str:
        return f"{self.message} ({self.where})" if self.where else self.message


def counted(count: int, one: str, more: str = "") -> str:
    """Say a number and what it counts: 1 clip, 2 clips; ``more`` where an s does not make it."""
    return f"{count} {one if count == 1 else more or one + 's'}"


def listed(names: Sequence[str], most: int = LISTED) -> str:
    """Show the first few names, and how many more there are."""
    more = f" and {len(names) - most} more" if len(names) > most else ""
    return ", ".join(names[:most]) + more
