"""What the hand maps of files are, with names as they are and hidden, as a Markdown table.

Run: python benchmarks/rigs_tried.py FILE_OR_FOLDER...

A row a file: what decided, how many joints of each hand were found, whether geometry alone finds
the same joints ("same"), other ones or none, and how far the thumbs are pronated. Who runs it
looks whether the joints are right: with --joints it prints their names.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

from usdhand import find_hands
from usdhand.anatomy.hand import CharacterMap
from usdhand.errors import UsdHandError
from usdhand.formats.files import animation_names, read_any, read_character
from usdhand.formats.suffixes import FORMATS, USD_SUFFIXES
from usdhand.motion import Clip, Skeleton
from usdhand.rigs import map_character


def nameless(skeleton: Skeleton) -> Skeleton:
    """The skeleton with joints that are called nothing in particular."""
    paths: list[str] = []
    for joint in range(len(skeleton)):
        parent = int(skeleton.parents[joint])
        paths.append((f"{paths[parent]}/" if parent >= 0 else "") + f"j{joint}")
    return replace(skeleton, joints=tuple(paths), aliases=(), originals=())


def by_geometry(clip: Clip, found: CharacterMap | None) -> str:
    """What geometry alone finds, compared with what was found."""
    try:
        alone = map_character(nameless(clip.skeleton))
    except UsdHandError:
        return "refused"
    if found is None:
        return "found"
    ours = {s: (h.wrist, dict(h.joints)) for s, h in found.hands.items()}
    theirs = {s: (h.wrist, dict(h.joints)) for s, h in alone.hands.items()}
    if ours == theirs:
        return "same"
    if sorted(map(str, ours.values())) == sorted(map(str, theirs.values())):
        return "same, other side"
    return "other joints"


def row(path: Path, joints: bool) -> Iterator[str]:
    """The lines of a file."""
    try:
        several = len(animation_names(path)) > 1
        clip = read_character(path) if several else read_any(path)[0]
    except UsdHandError as error:
        yield f"| {path.name} | not read: {str(error)[:80]} | | | |"
        return
    try:
        hands = find_hands(clip)
    except UsdHandError as error:
        reason = str(error).removeprefix(f"{path}: ")
        yield f"| {path.name} | refused: {reason[:110]} | | {by_geometry(clip, None)} | |"
        return
    character = hands.character
    counts = ", ".join(f"{s} {len(h.joints)}" for s, h in character.hands.items())
    turned = f"{hands.pronation.degrees:g}" if hands.pronation else ""
    alone = by_geometry(clip, character)
    yield f"| {path.name} | {character.convention} | {counts} | {alone} | {turned} |"
    if joints:
        for side, hand in character.hands.items():
            names = {r: clip.skeleton.names[j] for r, j in hand.joints.items()}
            wrist = clip.skeleton.names[hand.wrist]
            yield f"    {side}: wrist {wrist}, " + ", ".join(f"{r} {n}" for r, n in names.items())
        yield from (f"    note: {note}" for note in hands.notes)
        yield from (f"    problem: {p.message}" for p in character.problems)


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("files", nargs="+", type=Path)
    parser.add_argument("--joints", action="store_true", help="print the joints of each hand")
    arguments = parser.parse_args()
    print("| file | decided by | joints | geometry alone | pronation |")
    print("|---|---|---|---|---|")
    for given in arguments.files:
        for path in [given] if given.is_file() else sorted(given.iterdir()):
            if path.suffix.lower() in (*USD_SUFFIXES, *FORMATS):
                for line in row(path, arguments.joints):
                    print(line, flush=True)


if __name__ == "__main__":
    main()
