"""What fill found: values that reports are made of."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from usdhand.anatomy import Side
from usdhand.display import displayed
from usdhand.fill.candidates import Candidate, SearchSpace
from usdhand.fill.choose import Graph
from usdhand.fill.library import Part
from usdhand.fill.settings import FillSettings
from usdhand.motion import Clip
from usdhand.motion.rotations import Array


@displayed()
@dataclass(frozen=True, eq=False)
class Choice:
    """A segment of the body and what was chosen for it.

    Attributes
    ----------
    start, end : seconds from the first frame of the body
    candidates : the ones that could be chosen, best first; ``chosen`` is an index into them
    nearest : the one whose arm motion is most alike
    node_cost, transition_cost : of the choice, the latter from the segment before
    """

    start: float
    end: float
    candidates: tuple[Candidate, ...]
    nearest: Candidate
    chosen: int
    node_cost: float
    transition_cost: float


@displayed(
    lambda alternative: {
        "channels": len(alternative.names),
        "frames": len(alternative.curves),
        "segments": len(alternative.choices),
        "cost": alternative.cost,
    }
)
@dataclass(frozen=True, eq=False)
class Alternative:
    """One way of filling a part: finger channels at the body's frames."""

    names: tuple[str, ...]
    curves: Array
    choices: tuple[Choice, ...]
    cost: float
    seams: tuple[int, ...]


@displayed(
    lambda filled: {
        "part": filled.part,
        "usable": filled.usable,
        "alternatives": len(filled.alternatives),
    }
)
@dataclass(frozen=True, eq=False)
class FilledPart:
    """A part of the body and the ways in which it was filled, best first.

    ``joints`` are those that were filled, a hand each; ``usable`` segments could be chosen from;
    the alternatives are paths through ``network``.
    """

    part: Part
    joints: tuple[tuple[str, ...], ...]
    space: SearchSpace
    usable: int
    network: Graph
    alternatives: tuple[Alternative, ...]


@displayed(
    lambda filled: {
        "name": filled.clips[0].name,
        "frames": len(filled.clips[0]),
        "hands": tuple(side for part in filled.parts for side in part.part),
        "segments": sum(len(part.alternatives[0].choices) for part in filled.parts),
        "alternatives": len(filled.clips),
        "kept": filled.kept,
    }
)
@dataclass(frozen=True, eq=False)
class Filled:
    """A body clip with fingers.

    Attributes
    ----------
    clips : an alternative each, best first
    kept : hands whose own finger motion was kept, since it moves
    without : hands that the library has no motion for
    changed : joints of the skeleton that were filled
    missing : hand joints that no used clip has; they keep their values
    left_out : names of library clips that were not used, since they are the body's own
    set_aside : names of library clips that were not used, since they lack joints that were filled
    still : hands whose arm does not move at all; their fingers hold one pose
    """

    clips: tuple[Clip, ...]
    parts: tuple[FilledPart, ...]
    kept: tuple[Side, ...] = ()
    without: tuple[Side, ...] = ()
    changed: tuple[int, ...] = ()
    missing: Mapping[Side, tuple[str, ...]] = field(default_factory=dict)
    left_out: tuple[str, ...] = ()
    set_aside: Mapping[Side, tuple[str, ...]] = field(default_factory=dict)
    still: tuple[Side, ...] = ()
    settings: FillSettings = field(default_factory=FillSettings)
