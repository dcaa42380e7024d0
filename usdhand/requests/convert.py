"""What `convert` is to do."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import ClassVar, Literal

from usdhand.display import displayed
from usdhand.formats.reading import Reading
from usdhand.options import argument, check_values, option, settings
from usdhand.requests import shared
from usdhand.requests.base import Request
from usdhand.units import UpAxis

Suffix = Literal["usdc", "usda", "usd", "usdz", "bvh", "glb", "gltf"]
RootMotion = Literal["keep", "drop"]


def read_span(text: str) -> tuple[float | None, float | None]:
    """Read two time codes with a colon between; either may be missing.

    Raises
    ------
    ValueError
        if it is no such text.
    """
    try:
        first, last = (float(part) if part.strip() else None for part in text.split(":"))
    except ValueError as error:
        raise ValueError(f"'{text}' is not FIRST:LAST in time codes.") from error
    return first, last


@displayed()
@dataclass(frozen=True)
class Edits:
    """What is done to a clip between reading and writing.

    Attributes
    ----------
    fps : frames a second to resample to
    start : time code of the first frame in the output
    trim : first and last time code to keep, in the input's time codes
    scale : factor on the character's size
    root_motion : "drop" keeps the hips above the point where they start
    up : "Y" or "Z", the up axis of the output (USD and BVH)
    """

    fps: float | None = option("Resample to this frame rate.", default=None, metavar="RATE")
    start: float | None = option("Time code of the first frame.", default=None, metavar="TIME")
    trim: tuple[float | None, float | None] = option(
        "Keep these time codes of the input.",
        default=(None, None),
        metavar="FIRST:LAST",
        read=read_span,
    )
    scale: float = option("Factor for the size of the character.", default=1.0)
    root_motion: RootMotion = option(
        "Whether the character travels, or stays where it starts.", default="keep"
    )
    up: UpAxis | None = option("Up axis of the output (USD and BVH). [default: Y]", default=None)

    def __post_init__(self) -> None:
        check_values(self)

    @property
    def of_frames(self) -> bool:
        """Whether the motion itself changes."""
        return self.fps is not None or self.trim != (None, None) or self.root_motion == "drop"


@displayed()
@dataclass(frozen=True, kw_only=True)
class ConvertRequest(Request):
    """Convert motion between USD, BVH, glTF (also VRM) and FBX (read only).

    A converted USD file needs no other; only a .usda has its motion in NAME.motion.usdc beside it.
    If the input is USD, everything else is kept, such as meshes, materials and cameras. With --onto
    the fingers go to another character, whatever its names, axes and proportions. What a file does
    not state is guessed, with a note.

    \b
    Examples:
      usdhand convert talk.bvh -o talk.usda --fps 30 --start 1001
      usdhand convert takes/*.fbx --out-dir usd
      usdhand convert gloves.glb --onto hero.usd -o hero_hands.usdc
    """

    verb: ClassVar[str] = "convert"
    files: tuple[str, ...] = argument("Files, folders and wildcards.", several="files")
    output: Path | None = shared.output(
        "The file to write; its suffix tells the format.", default=None
    )
    out_dir: Path | None = option(
        "Folder for the results of several inputs, or of all animations of one.",
        default=None,
        metavar="DIR",
        written=True,
        reported=False,
    )
    to: Suffix | None = option(
        "Format of the files in --out-dir.  [default: usdc]", default=None, reported=False
    )
    onto: Path | None = option(
        "Put the fingers of the inputs on this character, and write it instead.",
        default=None,
        metavar="CHARACTER",
    )
    edits: Edits = settings(Edits())
    reading: Reading = settings(Reading())
    onto_skel: str | None = shared.skel("Skeleton of the character to put fingers on.")
    maps: tuple[Path, ...] = shared.maps()
    neutral: Path | None = shared.neutral()
    flatten: bool = option(
        "Write a .usda as one file, without a crate beside it for its motion.", default=False
    )
    allow_outside: bool = shared.allow_outside()
    report: Path | None = shared.report()
    dry_run: bool = shared.dry_run()
    force: bool = shared.force()
