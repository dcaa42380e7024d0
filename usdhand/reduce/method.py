"""Reduce and expand: clips to a rig of few channels, and back to motion."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

from usdhand.anatomy.channels import Channels, Hands
from usdhand.display import displayed
from usdhand.errors import UsageError
from usdhand.motion import Clip
from usdhand.reduce.choose import choose, relations_of
from usdhand.reduce.errors import Errors, distances_mm, measure_errors
from usdhand.reduce.evidence import Takes, gather
from usdhand.reduce.fit import Statistics, fit_relations
from usdhand.reduce.limits import Limits
from usdhand.reduce.moments import Moments
from usdhand.reduce.rig import ReducedRig, Relation, relation_matrix
from usdhand.reduce.search import thresholds_for_count, thresholds_for_error
from usdhand.reduce.settings import Criteria, Fit, Target, Thresholds
from usdhand.reduce.variation import Residuals, Variation


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
    evidence : what the rig was fitted to; None where a fitted one was applied
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
    evidence: Takes | None = None

    @property
    def motion(self) -> Clip:
        """The clip with its hands as the rig gives them."""
        return self.hands.decode(self.reduced, self.clip)


def fit_rig(
    clips: Sequence[Clip],
    hands: Sequence[Hands],
    target: Target,
    fit: Fit = "paper",
    most_controllers: int | None = None,
    sources: Sequence[Channels] | None = None,
    choice: Criteria | None = None,
) -> ReducedRig:
    """Fit one rig to all clips together; see `fit_to`.

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
    encoded = sources or [h.encode(c) for c, h in zip(clips, hands, strict=True)]
    evidence = gather(zip(clips, hands, encoded, strict=True))
    return fit_to(evidence, target, fit, most_controllers, choice)


def fit_to(
    evidence: Takes,
    target: Target,
    fit: Fit = "paper",
    most_controllers: int | None = None,
    choice: Criteria | None = None,
) -> ReducedRig:
    """Fit a rig: by the rules of Joerg & O'Sullivan 2009, or with the best channels.

    Thresholds are the paper's rules. A number of channels or a largest error is met with the best
    channels, or with thresholds that are searched for it where ``fit`` is "paper".

    Parameters
    ----------
    most_controllers : how many channels a channel may follow; None for one by the paper's rules,
        else as many as serve takes left out
    choice : what counts where the best channels are chosen

    Raises
    ------
    UsageError
        as `fit_rig`.
    """
    if (most_controllers or 1) > 1 and fit == "paper":
        raise UsageError("Several controllers per channel need the least-squares fit.")
    names, moments, choice = evidence.names, evidence.moments, choice or Criteria()
    thresholds, measure = Thresholds(0.0, 0.0), ""
    if target.thresholds is None and fit == "least-squares":
        model = choose(evidence, target, most_controllers, choice)
        relations, measure = relations_of(evidence, model), choice.measure
    else:
        statistics = Statistics.from_moments(moments)
        thresholds = _thresholds(statistics, target, fit)
        fitted = fit_relations(names, statistics, thresholds, fit, most_controllers or 1)
        relations = _with_limits(fitted, moments)
    dependent = [i for i, r in enumerate(relations) if r.kind != "free"]
    residuals = None
    if dependent:
        residuals = Residuals.of(names, relation_matrix(relations), dependent, evidence.bands)
    return ReducedRig(
        relations,
        evidence.held,
        thresholds.range,
        thresholds.rmsd,
        fit,
        evidence.sources,
        measure,
        residuals,
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
            f"({len(missing)} such channels): fit one to clips with such hands."
        )
    free = rig.on_turn(source.select(rig.free))
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


def expand(
    rig: ReducedRig, free: Channels, clip: Clip, hands: Hands, variation: Variation | None = None
) -> Clip:
    """Put a rig's motion on a clip's hands: dependent channels follow from the free ones.

    ``clip`` gives the body and as many frames as ``free``; channels that its hands lack are left
    out, channels that the rig lacks keep the clip's motion.

    Parameters
    ----------
    variation : motion to put back that the rig does not keep

    Raises
    ------
    UsageError
        if the rig and the clip have no channel in common, or the rig has no residuals to vary by.
    """
    channels = rig.evaluate(free, varied(rig, len(free.values), clip.fps, variation))
    own = hands.encode(clip)
    there = set(own.names)
    shared = [name for name in channels.names if name in there]
    if not shared:
        raise UsageError(f"The rig and {clip.name} have no channel in common.")
    return hands.decode(own.replaced(channels.select(shared)), clip)


def varied(
    rig: ReducedRig, frames: int, fps: float, variation: Variation | None
) -> Channels | None:
    """What to add to a rig's dependent channels, (frames, channels) degrees; None for nothing."""
    if variation is None or variation.amount == 0.0:
        return None
    if rig.residuals is None:
        raise UsageError(
            "The rig does not say what it leaves out, so there is nothing to vary by: reduce again "
            "with this usdhand, or leave --variation away."
        )
    noise = rig.residuals.noise(frames, fps, variation.seed)
    return Channels(rig.residuals.names, variation.amount * noise)


def free_of(rig: ReducedRig, clip: Clip, source: Channels) -> Channels:
    """The rig's free channels of a clip that may have nothing else, on the rig's turn.

    Raises
    ------
    UsageError
        if the clip's hands lack a free channel.
    """
    missing = sorted(set(rig.free) - set(source.names))
    if missing:
        raise UsageError(
            f"The hands of {clip.name} lack the channel '{missing[0]}' that is free in the rig "
            f"({len(missing)} such channels): fit a rig whose free channels they have."
        )
    return rig.on_turn(source.select(rig.free))


def _thresholds(statistics: Statistics, target: Target, fit: Fit) -> Thresholds:
    if target.thresholds is not None:
        return target.thresholds
    if target.free_channels is not None:
        return thresholds_for_count(statistics, target.free_channels, fit)
    assert target.max_error is not None
    return thresholds_for_error(statistics, target.max_error, fit)


def _with_limits(relations: Sequence[Relation], moments: Moments) -> tuple[Relation, ...]:
    """Relations of the paper's rules with limits that change nothing on what they were fitted to.

    The soft ends of a channel that follows one other take in all that it does there.
    """
    spans = {
        r.name: (float(low), float(high))
        for r, low, high in zip(relations, moments.low, moments.high, strict=True)
    }

    def limited(relation: Relation) -> Relation:
        if relation.kind == "constant":
            return relation
        ends = list(spans[relation.name])
        if len(relation.controllers) == 1:
            [slope] = relation.slopes
            ends += [relation.offset + slope * e for e in spans[relation.controllers[0]]]
        return replace(relation, limits=Limits.of(relation.name, min(ends), max(ends)))

    return tuple(limited(relation) for relation in relations)
