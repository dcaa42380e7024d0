"""Fill: fingers for a body clip from a library (Joerg, Hodgins & Safonova 2012)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence, Set
from dataclasses import replace
from itertools import pairwise

import numpy as np

from usdhand.anatomy import SIDES, Channels, Hands, Side
from usdhand.anatomy.channels import all_channels, fingers_move
from usdhand.errors import InputError, UsageError
from usdhand.fill.arm import ArmMotion, arm_motion, is_still
from usdhand.fill.assemble import FingerPiece, join, smooth_seams, within_limits
from usdhand.fill.candidates import (
    Candidate,
    FingerSource,
    SearchSpace,
    find_candidates,
    finger_curves,
    finger_sources,
    part_rows,
    part_segments,
    search_space,
)
from usdhand.fill.choose import Graph, choose, graph
from usdhand.fill.duplicates import same_motion
from usdhand.fill.library import ARM_FPS, MotionLibrary, Part, at_arm_rate
from usdhand.fill.limits import channel_limits
from usdhand.fill.metric import metric_of
from usdhand.fill.path import SegmentPath
from usdhand.fill.results import Alternative, Choice, Filled, FilledPart
from usdhand.fill.settings import FillSettings, Segmentation
from usdhand.motion import Clip
from usdhand.motion.rotations import Array
from usdhand.progress import Progress, Steps

# A segment of the body has at least so many frames: speeds and seams need some.
FEWEST_FRAMES = 3
# Segments that are searched for together: enough to keep all threads busy.
AT_ONCE = 200


def fill(
    body: Clip,
    hands: Hands,
    library: MotionLibrary,
    settings: FillSettings | None = None,
    *,
    sides: Sequence[Side] = SIDES,
    replace_motion: bool = False,
    content_hash: str | None = None,
    spaces: Mapping[Part, SearchSpace] | None = None,
    progress: Progress | None = None,
) -> Filled:
    """Give a body clip the fingers of similar motions.

    Parameters
    ----------
    sides : hands to fill
    replace_motion : also replace finger motion that is there and moves
    content_hash : of the body's file: the library's clip with the same content, or with the same
        name, is the very motion that is filled, and left out
    spaces : search spaces made before, to fill many bodies from one library
    progress : gets how many segments are done, those of each hand, and how many there are; False
        stops

    Raises
    ------
    UsageError
        if all hands already move and may not be replaced.
    InputError
        if the library has no motion for any of the hands, or the body is a single frame.
    CancelledError
        if ``progress`` returned False.
    """
    settings = settings or FillSettings()
    if len(body) < 2:
        raise InputError(f"{body.name} is a single frame; there is no motion to find fingers for.")
    channels = hands.encode(body)
    arms = {s: at_arm_rate(arm_motion(body, hands, s), body.fps) for s in hands.frames}
    own = frozenset(same_motion(library, arms, content_hash))
    moving = tuple(s for s in moving_sides(channels, hands) if s in sides)
    kept = () if replace_motion else moving
    open_sides: Part = tuple(s for s in sides if s in hands.frames and s not in kept)
    if not open_sides:
        raise UsageError(
            f"The fingers of {body.name} already move ({' and '.join(kept) or 'no hand'}); "
            "--replace replaces them."
        )
    joints = {s: _shared_joints(library, hands, s, own) for s in open_sides}
    wanted: Part = tuple(s for s in open_sides if joints[s])
    if not wanted:
        raise InputError(_why_none(library, body, hands, open_sides, own))
    together = settings.couple and len(wanted) == 2
    parts: list[Part] = [wanted] if together else [(s,) for s in wanted]
    if together and not _usable_clips(library, joints, wanted, own):
        raise InputError(
            "No clip of the library has both hands; fill each hand on its own (without --couple)."
        )
    cut = [_cut([arms[side] for side in part], settings, library, body.fps) for part in parts]
    steps = Steps(sum(map(len, cut)), progress)
    filled = tuple(
        _fill_part(
            body.fps,
            len(body),
            [arms[side] for side in part],
            [joints[side] for side in part],
            borders,
            library,
            (spaces or {}).get(part) or space_for(library, part, settings),
            settings,
            _usable_clips(library, joints, part, own),
            steps,
        )
        for part, borders in zip(parts, cut, strict=True)
    )
    column = {name: i for i, name in enumerate(channels.names)}
    changed = [
        int(joint)
        for side in wanted
        for name, joint in zip(hands.frames[side].names, hands.frames[side].joints, strict=True)
        if name in joints[side]
    ]
    followers = {j for side in wanted for j in hands.frames[side].links.followers}
    changed += sorted(followers - {*changed})
    clips = []
    for number in range(max(len(done.alternatives) for done in filled)):
        values = channels.values.copy()
        for done in filled:
            alternative = done.alternatives[min(number, len(done.alternatives) - 1)]
            values[:, [column[n] for n in alternative.names]] = alternative.curves
        rotations = body.rotations.copy()  # all other joints to the bit
        made = hands.decode(Channels(channels.names, values), body)
        rotations[:, changed] = made.rotations[:, changed]
        clips.append(made.with_rotations(rotations))
    missing = {s: tuple(j for j in hands.frames[s].names if j not in joints[s]) for s in wanted}
    return Filled(
        tuple(clips),
        filled,
        kept,
        tuple(s for s in open_sides if s not in wanted),
        tuple(sorted(changed)),
        {side: names for side, names in missing.items() if names},
        tuple(library.clips[i].name for i in sorted(own)),
        {s: names for s in wanted if (names := _set_aside(library, joints[s], s, own))},
        tuple(s for part in parts if all(is_still(arms[s]) for s in part) for s in part),
        settings,
    )


def space_for(library: MotionLibrary, part: Part, settings: FillSettings) -> SearchSpace:
    """Make the search space that these settings need."""
    return search_space(library, part, metric_of(settings.metric), settings.segmentation)


def moving_sides(channels: Channels, hands: Hands) -> tuple[Side, ...]:
    """Hands whose fingers move."""
    own = {s: channels.select(all_channels(s, f.names)) for s, f in hands.frames.items()}
    return tuple(side for side in SIDES if side in own and fingers_move(own[side].values))


def _hold_typical_pose(curves: Array) -> Array:
    """Curves (frames, channels) that hold one pose, that of the frame nearest to the mean."""
    away = np.square(curves - curves.mean(axis=0)).sum(axis=1)
    return np.repeat(curves[[int(np.argmin(away))]], len(curves), axis=0)


def _shared_joints(
    library: MotionLibrary, hands: Hands, side: Side, own: Set[int]
) -> tuple[str, ...]:
    """The body's hand joints to fill: many, of many segments that are not its own.

    A clip can be used if it has all of them, so more joints mean fewer segments. A joint more is
    worth the more, the fewer segments it costs, and of many segments one can spare some: the number
    of joints times the logarithm of the number of segments is largest.
    """
    names = hands.frames[side].names
    rigs: dict[frozenset[str], int] = {}
    for i, clip in enumerate(library.clips):
        if i not in own and side in clip.hands:
            rig = frozenset(names) & frozenset(clip.hands[side].joints)
            rigs[rig] = rigs.get(rig, 0) + len(clip.hands[side].segments)

    def worth(joints: frozenset[str]) -> tuple[float, int]:
        count = sum(n for rig, n in rigs.items() if joints <= rig)
        return len(joints) * float(np.log1p(count)), len(joints)

    choices = {a & b for a in rigs for b in rigs} | {frozenset(names).intersection(*rigs)}
    ranked = sorted((joints for joints in choices if worth(joints)[0] > 0), key=sorted)
    best = max(ranked, key=worth, default=frozenset())
    return tuple(joint for joint in names if joint in best)


def _set_aside(
    library: MotionLibrary, joints: tuple[str, ...], side: Side, own: Set[int]
) -> tuple[str, ...]:
    """Names of clips of a hand that are not used since they lack some of its joints."""
    return tuple(
        clip.name
        for i, clip in enumerate(library.clips)
        if i not in own and side in clip.hands and not set(joints) <= {*clip.hands[side].joints}
    )


def _usable_clips(
    library: MotionLibrary,
    joints: Mapping[Side, tuple[str, ...]],
    part: Part,
    own: Set[int],
) -> frozenset[int]:
    """Library clips with segments and these hand joints that are not the body's own."""
    return frozenset(
        i
        for i, clip in enumerate(library.clips)
        if i not in own
        and all(
            side in clip.hands
            and clip.hands[side].segments
            and set(joints[side]) <= set(clip.hands[side].joints)
            for side in part
        )
    )


