"""What a user may set of splice, and the paper's own values."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from usdhand.display import displayed
from usdhand.errors import UsageError
from usdhand.options import check_values, option

Align = Literal["local", "trunk", "timecode"]
Directions = Literal["spread", "axes"]
Wrist = Literal["body", "hands"]


@displayed()
@dataclass(frozen=True)
class Pin:
    """A moment of the body and the moment of the hand clip that belongs to it.

    Attributes
    ----------
    body, hand : seconds from the first frame of their clips
    tolerance : seconds of the hand clip that the warp may be off; 0: exact
    side : the hand it is for, None for both
    name : text that the user gave, for messages
    """

    body: float
    hand: float
    tolerance: float = 0.0
    side: Literal["left", "right"] | None = None
    name: str = ""

    def __post_init__(self) -> None:
        check_values(self)

    def __str__(self) -> str:
        return self.name or f"{self.body:g} s : {self.hand:g} s"


@dataclass(frozen=True)
class SignRule:
    """How motion becomes signs.

    Attributes
    ----------
    smoothing : standard deviation of the Gaussian whose derivatives are taken, seconds
    dead_zone : derivatives below this share of their RMS have the sign 0
    noise_zone : and those below this many standard deviations of their noise
    rest_signs : a frame with at most as many of 64 signs that are not 0 rests
    directions : along which signs are taken, see `usdhand.splice.phases.sign_axes`
    """

    smoothing: float
    dead_zone: float
    noise_zone: float
    rest_signs: int
    directions: Directions


def read_band(text: str) -> tuple[float, float]:
    """Read two numbers with a comma between.

    Raises
    ------
    ValueError
        if it is no such text.
    """
    try:
        first, second = (float(part) for part in text.split(","))
    except ValueError as error:
        raise ValueError(f"'{text}': give two numbers, such as 0.3,0.1.") from error
    return first, second


LIMITS = {
    "least_band": (0.0, 1e4),
    "fps": (1.0, 1000.0),
    "smoothing": (0.001, 10.0),
    "shared_smoothing": (0.001, 10.0),
    "dead_zone": (0.0, 10.0),
    "tether": (0.0, 1e4),
}


@displayed()
@dataclass(frozen=True)
class SpliceSettings:
    """How clips are aligned; the defaults are the measured best, `PAPER` has the paper's axes.

    Attributes
    ----------
    band : widths of the bands of pass 1 and pass 2, as shares of the body's length
    least_band : seconds that bands have at least: performers of short clips are off by as much as
        those of long ones
    pins : moments that belong together
    claps : moments that both recordings show at once, as a clap; between and beyond them, time
        runs as fast in both, and motion has no influence
    align : "local" fits a turn about the vertical wherever motions are compared, "trunk" measures
        it from the trunks; "timecode" takes the timing from the time codes of both clips
    wrist : whose wrist rotation the result has
    directions : of the derivatives' signs, see `usdhand.splice.phases.sign_axes`
    fps : rate at which motion is compared
    smoothing : of positions before derivatives are taken, standard deviation in seconds
    shared_smoothing : the same, as soon as both clips are in the body's time
    dead_zone, noise_zone : shares of their RMS, and of their noise, below which derivatives count
        as zero
    rest_signs : signs that are not zero up to which a frame rests; a rest uses up frames of its own
        clip only; below 0: none does
    tether : seconds of the hand clip that pass 2 may typically move pass 1 by; 0: no pass 2
    """

    band: tuple[float, float] = option(
        "How far the timing may deviate in both passes, as shares of the body's length.",
        default=(0.3, 0.1),
        metavar="FIRST,SECOND",
        read=read_band,
        shown="0.3,0.1",
    )
    least_band: float = 1.5
    pins: tuple[Pin, ...] = ()
    claps: tuple[Pin, ...] = ()
    align: Align = option(
        "How the clips are matched: by motion, in directions that the motion around every frame "
        "or the trunks tell, or by the time codes of both.",
        default="local",
    )
    wrist: Wrist = option("Which clip the wrists' rotation comes from.", default="body")
    directions: Directions = "spread"
    fps: float = 60.0
    smoothing: float = 0.045
    shared_smoothing: float = 0.065
    dead_zone: float = 0.06
    noise_zone: float = 2.1
    rest_signs: int = 16
    tether: float = 0.3

    def __post_init__(self) -> None:
        check_values(self)
        if not all(0.0 < width <= 1.0 for width in self.band):
            raise UsageError("Bands are shares of the body's length: above 0 and at most 1.")
        for name, (least, most) in LIMITS.items():
            if not least <= (value := getattr(self, name)) <= most:
                raise UsageError(f"{name} is {value:g}; it must be from {least:g} to {most:g}.")

    def rule(self, smoothing: float) -> SignRule:
        """How motion becomes signs with this smoothing."""
        zones = self.dead_zone, self.noise_zone
        return SignRule(smoothing, *zones, self.rest_signs, self.directions)


# Signs along x, y and z only, and rests as any motion, as the paper has them.
PAPER = SpliceSettings(directions="axes", noise_zone=0.0, rest_signs=-1)
