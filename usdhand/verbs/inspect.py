"""What is in files, and which joints are the hands."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import Any

from usdhand.errors import HandNotFoundError, UsdHandError
from usdhand.formats.files import animation_names, read_any, read_character
from usdhand.report.inspect import inspect_result, summary
from usdhand.requests.inspect import InspectRequest
from usdhand.rigs import Conventions, load_conventions
from usdhand.verbs.clips import find_hands
from usdhand.verbs.files import find_files
from usdhand.verbs.outcome import Journal, Outcome
from usdhand.workers import each_apart


def run(request: InspectRequest, journal: Journal) -> Outcome:
    """Look into every file; exit 4 if one has no hands, or as the worst of its errors says."""
    paths = find_files(request.files)
    conventions = load_conventions(*request.maps)
    results: list[dict[str, Any]] = []
    code = 0
    each = partial(_inspect, skel=request.skel, conventions=conventions)
    for path, found in journal.each(each_apart(each, paths), "inspecting", len(paths)):
        if isinstance(found, UsdHandError):
            journal.fail(found)
            code = max(code, found.exit_code)
            found = {"error": str(found)}
        if "hand_error" in found:
            journal.fail(HandNotFoundError(found["hand_error"]))
            code = max(code, HandNotFoundError.exit_code)
        results.append({"path": str(path)} | found)
    return Outcome(
        request, (*paths, *request.maps), lambda: {"files": results}, summary, exit_code=code
    )


def _inspect(path: Path, skel: str | None, conventions: Conventions | None) -> dict[str, Any]:
    names = animation_names(path)
    clip, animated = read_any(path, skel) if len(names) < 2 else (read_character(path, skel), False)
    more = {"animations": list(names)} if len(names) > 1 else {}
    try:
        return inspect_result(clip, find_hands(clip, conventions), animated) | more
    except HandNotFoundError as error:
        return inspect_result(clip, None, animated) | more | {"hand_error": str(error)}
