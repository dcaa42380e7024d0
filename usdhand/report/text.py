"""What all reports and their texts share."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from usdhand.problems import Problem


def problems_data(problems: Iterable[Problem]) -> list[dict[str, str]]:
    """Problems as plain data."""
    return [problem_data(problem) for problem in problems]


def problem_data(p: Problem) -> dict[str, str]:
    """A problem as plain data, without its file."""
    return {"severity": p.severity, "code": p.code, "message": p.message, "where": p.where}


def table(rows: Sequence[Sequence[str]], right: Iterable[int] = ()) -> str:
    """Columns lined up; ``right`` tells which are flush right. The first row is the head."""
    right = set(right)
    widths = [max(len(row[i]) for row in rows) for i in range(len(rows[0]))]

    def line(row: Sequence[str]) -> str:
        cells = [
            cell.rjust(w) if i in right else cell.ljust(w)
            for i, (cell, w) in enumerate(zip(row, widths, strict=True))
        ]
        return "  ".join(cells).rstrip()

    return "\n".join(line(row) for row in rows)


def written_to(result: Mapping[str, Any]) -> str:
    """Say where a result is; a dry run has none."""
    output = result["output"]
    return "nothing written (dry run)" if output is None else f"written to {output}"