def _why_none(library: MotionLibrary, body: Clip, hands: Hands, sides: Part, own: Set[int]) -> str:
    if not library.clips:
        return "The library is empty; build it from clips with body and fingers."
    if any(_shared_joints(library, hands, side, frozenset()) for side in sides):
        names = ", ".join(library.clips[i].name for i in sorted(own))
        return f"The library contains only the body's own motion ({names}); add other motion."
    joints = "; ".join(f"{side}: {', '.join(hands.frames[side].names)}" for side in sides)
    return f"No clip of the library has any hand joint of {body.name} ({joints})."


def _fill_part(
    fps: float,
    frames: int,
    arms: Sequence[ArmMotion],
    joints: Sequence[tuple[str, ...]],
    cut: Sequence[tuple[int, int]],
    library: MotionLibrary,
    space: SearchSpace,
    settings: FillSettings,
    usable: frozenset[int],
    steps: Steps,
) -> FilledPart:
    part = space.part
    names = tuple(
        n for side, own in zip(part, joints, strict=True) for n in all_channels(side, own)
    )
    rows = part_rows(arms, space.metric)
    sources: dict[int, FingerSource] = {}
    others = [i for i in range(len(library.clips)) if i not in usable]
    borders = _body_frames(cut, fps, frames)
    found: list[list[Candidate]] = []
    curves: list[Array] = []
    for start in range(0, len(cut), AT_ONCE):
        some = slice(start, start + AT_ONCE)
        queries = [rows[a : b + 1] for a, b in cut[some]]
        count = max(settings.k, settings.pool)
        found += find_candidates(queries, space, count, settings.factor, others)
        used = {int(space.clips[c.segment]) for candidates in found[some] for c in candidates}
        sources |= finger_sources(library, part, joints, used - sources.keys())
        curves += [
            finger_curves(candidates, space, sources, np.arange(b - a + 1) / fps)
            for (a, b), candidates in zip(borders[some], found[some], strict=True)
        ]
        steps.add(len(queries))
    network = graph(found, curves, names, fps, settings)
    low, high = channel_limits(library, part, joints)
    alternatives = []
    for path in choose(network, settings):
        pieces = [
            FingerPiece(a, b, own[layer.order[node]])
            for (a, b), own, layer, node in zip(
                borders, curves, network.layers, path.nodes, strict=True
            )
        ]
        joined = join(pieces, settings.blend)
        seams = tuple(piece.first for piece in pieces[1:])
        if settings.blend == "smooth":
            joined = smooth_seams(joined, seams, fps)
        choices = _choices(path, network, found, cut)
        fingers = within_limits(joined, low, high, fps)
        if all(map(is_still, arms)):
            fingers = _hold_typical_pose(fingers)
        alternatives.append(Alternative(names, fingers, choices, path.cost, seams))
    candidates = int(np.isin(space.clips, list(usable)).sum())
    return FilledPart(part, tuple(joints), space, candidates, network, tuple(alternatives))


