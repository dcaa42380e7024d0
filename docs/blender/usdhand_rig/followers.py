"""Channels that follow others, as expressions that Blender evaluates itself.

A long sum is taken apart: its parts become properties of their own, which the channel adds up.
"""

from collections.abc import Iterator, Sequence

from .rig_file import Channel
from .rotations import LONGEST

Driver = tuple[str, str, list[tuple[str, str]]]  # property, expression, its variables' properties
PART = "usdhand {} {}"


def drivers(channel: Channel) -> Iterator[Driver]:
    """Drivers of a linear channel: of its parts first, its own last."""
    names = [f"c{i}" for i in range(len(channel.controllers))]
    terms = [f"{slope:+.8g}*{c}" for slope, c in zip(channel.slopes, names, strict=True)]
    variables = list(zip(names, channel.controllers, strict=True))
    whole = "".join([f"{channel.offset:.8g}", *terms])
    expression = limited(f"({whole})", channel.limits) if channel.limits else whole
    if len(expression) <= LONGEST:
        yield channel.name, expression, variables
        return
    parts = []
    for first, last in _spans([len(term) for term in terms], LONGEST):
        name = PART.format(channel.name, len(parts))
        yield name, "".join(terms[first:last]), variables[first:last]
        parts.append(name)
    letters = [f"p{i}" for i in range(len(parts))]
    whole, variables = (
        f"{channel.offset:.8g}+{'+'.join(letters)}",
        list(zip(letters, parts, strict=True)),
    )
    expression = limited(f"({whole})", channel.limits) if channel.limits else whole
    yield channel.name, expression, variables


def limited(x: str, limits: Sequence[float]) -> str:
    """An expression that stays as it is between the soft ends and within the hard ones.

    Beyond a soft end, e becomes ``m e / (m + e) = m - m^2 / (m + e)``, m the way to the hard end.
    """
    low, soft_low, soft_high, high = limits
    text = f"min(max({x},{soft_low:.7g}),{soft_high:.7g})"
    if (m := high - soft_high) > 1e-6:
        text += f"+{m:.7g}-{m * m:.8g}/max({x}-({soft_high - m:.7g}),{m:.7g})"
    if (m := soft_low - low) > 1e-6:
        text += f"-{m:.7g}+{m * m:.8g}/max({soft_low + m:.7g}-{x},{m:.7g})"
    return text


def _spans(lengths: Sequence[int], longest: int) -> Iterator[tuple[int, int]]:
    """First and last index of runs whose lengths add up to no more than ``longest``."""
    first = total = 0
    for i, length in enumerate(lengths):
        if total + length > longest:
            yield first, i
            first, total = i, 0
        total += length
    yield first, len(lengths)
