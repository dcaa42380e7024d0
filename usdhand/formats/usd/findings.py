"""What a check found, as values."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

Severity = Literal["error", "warning"]


@dataclass(frozen=True)
class Finding:
    """One thing that is wrong, or likely to surprise, in a file.

    Attributes
    ----------
    severity : "error" where motion is lost or shown wrongly, "warning" for all else
    code : a stable name for scripts; "suite:Validator.Name" where UsdValidation found it
    message : what is wrong and what to do
    where : prim, property or file
    """

    severity: Severity
    code: str
    message: str
    where: str = ""

    def __str__(self) -> str:
        where = f" ({self.where})" if self.where else ""
        return f"{self.severity}: {self.message}{where} [{self.code}]"
