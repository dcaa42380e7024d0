"""The reduced hand rig: which channels are free, and how the others follow from them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Literal

import numpy as np

from usdhand.anatomy.channels import Channels
from usdhand.display import displayed
from usdhand.errors import InputError
from usdhand.motion.rotations import Array
from usdhand.reduce.limits import Limits
from usdhand.reduce.turns import whole_turns
from usdhand.reduce.variation import Residuals

Kind = Literal["free", "constant", "linear"]


@displayed()
@dataclass(frozen=True)
class Relation:
    """How one channel gets its value.

    ``free``: from its own curve; ``constant``: ``offset``;
    ``linear``: ``offset + sum(slopes * controllers)``.

    Attributes
    ----------
    rmsd : RMS deviation of the standardised curves (Joerg & O'Sullivan 2009, section 4.1), for
        linear channels of one controller; it may exceed the threshold where a chain of
        controllers was followed to its root
    rms_error : degrees, on the motion that the rig was fitted to
    left_out_error : the same on takes left out of the fit; None where there was one take
    std : standard deviation on the motion that the rig was fitted to, degrees; None if not known
    limits : of a free channel where an animator should move it, of a linear one where it stays
    """

    name: str
    kind: Kind
    offset: float = 0.0
    controllers: tuple[str, ...] = ()
    slopes: tuple[float, ...] = ()
    rmsd: float | None = None
    rms_error: float = 0.0
    left_out_error: float | None = None
    std: float | None = None
    limits: Limits | None = None

    @property
    def told(self) -> float | None:
        """Share of its variance that the rig tells, 0 to 1, on the motion it was fitted to."""
        if self.std is None or self.kind == "free":
            return None
        return max(0.0, 1.0 - (self.rms_error / self.std) ** 2) if self.std > 0 else 1.0


@displayed(
    lambda rig: {
        "channels": len(rig.relations),
        "free": len(rig.free),
        "range_threshold": rig.range_threshold,
        "rmsd_threshold": rig.rmsd_threshold,
        "fit": rig.fit,
        "measure": rig.measure,
        "sources": rig.sources,
    }
)
@dataclass(frozen=True)
class ReducedRig:
    """A hand rig of a few free channels.

    Attributes
    ----------
    relations : one a modelled channel, in channel order
    held : angles outside the model (20 a hand) and the mean that they are held at, degrees
    range_threshold, rmsd_threshold : what the rig was fitted with (degrees; standardised)
    fit : "paper" or "least-squares"
    sources : names of the clips it was fitted to
    measure : "deg" or "mm": what the free channels were chosen by; "" where the paper's rules chose
    residuals : the motion that it does not keep; None if not known
    """

    relations: tuple[Relation, ...]
    held: Mapping[str, float] = field(default_factory=dict)
    range_threshold: float = 0.0
    rmsd_threshold: float = 0.0
    fit: str = "paper"
    sources: tuple[str, ...] = ()
    measure: str = ""
    residuals: Residuals | None = None

    @property
    def names(self) -> tuple[str, ...]:
        """All modelled channels."""
        return tuple(r.name for r in self.relations)

    @property
    def free(self) -> tuple[str, ...]:
        """Channels that have curves of their own."""
        return tuple(r.name for r in self.relations if r.kind == "free")

    def on_turn(self, free: Channels) -> Channels:
        """Curves of free channels less the whole turns that lead away from their limits."""
        middles = {r.name: r.limits.middle for r in self.relations if r.limits is not None}
        means = free.values.mean(axis=0) if len(free.values) else np.zeros(len(free))
        away = [m - middles.get(name, m) for name, m in zip(free.names, means, strict=True)]
        turns = whole_turns(free.names, np.array(away))
        if not turns.any():
            return free
        return Channels(free.names, (free.values.T - 360.0 * turns[:, None]).T)

    def evaluate(self, free: Channels, added: Channels | None = None) -> Channels:
        """All channels, held ones included, from the curves of the free ones.

        Parameters
        ----------
        added : curves in degrees to add to channels that are not free, within their limits

        Raises
        ------
        UsageError
            if a free channel has no curve.
        InputError
            if a controller is missing or controllers form a cycle.
        """
        curves = dict(zip(self.free, free.select(self.free).values.T, strict=True))
        frames = len(free.values)
        more = {} if added is None else dict(zip(added.names, added.values.T, strict=True))
        for relation in evaluation_order(self.relations):
            if relation.kind != "free":
                value = np.full(frames, relation.offset)
                for controller, slope in zip(relation.controllers, relation.slopes, strict=True):
                    value += slope * curves[controller]
                if relation.name in more:
                    value += more[relation.name]
                if relation.limits is not None and relation.kind == "linear":
                    value = relation.limits.soften(value)
                curves[relation.name] = value
        held = {name: np.full(frames, value) for name, value in self.held.items()}
        values = [*(curves[name] for name in self.names), *held.values()]
        return Channels((*self.names, *held), _columns(values, frames))


def evaluation_order(relations: Sequence[Relation]) -> tuple[Relation, ...]:
    """Relations with every controller before the channels that follow it.

    Raises
    ------
    InputError
        if a controller is missing or controllers form a circle; names the channels.
    """
    by_name = {r.name: r for r in relations}
    done: dict[str, Relation] = {}
    for relation in relations:
        chain = {} if relation.name in done else {relation.name: iter(relation.controllers)}
        while chain:  # from a channel to its controllers, to theirs, and so on
            name = next(reversed(chain))
            controller = next(chain[name], None)
            if controller is None:
                done[name] = by_name[name]
                del chain[name]
            elif controller not in by_name:
                raise InputError(
                    f"Channel '{name}' follows '{controller}', which is not in the rig."
                )
            elif controller in chain:
                names = list(chain)
                circle = " -> ".join([*names[names.index(controller) :], controller])
                raise InputError(f"The rig's channels control each other in a cycle: {circle}.")
            elif controller not in done:
                chain[controller] = iter(by_name[controller].controllers)
    return tuple(done.values())


def relation_matrix(relations: Sequence[Relation]) -> Array:
    """(n, n) matrix of relations that follow free channels only; see `usdhand.reduce.relate`."""
    place = {r.name: i for i, r in enumerate(relations)}
    told = np.zeros((len(relations), len(relations)))
    for i, relation in enumerate(relations):
        if relation.kind == "free":
            told[i, i] = 1.0
        for controller, slope in zip(relation.controllers, relation.slopes, strict=True):
            told[i, place[controller]] = slope
    return told


def _columns(values: list[Array], frames: int) -> Array:
    return np.stack(values).T if values else np.empty((frames, 0))
