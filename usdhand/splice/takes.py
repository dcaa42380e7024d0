"""Several hand takes for one body: the best one in every phase, joined without jumps."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from usdhand.anatomy import SIDES, Channels, Hands, Side
from usdhand.anatomy.channels import encode
from usdhand.errors import HandNotFoundError, UsdHandError
from usdhand.motion import Clip
from usdhand.motion import rotations as rot
from usdhand.motion.rotations import Array
from usdhand.problems import Problem, listed
from usdhand.progress import Progress
from usdhand.splice.alignment import Alignment, Piece, aligned_hands
from usdhand.splice.finger_notes import HELD_S, frozen_notes, still_finger_notes
from usdhand.splice.merge import fingers_along, with_fingers, with_wrist, wrist_along
from usdhand.splice.method import Spliced, common_sides, exact_frames
from usdhand.splice.pin_notes import contradiction_notes
from usdhand.splice.settings import SpliceSettings

# What a second of a take costs: that it does not show; of no agreement; with a timing that is
# uncertain by this many seconds; with nothing known. What a change of takes costs.
NOT_SHOWN, DISAGREES, UNCERTAIN_S, UNKNOWN, CHANGE = 10.0, 1.0, 0.1, 0.5, 0.2
# Takes are joined where their fingers are most alike within this many seconds of a phase's border,
# and mixed over as many.
NEAR_S, MIXED_S = 0.2, 0.3


@dataclass(frozen=True, eq=False)
class Take:
    """One hand clip of several, with its own pins or claps in the settings."""

    clip: Clip
    hands: Hands
    settings: SpliceSettings


def splice_takes(
    body: Clip,
    takes: Sequence[Take],
    body_hands: Hands,
    settings: SpliceSettings,
    progress: Progress | None = None,
) -> Spliced:
    """Give a body clip the fingers of several hand clips, each where it fits best.

    Parameters
    ----------
    settings : for the result; what concerns timing is that of the takes

    Raises
    ------
    UsdHandError
        as `usdhand.splice.method.splice`, with the name of the take.
    """
    aligned: list[dict[Side, Alignment]] = []
    problems: list[Problem] = []
    for number, take in enumerate(takes):
        done = None if progress is None else _part_of(progress, number, len(takes))
        try:
            sides = common_sides(body_hands, take.hands)
            found, odd = aligned_hands(
                body, take.clip, body_hands, take.hands, sides, take.settings, done
            )
            odd += still_finger_notes(body, take.clip, body_hands, take.hands, sides)
        except UsdHandError as error:
            raise type(error)(f"Take {take.clip.name}: {error}") from error
        odd += contradiction_notes(body, {s: a.contradictions for s, a in found.items()})
        odd += frozen_notes(body, take.clip, {s: a.frozen for s, a in found.items()})
        name = str(take.clip.origin.path or take.clip.name)
        problems += [replace(p, file=p.file or name) for p in odd]
        aligned.append(found)
    clip, hands = body, {}
    for side in SIDES:
        own = {k: a[side] for k, a in enumerate(aligned) if side in a}
        if own:
            clip, hands[side] = _joined(clip, body, takes, body_hands, settings, side, own)
            problems += _unshown_notes(body, takes, side, hands[side])
    if not hands:
        raise HandNotFoundError("No take has a hand of the body.")
    return Spliced(clip, hands, tuple(problems), settings)


def _part_of(progress: Progress, number: int, count: int) -> Progress:
    return lambda done, total: progress(number * total + done, count * total)


def _joined(
    clip: Clip,
    body: Clip,
    takes: Sequence[Take],
    body_hands: Hands,
    settings: SpliceSettings,
    side: Side,
    own: Mapping[int, Alignment],
) -> tuple[Clip, Alignment]:
    """The clip with one hand of all its takes, and the alignment of what is shown."""
    frames = body_hands.frames[side]
    wanted = encode(body, frames).names
    curves = {
        k: fingers_along(
            takes[k].clip,
            takes[k].hands.frames[side],
            wanted,
            a.warp[:, 1],
            exact_frames(a),
            a.frozen[1],
        )
        for k, a in own.items()
    }
    names = tuple(n for n in wanted if all(n in c.names for c in curves.values()))
    if not names:
        raise HandNotFoundError(f"The {side} hands of the takes have no finger joint in common.")
    values = {k: c.select(names).values for k, c in curves.items()}
    shown = _shown_takes(own, takes, values, body.fps)
    shares = {k: _mixed(shown == k, body.fps) for k in own}
    mixed = np.sum([shares[k][:, None] * values[k] for k in own], axis=0)
    clip = with_fingers(clip, frames, Channels(names, mixed))
    if settings.wrist == "hands":
        bends = [
            wrist_along(takes[k].clip, takes[k].hands, side, a.warp[:, 1], exact_frames(a))
            for k, a in own.items()
        ]
        clip = with_wrist(clip, body_hands, side, _mixed_turns(bends, [shares[k] for k in own]))
    return clip, replace(_shown_alignment(own, shown), channels=names)


def covered(warp: Array, end: float) -> NDArray[np.bool_]:
    """(frames,) whether a warp shows a moment of a take, not its first or last pose held."""
    inside = (warp > 1e-6) & (warp < end - 1e-6)
    beside = np.concatenate([inside[1:], [False]]) | np.concatenate([[False], inside[:-1]])
    return np.asarray(inside | beside)


def _shown_takes(
    own: Mapping[int, Alignment], takes: Sequence[Take], values: Mapping[int, Array], fps: float
) -> NDArray[np.intp]:
    """(frames,) which take is shown: the cheapest sequence over phases, changed where alike."""
    keys = list(own)
    count = len(own[keys[0]].warp)
    shows = np.stack([covered(own[k].warp[:, 1], takes[k].clip.duration) for k in keys])
    borders = _borders(own, shows, fps)
    costs = np.stack([_frame_costs(own[k], s) for k, s in zip(keys, shows, strict=True)]) / fps
    of_phase = np.stack([costs[:, a:b].sum(axis=1) for a, b in pairwise(borders)])
    chosen = _cheapest(of_phase)
    shown = np.zeros(count, np.intp)
    for k, (a, b) in zip(chosen, pairwise(borders), strict=True):
        shown[a:b] = k
    for at, one, other in zip(borders[1:-1], chosen, chosen[1:], strict=False):
        if one != other:
            near = np.arange(max(at - round(NEAR_S * fps), 0), min(at + round(NEAR_S * fps), count))
            near = near[(shown[near] == one) | (shown[near] == other)]
            near = near[shows[one, near] & shows[other, near]]
            if len(near):
                apart = values[keys[one]][near] - values[keys[other]][near]
                best = int(near[np.argmin(np.sum(apart**2, axis=1))])
                shown[min(best, at) : max(best, at)] = other if best < at else one
    return np.asarray(keys, np.intp)[shown]


def _borders(own: Mapping[int, Alignment], shows: NDArray[np.bool_], fps: float) -> list[int]:
    """Frames at which a phase of the body, or what a take shows, begins, and the last of all."""
    count = shows.shape[1]
    phases = next((a.phases for a in own.values() if a.phases), ())
    found = {0, count, *(round(p.start * fps) for p in phases)}
    found.update(int(k) + 1 for k in np.flatnonzero((shows[:, 1:] != shows[:, :-1]).any(axis=0)))
    return sorted(k for k in found if 0 <= k <= count)


def _frame_costs(alignment: Alignment, shows: NDArray[np.bool_]) -> Array:
    """(frames,) what every frame of a take costs a second."""
    times = alignment.warp[:, 0]
    costs = np.full(len(times), UNKNOWN)
    for phase in alignment.phases:
        if phase.quality is not None:
            costs[(times >= phase.start) & (times <= phase.end)] = DISAGREES * (1.0 - phase.quality)
    if alignment.deviation is not None:
        costs += np.minimum(alignment.deviation / UNCERTAIN_S, 1.0)
    return np.where(shows, costs, costs + NOT_SHOWN)


def _cheapest(costs: Array) -> list[int]:
    """Which of several (phases, takes) in every phase, if a change costs something."""
    total, came = costs[0].copy(), []
    for row in costs[1:]:
        ways = total[None] + CHANGE * (1.0 - np.eye(len(row)))
        came.append(np.argmin(ways, axis=1))
        total = ways.min(axis=1) + row
    chosen = [int(np.argmin(total))]
    for back in reversed(came):
        chosen.append(int(back[chosen[-1]]))
    return chosen[::-1]


def _mixed(shown: NDArray[np.bool_], fps: float) -> Array:
    """Shares (frames,) of a take, which all have the sum 1 and change smoothly."""
    from scipy.ndimage import convolve1d

    width = 2 * round(MIXED_S * fps / 2) + 1
    kernel = np.hanning(width + 2)[1:-1]
    return np.asarray(convolve1d(shown.astype(float), kernel / kernel.sum(), mode="nearest"))


def _mixed_turns(turns: Sequence[Array], shares: Sequence[Array]) -> Array:
    """Weighted means of rotations (frames, 4) that are near each other, or one of them."""
    signed = [np.where(np.sum(q * turns[0], axis=1, keepdims=True) < 0, -q, q) for q in turns]
    mixed = np.sum([w[:, None] * q for w, q in zip(shares, signed, strict=True)], axis=0)
    return rot.make_continuous(rot.normalize(mixed))


def _shown_alignment(own: Mapping[int, Alignment], shown: NDArray[np.intp]) -> Alignment:
    """The alignment of what is shown, of the parts of the takes' own."""
    first = own[min(own)]
    times = first.warp[:, 0]
    starts = [0, *(np.flatnonzero(np.diff(shown)) + 1).tolist(), len(shown)]
    pieces = tuple(
        Piece(int(shown[a]), float(times[a]), float(times[b - 1])) for a, b in pairwise(starts)
    )
    deviations = {
        k: a.deviation if a.deviation is not None else np.full(len(times), np.nan)
        for k, a in own.items()
    }
    deviation = _chosen(deviations, shown)

    def take_at(seconds: float) -> int:
        return int(shown[min(int(np.searchsorted(times, seconds)), len(shown) - 1)])

    return Alignment(
        np.stack([times, _chosen({k: a.warp[:, 1] for k, a in own.items()}, shown)], axis=1),
        _chosen({k: a.phase_warp for k, a in own.items()}, shown),
        tuple(p for k, a in own.items() for p in a.pins if take_at(p.body) == k),
        float(np.mean([own[k].cost for k in shown.tolist()])),
        tuple(
            sorted(
                (
                    p
                    for k, a in own.items()
                    for p in a.phases
                    if take_at((p.start + p.end) / 2) == k
                ),
                key=lambda p: p.start,
            )
        ),
        (first.origins[0], listed(sorted({a.origins[1] for a in own.values()}))),
        deviation=None if np.isnan(deviation).any() else deviation,
        pieces=pieces,
    )


