"""Reading, writing and comparing clips, and finding their hands."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Protocol

from usdhand.anatomy import SIDES, Hands, Side
from usdhand.anatomy.neutral import Neutral, neutral_bind
from usdhand.errors import HandNotFoundError, UsageError
from usdhand.formats.files import read_any
from usdhand.formats.output import check_outputs
from usdhand.formats.paths import written_files
from usdhand.formats.sources import character_under
from usdhand.formats.suffixes import USD_SUFFIXES
from usdhand.formats.usd.convert import write_made
from usdhand.formats.usd.write import write_motion
from usdhand.motion import Clip
from usdhand.motion.skeleton import same_bind
from usdhand.problems import Problem
from usdhand.rigs import Conventions, load_conventions, map_character
from usdhand.verbs.files import check_several


class RigRequest(Protocol):
    """What a request says of rigs."""

    @property
    def maps(self) -> tuple[Path, ...]:
        """Map files."""

    @property
    def neutral(self) -> Path | None:
        """A clip or character whose hands are neutral."""


def conventions_of(request: RigRequest) -> Conventions:
    """The conventions that a request asks for, with the neutral pose that it names.

    Raises
    ------
    UsageError, InputError, HandNotFoundError
        if a file cannot be read, or has no hand that is neutral.
    """
    conventions = load_conventions(*request.maps)
    if request.neutral is None:
        return conventions
    return replace(conventions, neutral=neutral_pose(request.neutral, conventions))


def rig_files(request: RigRequest) -> tuple[Path, ...]:
    """Files that a request names to tell about rigs."""
    return (*request.maps, *([] if request.neutral is None else [request.neutral]))


def neutral_pose(path: str | Path, conventions: Conventions | None = None) -> Neutral:
    """The neutral pose of a clip or character: its bind pose, or a flat frame of its motion.

    Raises
    ------
    InputError
        if the file cannot be read.
    HandNotFoundError
        if there is no hand in it, or none of its poses is neutral.
    """
    clip, animated = read_any(Path(path))
    try:
        hands = map_character(clip.skeleton, conventions).hands
    except HandNotFoundError as error:
        raise HandNotFoundError(f"{path}: {error}") from error
    skeleton = clip.skeleton
    for side, hand in hands.items():
        bind = neutral_bind(skeleton, hand, [clip] if animated else [])
        if not bind.is_neutral:
            raise HandNotFoundError(
                f"{path}: the {side} hand is bound in a gesture and no frame of it is flat. Name "
                "a clip that starts with flat hands, or a character in its T-pose, with --neutral."
            )
        skeleton = bind.skeleton
    return Neutral.of_bind(skeleton, Path(path).name)


def find_hands(
    clip: Clip,
    conventions: Conventions | None = None,
    sides: Sequence[Side] = SIDES,
    others: Sequence[Clip] = (),
) -> Hands:
    """Find the hands of a clip's skeleton and build their anatomical frames.

    ``others`` are more clips: what geometry cannot decide is decided by all of them that have the
    joints of this one.

    Raises
    ------
    UsageError
        if a side is none.
    HandNotFoundError
        if there is no hand, or an ambiguous one, or none on the wanted side.
    """
    check_several("sides", sides)
    name = clip.origin.path or clip.name
    unknown = set(sides) - set(SIDES)
    if unknown or not sides:
        which = f"There is no side '{min(unknown)}'" if unknown else "No side is given"
        raise UsageError(f"{which}; sides are {' and '.join(SIDES)}.")
    try:
        character = map_character(clip.skeleton, conventions)
        wanted = [side for side in sides if side in character.hands]
        if not wanted:
            there = " and ".join(character.hands)
            raise HandNotFoundError(f"no {' or '.join(sides)} hand, only the {there} one")
        alike = [other for other in others if other.skeleton.joints == clip.skeleton.joints]
        neutral = conventions.neutral if conventions else None
        return Hands.of(clip, character, wanted, alike, neutral)
    except HandNotFoundError as error:
        raise HandNotFoundError(f"{name}: {error}") from error


def find_all_hands(
    clips: Sequence[Clip],
    conventions: Conventions | None = None,
    sides: Sequence[Side] = SIDES,
) -> list[Hands]:
    """Hands of clips in their order; those of one character are the same. See `find_hands`."""
    found: dict[int, Hands] = {}
    groups = characters(clips)
    for own in groups:
        if id(own) not in found:
            found[id(own)] = find_hands(own[0], conventions, sides, clips)
    return [found[id(own)] for own in groups]


def characters(clips: Sequence[Clip]) -> list[list[Clip]]:
    """For each clip, those of the same character, which share its anatomical frames.

    That is those with the same joints whose bind pose is that of the first of them.
    """
    with_joints: dict[tuple[str, ...], list[list[Clip]]] = {}
    found: list[list[Clip]] = []
    for clip in clips:
        groups = with_joints.setdefault(clip.skeleton.joints, [])
        own = next((g for g in groups if same_bind(clip.skeleton, g[0].skeleton)), None)
        if own is None:
            groups.append(own := [])
        own.append(clip)
        found.append(own)
    return found


def misleading_names(clip: Clip, conventions: Conventions | None = None) -> tuple[Problem, ...]:
    """Warnings where the bind pose contradicts joint names; none without hands."""
    try:
        found = map_character(clip.skeleton, conventions).problems
    except HandNotFoundError:
        return ()
    return tuple(replace(problem, file=str(clip.origin.path or "")) for problem in found)


def write_clip(
    clip: Clip,
    output: str | Path,
    *,
    flatten: bool = False,
    allow_outside: bool = False,
    force: bool = False,
    conventions: Conventions | None = None,
    inputs: Sequence[str | Path] = (),
) -> tuple[Problem, ...]:
    """Write a clip's hands as a layer over the file it was read from; the body stays as it is.

    A clip without a source, which was made in memory, is written as a file with a complete
    character. Returns what flattening could not keep, and other problems of the file.

    Raises
    ------
    InputError
        if the clip does not have the joints of what it was read from.
    OutputError
        if the output is refused or cannot be written.
    """
    output = Path(output)
    if clip.source is None:
        outputs = written_files(output, flatten=flatten)
        given = [p for p in (clip.origin.path, *inputs) if p]
        check_outputs(outputs, given, force, USD_SUFFIXES)
        return write_made(clip, output, flatten=flatten)
    changed = [j for f in find_hands(clip, conventions).frames.values() for j in f.links.moving]
    character = character_under(clip)
    return write_motion(
        character,
        clip,
        changed,
        output,
        flatten=flatten,
        allow_outside=allow_outside,
        force=force,
        inputs=inputs,
    )
