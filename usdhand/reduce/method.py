"""Reduce and expand: clips to a rig of few channels, and back to motion."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from usdhand.anatomy.channels import Channels, Hands
from usdhand.display import displayed
from usdhand.errors import InputError, UsageError
from usdhand.motion import Clip
from usdhand.reduce.errors import Errors, distances_mm, measure_errors
from usdhand.reduce.fit import Statistics, fit_relations
from usdhand.reduce.rig import ReducedRig
from usdhand.reduce.search import thresholds_for_count, thresholds_for_error
from usdhand.reduce.settings import Fit, Target, Thresholds


@displayed(
    lambda reduction: {
        "name": reduction.clip.name,
        "frames": len(reduction.clip),
        "channels": len(reduction.rig.relations),
        "free": len(reduction.rig.free),
        "rms_deg": reduction.errors.rms_deg,
        "fingertip_mean": reduction.errors.fingertip_mean,
    }
)
@dataclass(frozen=True, eq=False)
class Reduction:
    """A clip in terms of a rig.

    Attributes
    ----------
    source : all channels of the clip
    free : curves of the rig's free channels
    reduced : all channels as the rig gives them, held ones included
    errors : of the modelled channels against the model (what reduction loses)
    model_errors : of all 45 channels a hand when only 25 move (what the model loses)
    total_errors : of all channels against the source
    """

    clip: Clip
    hands: Hands
    rig: ReducedRig
    source: Channels
    free: Channels
    reduced: Channels
    errors: Errors
    model_errors: Errors
    total_errors: Errors

    @property
    def motion(self) -> Clip:
        """The clip with its hands as the rig gives them."""
        return self.hands.decode(self.reduced, self.clip)


def fit_rig(
    clips: Sequence[Clip],
    hands: Sequence[Hands],
    target: Target,
    fit: Fit = "paper",
    most_controllers: int = 1,
    sources: Sequence[Channels] | None = None,
) -> ReducedRig:
    """Fit one rig to all clips together (Joerg & O'Sullivan 2009).

    Parameters
    ----------
    sources : all channels of the clips, if they were encoded already

    Raises
    ------
    InputError
        if a clip has fewer than two frames, or the clips' hands have different joints.
    UsageError
        if settings contradict each other.
    """
    if most_controllers > 1 and fit == "paper":
        raise UsageError("Several controllers per channel need the least-squares fit.")
    for clip in clips:
        if len(clip) < 2:
            raise InputError(
                f"{clip.origin.path or clip.name} has only one frame, which shows no motion."
            )
    names = hands[0].model_names
    for clip, other in zip(clips, hands, strict=True):
        if other.model_names != names:
            raise InputError(
                f"{clip.origin.path or clip.name} has other hand joints than {clips[0].name}: fit "
                "them apart."
            )
    encoded = sources or [h.encode(c) for c, h in zip(clips, hands, strict=True)]
    modelled = np.concatenate([e.select(names).values.T for e in encoded], axis=1).T
    statistics = Statistics.of(modelled)
    thresholds = _thresholds(statistics, target, fit)
    others = tuple(n for n in hands[0].all_names if n not in set(names))
    held = sum(e.select(others).values.sum(axis=0) for e in encoded) / len(modelled)
    return ReducedRig(
        fit_relations(names, statistics, thresholds, fit, most_controllers),
        dict(zip(others, (float(v) for v in held), strict=True)),
        thresholds.range,
        thresholds.rmsd,
        fit,
        tuple(clip.name for clip in clips),
    )


def apply_rig(
    rig: ReducedRig, clip: Clip, hands: Hands, source: Channels | None = None
) -> Reduction:
    """Express a clip, fitted or not, in the free channels of a rig.

    Parameters
    ----------
    source : all channels of the clip, if they were encoded already

    Raises
    ------
    UsageError
        if the rig has channels that the clip's hands lack.
    """
    source = source or hands.encode(clip)
    missing = sorted({*rig.names, *rig.held} - set(source.names))
    if missing:
        raise UsageError(
            f"The rig has the channel '{missing[0]}' that the hands of {clip.name} do not have "
            f"({len(missing)} such channels)."
        )
    free = source.select(rig.free)
    # Channels of this hand that the rig knows nothing of keep their motion.
    reduced = source.replaced(rig.evaluate(free))
    model = reduced.replaced(source.select(rig.names))
    tips, model_tips, reduced_tips = (hands.fingertips(clip, c) for c in (None, model, reduced))
    total = measure_errors(source, reduced, distances_mm(tips, reduced_tips))
    return Reduction(
        clip,
        hands,
        rig,
        source,
        free,
        reduced,
        errors=total.of_channels(rig.names, distances_mm(model_tips, reduced_tips)),
        model_errors=total.of_channels(tuple(rig.held), distances_mm(tips, model_tips)),
        total_errors=total,
    )


def expand(rig: ReducedRig, free: Channels, clip: Clip, hands: Hands) -> Clip:
    """Put a rig's motion on a clip's hands: dependent channels follow from the free ones.

    ``clip`` gives the body and as many frames as ``free``; channels that its hands lack are left
    out, channels that the rig lacks keep the clip's motion.
    """
    channels = rig.evaluate(free)
    own = hands.encode(clip)
    there = set(own.names)
    shared = [name for name in channels.names if name in there]
    if not shared:
        raise UsageError(f"The rig and {clip.name} have no channel in common.")
    return hands.decode(own.replaced(channels.select(shared)), clip)


def _thresholds(statistics: Statistics, target: Target, fit: Fit) -> Thresholds:
    if target.thresholds is not None:
        return target.thresholds
    if target.free_channels is not None:
        return thresholds_for_count(statistics, target.free_channels, fit)
    assert target.max_error is not None
    return thresholds_for_error(statistics, target.max_error, fit)