def _choices(
    path: SegmentPath,
    network: Graph,
    found: Sequence[Sequence[Candidate]],
    cut: Sequence[tuple[int, int]],
) -> tuple[Choice, ...]:
    choices = []
    for i, node in enumerate(path.nodes):
        layer = network.layers[i]
        choices.append(
            Choice(
                cut[i][0] / ARM_FPS,
                cut[i][1] / ARM_FPS,
                tuple(found[i][j] for j in layer.order),
                found[i][0],
                node,
                float(layer.costs[node]),
                float(network.edges[i - 1][path.nodes[i - 1], node]) if i else 0.0,
            )
        )
    return tuple(choices)


def _cut(
    arms: Sequence[ArmMotion], settings: FillSettings, library: MotionLibrary, fps: float
) -> list[tuple[int, int]]:
    """Segments of the body, first and last frame at `ARM_FPS`."""
    return part_segments(arms, _for_rate(settings.segmentation or library.segmentation, fps))


def _for_rate(segmentation: Segmentation, fps: float) -> Segmentation:
    """Segments that are long enough for a body with few frames a second."""
    shortest = max(segmentation.shortest, FEWEST_FRAMES / fps)
    return replace(segmentation, shortest=shortest, longest=max(segmentation.longest, 2 * shortest))


def _body_frames(cut: Sequence[tuple[int, int]], fps: float, frames: int) -> list[tuple[int, int]]:
    """Body frames of segments that were cut at `ARM_FPS`; the last one takes what is left."""
    borders = [round(a / ARM_FPS * fps) for a, _ in cut] + [frames - 1]
    return list(pairwise(borders))
