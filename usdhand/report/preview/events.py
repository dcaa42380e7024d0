"""Rows of the timeline from the JSON reports of fill and splice, and from warps in files."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from usdhand.anatomy import SIDES, Side
from usdhand.errors import InputError, UsageError
from usdhand.inputs import read_json
from usdhand.motion.rotations import Array

if TYPE_CHECKING:
    from usdhand.report.preview.lanes import Lane

SHOWN_VERBS = ("fill", "splice")


def read_report(path: Path) -> dict[str, Any]:
    """Read a JSON report of fill or splice.

    Raises
    ------
    InputError
        if it is no report.
    UsageError
        if it is one of another verb.
    """
    try:
        report = read_json(path)
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror}).") from error
    except ValueError as error:
        raise InputError(f"{path}: no JSON ({error}).") from error
    verb = report_verb(report)
    if verb not in SHOWN_VERBS:
        shown = f"the timeline shows reports of {' and '.join(SHOWN_VERBS)}."
        if verb:
            raise UsageError(f"{path}: a report of '{verb}'; {shown}")
        raise InputError(f"{path}: not a report of usdhand; {shown}")
    inputs = report.setdefault("inputs", [])
    if not isinstance(inputs, list) or not all(
        isinstance(x, dict) and {"path", "sha256"} <= x.keys() for x in inputs
    ):
        raise InputError(f"{path}: the report is not complete (inputs).")
    return dict(report)


def report_verb(report: Any) -> str:
    """Name of the verb that wrote a report, "" if none of ours did."""
    schema = report.get("schema", "") if isinstance(report, dict) else ""
    return schema[8:].partition("/")[0] if str(schema).startswith("usdhand.") else ""


def lane_of(
    report: Mapping[str, Any], path: Path, lanes: Sequence[Lane], hashes: Sequence[str]
) -> Lane:
    """The lane that a report tells of: its output, or else its input, which has the same time.

    A hand clip will do as well, since it plays in the time of the body. Of several alternatives,
    the segments are those of the first one that was found.

    Parameters
    ----------
    path : of the report; its output may stand beside it
    hashes : SHA-256 of the lanes' files

    Raises
    ------
    UsageError
        if it tells of none of them.
    """
    of = report["inputs"][: 2 if report_verb(report) == "splice" else 1]
    made = [Path(str(report["output"]))] if report.get("output") else []
    places = {
        found
        for m in made
        for p in (m, path.parent / m, path.parent / m.name)
        if (found := _resolved(p))
    }
    files = [lane.clip.origin.path for lane in lanes]
    fitting = [
        lane
        for lane, file in zip(lanes, files, strict=True)
        if file and file.resolve() in places and len(lane.clip) == report.get("frames")
    ]
    for own in of:
        fitting += [x for x, h in zip(lanes, hashes, strict=True) if h and h == own["sha256"]]
    if not fitting:
        names = dict.fromkeys(p.name for p in (*made, *(Path(str(own["path"])) for own in of)))
        raise UsageError(
            f"{path}: the report belongs to none of the files that are shown, but to "
            f"{' and '.join(names) or 'none at all'}."
        )
    alternatives = [x for x in fitting if x.clip.origin.path == fitting[0].clip.origin.path]
    return min(alternatives, key=lambda lane: lane.alternative)


def _resolved(path: Path) -> Path | None:
    try:
        return path.resolve()
    except (OSError, ValueError, RuntimeError):  # no name that a file can have
        return None


def report_rows(report: Mapping[str, Any], path: Path) -> list[dict[str, Any]]:
    """Rows of the timeline: {side, label, spans, marks}; seconds from the body's first frame.

    Raises
    ------
    InputError
        if the report lacks what a report of its verb has.
    """
    try:
        hands = [(side, report["hands"][side]) for side in SIDES if side in report["hands"]]
        if report_verb(report) == "fill":
            return [_fill_row(side, hand) for side, hand in hands]
        return [row for side, hand in hands for row in _splice_rows(side, hand)]
    except (KeyError, TypeError, ValueError, AttributeError, IndexError) as error:
        raise InputError(f"{path}: the report is not complete ({error}).") from error


def retiming(report: Mapping[str, Any]) -> tuple[str, dict[Side, Array]]:
    """Hash of the hand clip of a splice, and its warps (n, 2) [body s, hand s]; "" for others."""
    if report_verb(report) != "splice" or len(report["inputs"]) < 2:
        return "", {}
    if report.get("takes"):  # each plays in its own time
        return "", {}
    hands = report["hands"]
    warps = {s: np.asarray(hands[s]["warp"], float) for s in SIDES if s in hands}
    return str(report["inputs"][1]["sha256"]), warps


def warp_rows(warps: Mapping[Side, Array], fps: float) -> list[dict[str, Any]]:
    """Rows with a mark at every full second of the hand clip, from warps without a report."""
    found = []
    for side, seconds in warps.items():
        body = np.arange(len(seconds)) / fps
        marks = _second_marks(body, seconds)
        found.append({"side": side, "label": "seconds of hand clip", "spans": [], "marks": marks})
    return found


def _fill_row(side: str, hand: Mapping[str, Any]) -> dict[str, Any]:
    spans = [
        {
            "start": float(s["start"]),
            "end": float(s["end"]),
            "label": str(s["clip"]),
            "detail": f"{s['clip']} {s['clip_start']:.2f} to {s['clip_end']:.2f} s, "
            f"distance {s['cost']:.4g}, cost {s['node_cost']:.3g}",
        }
        for s in hand["segments"]
    ]
    return {"side": side, "label": "segments", "spans": spans, "marks": []}


def _splice_rows(side: str, hand: Mapping[str, Any]) -> list[dict[str, Any]]:
    spans = [
        {
            "start": float(p["start"]),
            "end": float(p["end"]),
            "label": "holds" if p["quality"] is None else f"{p['quality']:.2f}",
            "detail": "the hand holds"
            if p["quality"] is None
            else f"agreement {p['quality']:.2f}" + (", worth a pin" if p["look"] else ""),
            "look": bool(p["look"]),
        }
        for p in hand["phases"]
    ]
    pins = [
        {
            "time": float(p["body"]),
            "label": "\N{BLACK DOWN-POINTING TRIANGLE}",
            "detail": f"pin: second {p['body']:.2f} shows {p['hand']:.2f} s of the hand clip",
        }
        for p in hand["pins"]
    ]
    doubts = [
        {
            "start": float(d["start"]),
            "end": float(d["end"]),
            "label": f"{d['off']:.1f} s",
            "detail": f"look here: the timing may be off by up to {d['off']:.2f} s",
            "look": True,
        }
        for d in hand["doubts"]
    ]
    pieces = [
        {
            "start": float(p["start"]),
            "end": float(p["end"]),
            "label": str(int(p["take"]) + 1),
            "detail": f"fingers of take {int(p['take']) + 1}",
        }
        for p in hand.get("pieces", [])
    ]
    warp = np.asarray(hand["warp"], float)
    return [
        *([{"side": side, "label": "takes", "spans": pieces, "marks": []}] if pieces else []),
        {"side": side, "label": "phases", "spans": spans, "marks": pins},
        *([{"side": side, "label": "may be off", "spans": doubts, "marks": []}] if doubts else []),
        {
            "side": side,
            "label": "seconds of hand clip",
            "spans": [],
            "marks": [mark for part in _takes_of(warp, hand) for mark in _second_marks(*part.T)],
        },
    ]


def _takes_of(warp: Array, hand: Mapping[str, Any]) -> list[Array]:
    """A warp (n, 2) split where another take begins, in each of which time goes on."""
    begins = [float(p["start"]) for p in hand.get("pieces", [])[1:]]
    return np.split(warp, np.searchsorted(warp[:, 0], np.array(begins) - 1e-6))


def _second_marks(body: Array, hand: Array) -> list[dict[str, Any]]:
    """Where the hand clip has its full seconds: close together, it is played faster."""
    full: Sequence[float] = np.arange(np.ceil(hand[0]), np.floor(hand[-1]) + 1).tolist()
    times = np.interp(full, hand, body)
    return [
        {"time": float(t), "label": f"{s:g}", "detail": f"second {s:g} of the hand clip"}
        for s, t in zip(full, times, strict=True)
    ]
