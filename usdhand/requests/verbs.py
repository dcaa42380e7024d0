"""The verbs, and where the request of each is: known without importing any of them."""

from __future__ import annotations

import difflib
import importlib
from typing import TYPE_CHECKING

from usdhand.errors import UsageError

if TYPE_CHECKING:
    from usdhand.requests.base import Request

# Verb -> (class of its request, one line of help), in the order of the work. The request is in
# the module of `usdhand.requests` that the verb's first word names; what it does is in the module
# of `usdhand.verbs` that has the verb's name.
VERBS = {
    "inspect": ("InspectRequest", "Show skeletons, timing, units, hands and problems of files."),
    "reduce": ("ReduceRequest", "Reduce hands to a rig of a few free channels."),
    "expand": (
        "ExpandRequest",
        "Turn a reduced rig back into motion, on its own or another character.",
    ),
    "library build": ("LibraryBuildRequest", "Read clips with body and fingers into a library."),
    "library info": ("LibraryInfoRequest", "Show what is in a library."),
    "fill": ("FillRequest", "Give a body clip the fingers of similar motions from a library."),
    "splice": ("SpliceRequest", "Put the fingers of a hand clip on a body clip, retimed to it."),
    "evaluate": ("EvaluateRequest", "Measure how well a library predicts fingers from arms."),
    "compare": ("CompareRequest", "Compare two motions: degrees, fingertips, smoothness, lag."),
    "convert": (
        "ConvertRequest",
        "Convert between USD, BVH, glTF and FBX; put fingers on other characters.",
    ),
    "preview": ("PreviewRequest", "Make a page that shows clips in a browser."),
    "check": ("CheckRequest", "Check files with UsdValidation and additional rules."),
    "schema": ("SchemaRequest", "Print the folder of the USD schema, or a JSON Schema."),
    "rerun": ("RerunRequest", "Make a result again from its report."),
}

# Verbs that are two words -> what the first one is about.
GROUPS = {"library": "Build a motion library, or show what is in it."}


def request_class(verb: str) -> type[Request]:
    """Return the class of a verb's requests.

    Raises
    ------
    UsageError
        if there is no such verb.
    """
    if verb not in VERBS:
        near = difflib.get_close_matches(verb, VERBS, 1)
        hint = f" Did you mean '{near[0]}'?" if near else f" There are {', '.join(VERBS)}."
        raise UsageError(f"There is no verb '{verb}'.{hint}")
    module = importlib.import_module(f"usdhand.requests.{verb.split()[0]}")
    found: type[Request] = getattr(module, VERBS[verb][0])
    return found