def _chosen(curves: Mapping[int, Array], shown: NDArray[np.intp]) -> Array:
    """(frames,) of every frame the value that its take has."""
    keys = sorted(curves)
    rows = np.searchsorted(keys, shown)
    return np.asarray(np.stack([curves[k] for k in keys])[rows, np.arange(len(shown))])


def _unshown_notes(
    body: Clip, takes: Sequence[Take], side: Side, alignment: Alignment
) -> list[Problem]:
    """Notes on what no take shows."""
    notes = []
    for piece in alignment.pieces:
        at = (alignment.warp[:, 0] >= piece.start) & (alignment.warp[:, 0] <= piece.end)
        frames = np.flatnonzero(at)
        held = ~covered(alignment.warp[frames, 1], takes[piece.take].clip.duration)
        steps = np.flatnonzero(np.diff(np.concatenate([[0], held.astype(np.int8), [0]])))
        for first, last in steps.reshape(-1, 2):
            if last - first > HELD_S * body.fps:
                codes = [body.time_code(int(frames[k])) for k in (first, last - 1)]
                notes.append(
                    Problem(
                        "held-pose",
                        f"no take shows time codes {codes[0]:g} to {codes[1]:g} of the body; the "
                        f"fingers of the {side} hand hold a pose of {takes[piece.take].clip.name}",
                    )
                )
    return notes
