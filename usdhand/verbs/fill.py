"""Method 2 on clips and files: fill bodies from a library, measure it."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from usdhand.anatomy import SIDES, Side
from usdhand.errors import HandNotFoundError, UsdHandError
from usdhand.evaluate.reconstruction import HandError, reconstruction_errors
from usdhand.fill.candidates import SearchSpace
from usdhand.fill.library import Left, LibraryClip, MotionLibrary, Part
from usdhand.fill.method import fill, moving_sides
from usdhand.fill.results import Filled
from usdhand.fill.settings import FillSettings
from usdhand.formats.files import read_clip, reopened, source_file
from usdhand.formats.hashing import file_hash
from usdhand.formats.usd.add_joints import author_joints, joint_count
from usdhand.formats.usd.library import is_library, read_library, write_library
from usdhand.formats.usd.write import write_motion
from usdhand.motion import Clip, Problem
from usdhand.rigs import Conventions, load_conventions
from usdhand.verbs.clips import find_hands
from usdhand.verbs.finger_joints import lacks_fingers
from usdhand.verbs.library import (
    BuildResult,
    build_library,
    forget_interrupted,
    gone_clips,
    label_of,
)

__all__ = [
    "BuildResult",
    "build_library",
    "fill_fingers",
    "forget_interrupted",
    "gone_clips",
    "is_library",
    "label_of",
    "measure_library",
    "read_library",
    "write_filled",
    "write_library",
]


def fill_fingers(
    body: Clip,
    library: MotionLibrary,
    settings: FillSettings | None = None,
    *,
    sides: Sequence[Side] = SIDES,
    replace_motion: bool = False,
    conventions: Conventions | None = None,
) -> Filled:
    """Give a body clip the fingers of similar motions; see `usdhand.fill.fill`."""
    try:
        hands = find_hands(body, conventions, sides)
    except HandNotFoundError as error:
        bare = lacks_fingers(body, conventions, sides)
        if not bare:
            raise
        raise HandNotFoundError(
            f"{body.origin.path or body.name}: the skeleton has no finger joints below its "
            f"{' and '.join(bare)} wrist, so there is nothing to put finger motion on. "
            "--add-fingers adds those of the library's character, scaled to the body; "
            "--fingers-from CHARACTER those of another one."
        ) from error
    content = file_hash(body.origin.path) if body.origin.path else None
    return fill(
        body,
        hands,
        library,
        settings,
        sides=sides,
        replace_motion=replace_motion,
        content_hash=content,
    )


def write_filled(
    filled: Filled,
    output: str | Path,
    *,
    flatten: bool = False,
    force: bool = False,
    inputs: Sequence[Path] = (),
) -> tuple[Problem, ...]:
    """Write a filled body as a layer over its file; alternatives are variants of the animation.

    Returns what one file, if it was to be one, could not keep.

    The variant set ``fingers`` is on the new SkelAnimation; ``choice_1``, the best, is selected.
    Joints that the body has beyond its file (`add_finger_joints`) are added to its Skeleton.
    """
    best = filled.clips[0]
    character = reopened(best)
    added = range(joint_count(character), len(best.skeleton))
    changed = sorted({*filled.changed, *added})
    digits = len(str(len(filled.clips)))  # so that editors sort them
    variants = {f"choice_{i:0{digits}}": clip for i, clip in enumerate(filled.clips, 1)}
    return write_motion(
        character,
        best,
        changed,
        Path(output),
        flatten=flatten,
        force=force,
        inputs=inputs,
        variants=variants if len(variants) > 1 else None,
        author=lambda layer, _: author_joints(layer, character, best.skeleton),
    )


def measure_library(
    library: MotionLibrary,
    folder: Path,
    settings: FillSettings,
    *,
    takes: Sequence[Clip] | None = None,
    maps: Sequence[Path] = (),
) -> tuple[list[HandError], list[Left]]:
    """Fill every clip of a library from the others and compare with its true fingers.

    Parameters
    ----------
    folder : of the library, which its clips' paths are relative to
    takes : clips to fill instead, such as those of another rig

    Returns
    -------
    errors, and the clips that could not be filled, or have still fingers, with the reason
    """
    from usdhand.fill.method import space_for

    conventions = load_conventions(*maps)
    sources: list[Clip | LibraryClip] = list(library.clips if takes is None else takes)
    spaces: dict[Part, SearchSpace] = {
        (side,): space_for(library, (side,), settings)
        for side in SIDES
        if any(side in c.hands for c in library.clips)
    }
    errors: list[HandError] = []
    left: list[Left] = []
    for source in sources:
        try:
            clip = _library_source(source, folder) if isinstance(source, LibraryClip) else source
            hands = find_hands(clip, conventions)
            moving = moving_sides(hands.encode(clip), hands)
            # The library has no still hands, so of its own clips there is nothing to say.
            if still := [] if takes is None else [s for s in hands.frames if s not in moving]:
                which = " and ".join(still)
                left.append(Left(clip.name, f"the {which} fingers do not move: no truth to meet"))
            if not moving:
                continue
            errors += reconstruction_errors(
                clip,
                hands,
                library,
                settings,
                sides=moving,
                content_hash=file_hash(source_file(clip)),
                spaces=None if settings.couple else spaces,
            )
        except UsdHandError as error:
            left.append(Left(source.name, str(error)))
    return errors, left


def _library_source(clip: LibraryClip, folder: Path) -> Clip:
    return read_clip(folder / clip.path, clip.skel or None)
