"""What a body of motion shows to a fit, gathered take by take in memory that does not grow."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from usdhand.anatomy.channels import Channels, Hands
from usdhand.display import displayed
from usdhand.errors import InputError
from usdhand.motion import Clip
from usdhand.motion.rotations import Array
from usdhand.reduce.moments import Moments, pooled
from usdhand.reduce.related import related_channels
from usdhand.reduce.subset import Measure
from usdhand.reduce.turns import whole_turns
from usdhand.reduce.variation import band_covariances

# Takes are left out of fits in so many parts, every so many-th together.
MOST_FOLDS = 8
# Frames of a take at which the fingertips' motion is differentiated, and by how many degrees.
TIP_FRAMES = 100
TIP_STEP_DEG = 0.5


@displayed(
    lambda evidence: {
        "takes": len(evidence.sources),
        "frames": evidence.moments.frames,
        "channels": len(evidence.names),
    }
)
@dataclass(frozen=True, eq=False)
class Takes:
    """Takes as a fit needs them.

    Attributes
    ----------
    names : n modelled channels
    folds : moments of every so many-th take
    held : mean of each channel outside the model, degrees
    tips : (tips, n, n) mean squared mm that a fingertip moves by one degree of two channels
    bands : (bands, n, n) covariance of the curves in each of `usdhand.reduce.variation.EDGES_HZ`
    sources : names of the takes
    """

    names: tuple[str, ...]
    folds: tuple[Moments, ...]
    held: dict[str, float]
    tips: Array
    bands: Array
    sources: tuple[str, ...]

    @cached_property
    def moments(self) -> Moments:
        """Of all takes together."""
        return pooled(self.folds)

    @cached_property
    def related(self) -> Array:
        """(n, n) 1 where a channel may follow another, else 0."""
        return related_channels(self.names, self.folds)

    def measure(self, name: str) -> Measure:
        """What counts as error: "deg" or "mm"."""
        return Measure("mm", self.tips) if name == "mm" else Measure("deg")


def gather(takes: Iterable[tuple[Clip, Hands, Channels]]) -> Takes:
    """Take in clips, with their hands and all their channels, one at a time.

    Angles of takes that differ by whole turns are brought onto one turn.

    Raises
    ------
    InputError
        if a clip has fewer than two frames, or the clips' hands have different joints.
    """
    folds: list[Moments] = []
    names: tuple[str, ...] = ()
    held: tuple[str, ...] = ()
    seconds = 0.0
    sources: list[str] = []
    tips = bands = means = np.zeros(())
    for number, (clip, hands, source) in enumerate(takes):
        if len(clip) < 2:
            raise InputError(
                f"{clip.origin.path or clip.name} has only one frame, which shows no motion."
            )
        names = names or hands.model_names
        if hands.model_names != names:
            raise InputError(
                f"{clip.origin.path or clip.name} has other hand joints than {sources[0]}: fit "
                "them apart."
            )
        held = held or tuple(n for n in source.names if n not in set(names))
        curves = source.select(names).values
        own, outside = Moments.of(curves, clip.fps), source.select(held).values.mean(axis=0)
        if folds:
            own = own.turned(whole_turns(names, own.mean - pooled(folds).mean))
        share = own.seconds / (seconds + own.seconds)
        tips = (1.0 - share) * tips + share * tip_forms(clip, hands, source)
        bands = (1.0 - share) * bands + share * band_covariances(curves, clip.fps)
        seconds += own.seconds
        means = (1.0 - share) * means + share * outside
        if number < MOST_FOLDS:
            folds.append(own)
        else:
            folds[number % MOST_FOLDS] = folds[number % MOST_FOLDS].plus(own)
        sources.append(clip.name)
    if not folds:
        raise InputError("There is no clip to fit a rig to.")
    angles = {name: float(mean) for name, mean in zip(held, means, strict=True)}
    return Takes(names, tuple(folds), angles, tips, bands, tuple(sources))


def tip_forms(clip: Clip, hands: Hands, source: Channels) -> Array:
    """(tips, n, n) quadratic forms: squared mm of a fingertip by degrees of modelled channels.

    The mean of the squared Jacobian over some frames. Only the channels of its own digit move a
    tip, so one channel of every digit is moved at a time.
    """
    names = hands.model_names
    at = np.unique(np.linspace(0, len(clip) - 1, min(len(clip), TIP_FRAMES)).round().astype(int))
    some = replace(
        clip,
        rotations=clip.rotations[at],
        translations=clip.translations[at],
        scales=clip.scales[at],
    )
    owners = [
        [i for i, name in enumerate(names) if name.startswith(frames.side[:2] + digit)]
        for frames in hands.frames.values()
        for digit in frames.digits
    ]
    base = Channels(source.names, source.values[at])
    columns = [base.names.index(name) for name in names]
    unmoved = hands.fingertips(some, base)
    jacobians = np.zeros((len(owners), len(at), 3, len(names)))
    for place in range(max(map(len, owners), default=0)):
        moving = [(tip, own[place]) for tip, own in enumerate(owners) if place < len(own)]
        values = base.values.copy()
        values[:, [columns[channel] for _, channel in moving]] += TIP_STEP_DEG
        moved = hands.fingertips(some, Channels(base.names, values))
        slopes = 10.0 * (moved - unmoved) / TIP_STEP_DEG
        for tip, channel in moving:
            jacobians[tip, :, :, channel] = slopes[:, tip]
    flat = jacobians.reshape(len(owners), -1, len(names))
    return np.asarray(np.swapaxes(flat, 1, 2) @ flat / len(at))
