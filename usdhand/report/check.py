"""What `check` reports of a file."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from usdhand.problems import Problem, counted


def check_result(findings: Sequence[Problem]) -> dict[str, Any]:
    """Everything `check` reports of one file."""
    return {
        "ok": all(f.severity != "error" for f in findings),
        "findings": [
            {"severity": f.severity, "code": f.code, "message": f.message, "where": f.where}
            for f in findings
        ],
    }


def summary(result: Mapping[str, Any], verbose: bool) -> str:
    """A line a file, and below it what was found."""
    del verbose
    lines: list[str] = []
    for file in result["files"]:
        if "error" in file:
            continue
        found = file["findings"]
        errors = sum(f["severity"] == "error" for f in found)
        lines.append(
            f"{file['path']}: {counted(errors, 'error')}, {counted(len(found) - errors, 'warning')}"
        )
        for f in found:
            where = f" ({f['where']})" if f["where"] else ""
            lines.append(f"  {f['severity']}: {f['message']}{where} [{f['code']}]")
    return "\n".join(lines)
