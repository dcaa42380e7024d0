"""Hands for digital characters: reduce, fill, splice and convert finger motion over OpenUSD.

The functions are the verbs of the command line, on values. ``import usdhand`` alone imports neither
numpy nor USD: each name is loaded when it is first used.

Examples
--------
>>> import usdhand
>>> clip = usdhand.read_clip("samples/gestures/ok_01.usdc")  # doctest: +SKIP
>>> [reduction] = usdhand.reduce_hands([clip])               # doctest: +SKIP
>>> usdhand.write_rig(reduction, "ok_rig.usdc")              # doctest: +SKIP
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING

from usdhand.version import __version__ as __version__

# Every public name stands twice: here for type checkers and editors, below for the interpreter.
# `tests/api/test_face.py` holds both together.
if TYPE_CHECKING:
    from usdhand.anatomy.channels import Channels as Channels
    from usdhand.anatomy.channels import Hands as Hands
    from usdhand.anatomy.frames import HandFrames as HandFrames
    from usdhand.anatomy.hand import CharacterMap as CharacterMap
    from usdhand.anatomy.hand import HandMap as HandMap
    from usdhand.anatomy.hand import Side as Side
    from usdhand.errors import CancelledError as CancelledError
    from usdhand.errors import CrashedError as CrashedError
    from usdhand.errors import HandNotFoundError as HandNotFoundError
    from usdhand.errors import InputError as InputError
    from usdhand.errors import InterruptedBuildError as InterruptedBuildError
    from usdhand.errors import OutputError as OutputError
    from usdhand.errors import QualityError as QualityError
    from usdhand.errors import TerminatedBuildError as TerminatedBuildError
    from usdhand.errors import UnforeseenError as UnforeseenError
    from usdhand.errors import UsageError as UsageError
    from usdhand.errors import UsdHandError as UsdHandError
    from usdhand.evaluate.agreement import Agreement as Agreement
    from usdhand.evaluate.agreement import label_agreement as label_agreement
    from usdhand.evaluate.compare import Comparison as Comparison
    from usdhand.evaluate.reconstruction import HandError as HandError
    from usdhand.fill.library import LibraryClip as LibraryClip
    from usdhand.fill.library import LibraryHand as LibraryHand
    from usdhand.fill.library import MotionLibrary as MotionLibrary
    from usdhand.fill.results import Filled as Filled
    from usdhand.fill.settings import FillSettings as FillSettings
    from usdhand.fill.settings import Metric as Metric
    from usdhand.fill.settings import Segmentation as Segmentation
    from usdhand.formats.files import animation_names as animation_names
    from usdhand.formats.files import read_character as read_character
    from usdhand.formats.files import read_clip as read_clip
    from usdhand.formats.reading import Reading as Reading
    from usdhand.formats.usd.check import check_file as check_file
    from usdhand.formats.usd.library import read_library as read_library
    from usdhand.formats.usd.library import write_library as write_library
    from usdhand.motion.clip import Clip as Clip
    from usdhand.motion.clip import Origin as Origin
    from usdhand.motion.skeleton import Skeleton as Skeleton
    from usdhand.problems import Problem as Problem
    from usdhand.progress import Progress as Progress
    from usdhand.reduce.method import Reduction as Reduction
    from usdhand.reduce.method import apply_rig as apply_rig
    from usdhand.reduce.rig import ReducedRig as ReducedRig
    from usdhand.reduce.rig import Relation as Relation
    from usdhand.reduce.settings import ReduceSettings as ReduceSettings
    from usdhand.reduce.variation import Variation as Variation
    from usdhand.requests.base import Request as Request
    from usdhand.requests.check import CheckRequest as CheckRequest
    from usdhand.requests.codec import make_request as make_request
    from usdhand.requests.compare import CompareRequest as CompareRequest
    from usdhand.requests.convert import ConvertRequest as ConvertRequest
    from usdhand.requests.convert import Edits as Edits
    from usdhand.requests.evaluate import EvaluateRequest as EvaluateRequest
    from usdhand.requests.expand import ExpandRequest as ExpandRequest
    from usdhand.requests.fill import FillRequest as FillRequest
    from usdhand.requests.inspect import InspectRequest as InspectRequest
    from usdhand.requests.library import LibraryBuildRequest as LibraryBuildRequest
    from usdhand.requests.library import LibraryInfoRequest as LibraryInfoRequest
    from usdhand.requests.preview import PreviewRequest as PreviewRequest
    from usdhand.requests.preview import PreviewSettings as PreviewSettings
    from usdhand.requests.reduce import ReduceRequest as ReduceRequest
    from usdhand.requests.rerun import RerunRequest as RerunRequest
    from usdhand.requests.schema import SchemaRequest as SchemaRequest
    from usdhand.requests.splice import SpliceRequest as SpliceRequest
    from usdhand.rigs.conventions import Convention as Convention
    from usdhand.rigs.conventions import Conventions as Conventions
    from usdhand.rigs.conventions import load_conventions as load_conventions
    from usdhand.rigs.graft import Grafted as Grafted
    from usdhand.rigs.graft import add_finger_joints as add_finger_joints
    from usdhand.splice.alignment import Alignment as Alignment
    from usdhand.splice.method import Spliced as Spliced
    from usdhand.splice.settings import Pin as Pin
    from usdhand.splice.settings import SpliceSettings as SpliceSettings
    from usdhand.verbs.clips import find_hands as find_hands
    from usdhand.verbs.clips import write_clip as write_clip
    from usdhand.verbs.compare import compare as compare
    from usdhand.verbs.convert import Converted as Converted
    from usdhand.verbs.convert import convert as convert
    from usdhand.verbs.convert import retarget_hands as retarget_hands
    from usdhand.verbs.convert import write_new as write_new
    from usdhand.verbs.evaluate import measure_library as measure_library
    from usdhand.verbs.expand import expand as expand
    from usdhand.verbs.expand import expand_motion as expand_motion
    from usdhand.verbs.expand import expand_onto as expand_onto
    from usdhand.verbs.fill import fill_fingers as fill_fingers
    from usdhand.verbs.fill import write_filled as write_filled
    from usdhand.verbs.library import BuildResult as BuildResult
    from usdhand.verbs.library import build_library as build_library
    from usdhand.verbs.outcome import Outcome as Outcome
    from usdhand.verbs.outcome import Watch as Watch
    from usdhand.verbs.preview import Previewed as Previewed
    from usdhand.verbs.preview import preview_clips as preview_clips
    from usdhand.verbs.preview import write_preview as write_preview
    from usdhand.verbs.reduce import fit_rig as fit_rig
    from usdhand.verbs.reduce import read_rig as read_rig
    from usdhand.verbs.reduce import reduce_hands as reduce_hands
    from usdhand.verbs.reduce import write_rig as write_rig
    from usdhand.verbs.run import run as run
    from usdhand.verbs.splice import parse_pin as parse_pin
    from usdhand.verbs.splice import splice_hands as splice_hands
    from usdhand.verbs.splice import write_spliced as write_spliced

_HOME = {  # module -> its public names
    "usdhand.anatomy.channels": "Channels Hands",
    "usdhand.anatomy.frames": "HandFrames",
    "usdhand.anatomy.hand": "CharacterMap HandMap Side",
    "usdhand.errors": (
        "CancelledError CrashedError HandNotFoundError InputError InterruptedBuildError "
        "OutputError QualityError TerminatedBuildError UnforeseenError UsageError UsdHandError"
    ),
    "usdhand.evaluate.agreement": "Agreement label_agreement",
    "usdhand.evaluate.compare": "Comparison",
    "usdhand.evaluate.reconstruction": "HandError",
    "usdhand.fill.library": "LibraryClip LibraryHand MotionLibrary",
    "usdhand.fill.results": "Filled",
    "usdhand.fill.settings": "FillSettings Metric Segmentation",
    "usdhand.formats.files": "animation_names read_character read_clip",
    "usdhand.formats.reading": "Reading",
    "usdhand.formats.usd.check": "check_file",
    "usdhand.formats.usd.library": "read_library write_library",
    "usdhand.motion.clip": "Clip Origin",
    "usdhand.motion.skeleton": "Skeleton",
    "usdhand.problems": "Problem",
    "usdhand.progress": "Progress",
    "usdhand.reduce.method": "Reduction apply_rig",
    "usdhand.reduce.rig": "ReducedRig Relation",
    "usdhand.reduce.settings": "ReduceSettings",
    "usdhand.reduce.variation": "Variation",
    "usdhand.requests.base": "Request",
    "usdhand.requests.check": "CheckRequest",
    "usdhand.requests.codec": "make_request",
    "usdhand.requests.compare": "CompareRequest",
    "usdhand.requests.convert": "ConvertRequest Edits",
    "usdhand.requests.evaluate": "EvaluateRequest",
    "usdhand.requests.expand": "ExpandRequest",
    "usdhand.requests.fill": "FillRequest",
    "usdhand.requests.inspect": "InspectRequest",
    "usdhand.requests.library": "LibraryBuildRequest LibraryInfoRequest",
    "usdhand.requests.preview": "PreviewRequest PreviewSettings",
    "usdhand.requests.reduce": "ReduceRequest",
    "usdhand.requests.rerun": "RerunRequest",
    "usdhand.requests.schema": "SchemaRequest",
    "usdhand.requests.splice": "SpliceRequest",
    "usdhand.rigs.conventions": "Convention Conventions load_conventions",
    "usdhand.rigs.graft": "Grafted add_finger_joints",
    "usdhand.splice.alignment": "Alignment",
    "usdhand.splice.method": "Spliced",
    "usdhand.splice.settings": "Pin SpliceSettings",
    "usdhand.verbs.clips": "find_hands write_clip",
    "usdhand.verbs.compare": "compare",
    "usdhand.verbs.convert": "Converted convert retarget_hands write_new",
    "usdhand.verbs.evaluate": "measure_library",
    "usdhand.verbs.expand": "expand expand_motion expand_onto",
    "usdhand.verbs.fill": "fill_fingers write_filled",
    "usdhand.verbs.library": "BuildResult build_library",
    "usdhand.verbs.outcome": "Outcome Watch",
    "usdhand.verbs.preview": "Previewed preview_clips write_preview",
    "usdhand.verbs.reduce": "fit_rig read_rig reduce_hands write_rig",
    "usdhand.verbs.run": "run",
    "usdhand.verbs.splice": "parse_pin splice_hands write_spliced",
}
_MODULES = {name: module for module, names in _HOME.items() for name in names.split()}

__all__ = ["__version__", *sorted(_MODULES)]

if not TYPE_CHECKING:  # a type checker would take every misspelt name for one of these

    def __getattr__(name: str) -> object:
        if name not in _MODULES:
            raise AttributeError(f"module 'usdhand' has no attribute '{name}'")
        value = globals()[name] = getattr(importlib.import_module(_MODULES[name]), name)
        return value


def __dir__() -> list[str]:
    return __all__
