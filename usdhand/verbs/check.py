"""Files checked with UsdValidation and rules of our own."""

from __future__ import annotations

from typing import Any

from usdhand.errors import UsdHandError
from usdhand.formats.suffixes import USD_SUFFIXES
from usdhand.formats.usd.check import check_file
from usdhand.report.check import check_result, summary
from usdhand.requests.check import CheckRequest
from usdhand.verbs.files import find_files
from usdhand.verbs.outcome import Journal, Outcome


def run(request: CheckRequest, journal: Journal) -> Outcome:
    """Check every file; exit 1 if one has an error, or with ``strict`` a warning."""
    paths = find_files(request.files, USD_SUFFIXES)
    results: list[dict[str, Any]] = []
    code = 0
    for path in journal.each(paths, "checking"):
        try:
            result = check_result(check_file(path, request.skel))
        except UsdHandError as error:
            journal.fail(error, path)
            results.append({"path": str(path), "ok": False, "error": str(error)})
            code = max(code, error.exit_code)
            continue
        failed = not result["ok"] or (request.strict and result["findings"])
        code = max(code, int(bool(failed)))
        results.append({"path": str(path), **result})
    return Outcome(request, tuple(paths), lambda: {"files": results}, summary, exit_code=code)
