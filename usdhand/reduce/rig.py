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
    """

    name: str
    kind: Kind
    offset: float = 0.0
    controllers: tuple[str, ...] = ()
    slopes: tuple[float, ...] = ()
    rmsd: float | None = None
    rms_error: float = 0.0


@displayed(
    lambda rig: {
        "channels": len(rig.relations),
        "free": len(rig.free),
        "range_threshold": rig.range_threshold,
        "rmsd_threshold": rig.rmsd_threshold,
        "fit": rig.fit,
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
    """

    relations: tuple[Relation, ...]
    held: Mapping[str, float] = field(default_factory=dict)
    range_threshold: float = 0.0
    rmsd_threshold: float = 0.0
    fit: str = "paper"
    sources: tuple[str, ...] = ()

    @property
    def names(self) -> tuple[str, ...]:
        """All modelled channels."""
        return tuple(r.name for r in self.relations)

    @property
    def free(self) -> tuple[str, ...]:
        """Channels that have curves of their own."""
        return tuple(r.name for r in self.relations if r.kind == "free")

    def evaluate(self, free: Channels) -> Channels:
        """All channels, held ones included, from the curves of the free ones.

        Raises
        ------
        UsageError
            if a free channel has no curve.
        InputError
            if a controller is missing or controllers form a cycle.
        """
        curves = dict(zip(self.free, free.select(self.free).values.T, strict=True))
        frames = len(free.values)
        for relation in evaluation_order(self.relations):
            if relation.kind != "free":
                value = np.full(frames, relation.offset)
                for controller, slope in zip(relation.controllers, relation.slopes, strict=True):
                    value += slope * curves[controller]
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


def _columns(values: list[Array], frames: int) -> Array:
    return np.stack(values).T if values else np.empty((frames, 0))
