"""What is in a library."""

from __future__ import annotations

from usdhand.formats.usd.library import read_library
from usdhand.report.library import library_result, summary
from usdhand.requests.library import LibraryInfoRequest
from usdhand.verbs.library import gone_clips
from usdhand.verbs.outcome import Journal, Outcome


def run(request: LibraryInfoRequest, journal: Journal) -> Outcome:
    """Read a library and look for the files of its clips."""
    del journal
    library = read_library(request.library)
    gone = gone_clips(library, request.library.absolute().parent)
    return Outcome(request, (request.library,), lambda: library_result(library, gone), summary)
