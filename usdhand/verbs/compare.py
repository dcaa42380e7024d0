"""Two motions compared."""

from __future__ import annotations

from pathlib import Path

from usdhand.errors import QualityError, UsageError
from usdhand.evaluate.compare import Comparison, compare_clips
from usdhand.formats.files import read_clip
from usdhand.motion import Clip
from usdhand.report.compare import compare_result, summary
from usdhand.requests.compare import CompareRequest
from usdhand.rigs import Conventions
from usdhand.verbs.clips import conventions_of, find_hands, misleading_names, rig_files
from usdhand.verbs.outcome import Journal, Outcome


def compare(
    a: Clip | str | Path,
    b: Clip | str | Path,
    *,
    align: bool = False,
    conventions: Conventions | None = None,
) -> Comparison:
    """Compare motion B with motion A, both from their first frame on, at A's frame rate.

    Characters may differ: hands are compared by anatomical channels, fingertips in the palm's axes.

    Parameters
    ----------
    align : shift B by the lag that was found before comparing

    Raises
    ------
    InputError
        if a file cannot be used.
    HandNotFoundError
        if a clip has no hands.
    UsageError
        if the clips have no hand joint in common.
    """
    first, second = (c if isinstance(c, Clip) else read_clip(c) for c in (a, b))
    hands, others = find_hands(first, conventions), find_hands(second, conventions)
    return compare_clips(first, second, hands, others, align)


def run(request: CompareRequest, journal: Journal) -> Outcome:
    """Compare two files; exit 5 if they differ by more than ``max_rms``."""
    if request.max_rms is not None and not request.max_rms >= 0:
        raise UsageError(f"--max-rms {request.max_rms:g}: give a number of degrees, 0 or more.")
    conventions = conventions_of(request)
    a, b = read_clip(request.a, request.skel), read_clip(request.b, request.skel_b or request.skel)
    for clip in (a, b):
        journal.about(clip.origin.path, clip.problems)
        journal.about(clip.origin.path, misleading_names(clip, conventions), "warning")
    found = compare(a, b, align=request.align, conventions=conventions)
    code, most = 0, request.max_rms
    if most is not None and not found.rms_deg <= most:
        message = (
            f"{request.b} differs from {request.a} by {found.rms_deg:.3f} deg RMS, more than "
            f"{most:g}."
        )
        error = QualityError(message)
        journal.fail(error, request.b)
        code = error.exit_code
    inputs = (request.a, request.b, *rig_files(request))
    return Outcome(request, inputs, lambda: compare_result(found), summary, exit_code=code)
