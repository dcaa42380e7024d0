"""Array attributes over time, read as fast as USD allows.

Reading from the layer that holds the samples is about 1.5 times faster than asking the attribute;
where the samples are composed in any less simple way, the attribute is asked.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pxr import Sdf, Usd

from usdhand.errors import InputError
from usdhand.motion.rotations import Array

BLOCK = 128  # rows worked on at a time: they stay in the processor's cache
EVERY = slice(None)

Places = NDArray[np.intp] | slice


@dataclass(frozen=True, eq=False)
class Track:
    """An array attribute at some time codes: a row each, or one row if it has one value only.

    Attributes
    ----------
    times : stage time codes; empty for an attribute without time samples
    keys : what ``get`` takes for each row
    shape : of a row, (elements, numbers an element)
    """

    attribute: Usd.Attribute
    times: Array
    keys: list[Any]
    get: Callable[[Any], Any]
    shape: tuple[int, int]

    @property
    def still(self) -> bool:
        """Whether there is one value for all times, be it a time sample."""
        return len(self.keys) == 1

    def at(self, times: Array) -> Track:
        """The same attribute at other times, as USD interpolates it."""
        if self.still or _same(times, self.times):
            return self
        query = Usd.AttributeQuery(self.attribute)
        return Track(self.attribute, times, times.tolist(), query.Get, self.shape)

    def fill(self, rows: NDArray[Any], start: int, elements: Places, places: Places) -> None:
        """Put values from row ``start`` on into ``rows``: their ``elements`` to ``places``.

        Raises
        ------
        InputError
            if a sample is blocked or has another number of elements than the track.
        """
        get, shape, whole = self.get, self.shape, elements is EVERY
        found = rows if whole else np.empty((len(rows), *shape), rows.dtype)
        keys = self.keys * len(rows) if self.still else self.keys[start : start + len(rows)]
        for i, key in enumerate(keys):
            row = np.asarray(get(key))
            if row.shape != shape:
                raise InputError(self._refusal(row, start + i))
            found[i] = row
        if not whole:
            rows[:, places] = found[:, elements]

    @property
    def where(self) -> str:
        """File of the stage, for messages."""
        return str(self.attribute.GetStage().GetRootLayer().realPath)

    def _refusal(self, row: NDArray[Any], index: int) -> str:
        at = f"at time code {self.times[index]:g}" if len(self.times) else "and no time samples"
        size = f"{len(row)} elements" if row.ndim else "no value"
        return (
            f"{self.where}: {self.attribute.GetPath()} has {size} {at}, but its animation lists "
            f"{self.shape[0]} joints. Export the animation again."
        )


def open_track(attribute: Usd.Attribute, shape: tuple[int, int]) -> Track | None:
    """Open an attribute at its own samples; None if nothing is authored."""
    if not attribute or not attribute.HasAuthoredValue():
        return None
    source = attribute.GetResolveInfo(Usd.TimeCode.EarliestTime()).GetSource()
    if source == Usd.ResolveInfoSourceTimeSamples:
        layer, path, keys, times = _layer_samples(attribute)
        return Track(attribute, times, keys, partial(layer.QueryTimeSample, path), shape)
    keys = attribute.GetTimeSamples()
    if keys:
        return Track(attribute, np.array(keys), keys, Usd.AttributeQuery(attribute).Get, shape)
    return Track(attribute, np.empty(0), [None], lambda _: attribute.Get(), shape)


def blocks(count: int) -> Iterator[slice]:
    """Slices that together cover ``count`` rows."""
    return (slice(start, min(start + BLOCK, count)) for start in range(0, count, BLOCK))


def steady(values: NDArray[Any], joints: Places = EVERY) -> bool:
    """Whether all rows (frames, joints, n) are the same, of some joints."""
    if len(values) < 2 or values.strides[0] == 0:
        return True
    first = values[0][joints]
    return all(bool((values[block][:, joints] == first).all()) for block in blocks(len(values)))


def _same(times: Array, own: Array) -> bool:
    return len(times) == len(own) and np.allclose(times, own, rtol=1e-12, atol=1e-6)


def _layer_samples(attribute: Usd.Attribute) -> tuple[Sdf.Layer, Sdf.Path, list[float], Array]:
    """Return the strongest layer with samples, its time codes, and what they are on the stage."""
    specs = attribute.GetPropertyStackWithLayerOffsets(Usd.TimeCode.EarliestTime())
    for spec, offset in specs:
        keys = spec.layer.ListTimeSamplesForPath(spec.path)
        if keys:
            return spec.layer, spec.path, keys, np.array(keys) * offset.scale + offset.offset
    raise AssertionError(f"{attribute.GetPath()} is resolved from time samples, but has none")
