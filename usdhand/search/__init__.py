"""Time alignment: the type III c warp, and the exact search for the nearest segments under it.

Numbers only: nothing here knows what a feature means. numba is imported on first use.
"""

from usdhand.search.index import SearchIndex, prepare
from usdhand.search.nearest import Matches, merge, search
from usdhand.search.segments import PackedSegments, pack
from usdhand.search.warping import can_warp, warp, warp_many

__all__ = [
    "Matches",
    "PackedSegments",
    "SearchIndex",
    "can_warp",
    "merge",
    "pack",
    "prepare",
    "search",
    "warp",
    "warp_many",
]
