"""What is in files, and which joints are the hands."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import Any

from usdhand.errors import HandNotFoundError, UsageError, UsdHandError
from usdhand.formats.files import animation_names, read_any, read_character
from usdhand.formats.suffixes import USD_SUFFIXES
from usdhand.formats.usd.read import motion_or_pose
from usdhand.formats.usd.rig_library import read_with_rig
from usdhand.problems import Problem
from usdhand.reduce.rig import ReducedRig
from usdhand.report.inspect import inspect_result, rig_result, summary
from usdhand.report.plots import rigs
from usdhand.report.plots.style import check_plots
from usdhand.requests.inspect import InspectRequest
from usdhand.rigs import Conventions
from usdhand.verbs.clips import conventions_of, find_hands, rig_files
from usdhand.verbs.files import find_files
from usdhand.verbs.outcome import Journal, Outcome
from usdhand.workers import each_apart


def run(request: InspectRequest, journal: Journal) -> Outcome:
    """Look into every file; exit 4 if one has no hands, or as the worst of its errors says."""
    paths = find_files(request.files)
    conventions = conventions_of(request)
    if request.plots is not None:
        check_plots(request.plots, rigs.NAMES, request.force)
    results: list[dict[str, Any]] = []
    found_rigs: list[ReducedRig] = []
    code = 0
    each = partial(_inspect, skel=request.skel, conventions=conventions)
    for path, done in journal.each(each_apart(each, paths), "inspecting", len(paths)):
        if isinstance(done, UsdHandError):
            journal.fail(done, path)
            code = max(code, done.exit_code)
            found: dict[str, Any] = {"error": str(done)}
        else:
            found, rig, odd = done
            found_rigs += [rig] if rig else []
            journal.about(path, odd)  # the text tells them below each file
        if "hand_error" in found:
            journal.fail(HandNotFoundError(found["hand_error"]), path)
            code = max(code, HandNotFoundError.exit_code)
        results.append({"path": str(path)} | found)
    if request.plots is not None and len(found_rigs) != 1:
        raise UsageError(
            f"--plots draws the hands of one rig; {len(found_rigs)} of these files hold a rig."
        )
    return Outcome(
        request,
        (*paths, *rig_files(request)),
        lambda: {"files": results},
        summary,
        figures=lambda: rigs.figures(found_rigs[0]),
        exit_code=code,
    )


def _inspect(
    path: Path, skel: str | None, conventions: Conventions | None
) -> tuple[dict[str, Any], ReducedRig | None, tuple[Problem, ...]]:
    rig, more = None, dict[str, Any]()
    if path.suffix.lower() in USD_SUFFIXES:
        rig, character = read_with_rig(path, skel)
        if rig is not None:
            more = {"rig": rig_result(rig)}
        if character is None:
            return more, rig, ()
        clip, animated = motion_or_pose(character)
    elif len(names := animation_names(path)) > 1:
        clip, animated = read_character(path, skel), False
        more = {"animations": list(names)}
    else:
        clip, animated = read_any(path, skel)
    try:
        hands = find_hands(clip, conventions)
    except HandNotFoundError as error:
        more["hand_error"] = str(error)
        return inspect_result(clip, None, animated) | more, rig, clip.problems
    odd = (*clip.problems, *hands.problems)
    return inspect_result(clip, hands, animated) | more, rig, odd
