#!/usr/bin/env python3
"""Make all samples: two characters, gestures, conversations and hands filmed alone.

    python samples/make_samples.py [--output DIR] [--only gestures]

Needs usd-core, numpy and scipy. Seeds are fixed: running it again gives the same files.
"""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parent))

from generate.body import Array, Pose
from generate.character import ADA_LOOK, BEN_LOOK, hands_only, person
from generate.gestures import GESTURES, Performer, single, variations
from generate.motion import perform
from generate.rigs import Rig, ada, ben, only_hands
from generate.talks import Excerpt, conversation, hands_take
from generate.usdfiles import (
    arms_and_trunk,
    finger_joints,
    sample,
    write_character,
    write_clip,
)

RATE = 30.0
HANDS_RATE = 60.0
TALKS = (
    ("talk_01", "ada", 21.0, 101),
    ("talk_02", "ada", 21.0, 202),
    ("talk_03", "ben", 21.0, 304),
)
EXCERPTS = (
    Excerpt("talk_01_hands_a", 0.0, 6.0, 1.12, 0.18, 0.6),
    Excerpt("talk_01_hands_b", 6.5, 13.0, 0.92, -0.16, 0.7),
    Excerpt("talk_01_hands_right", 13.0, 19.0, 1.05, 0.15, 0.5, "R"),
)
RIGS: dict[str, Callable[[], Rig]] = {"ada": ada, "ben": ben}


def standing(rig: Rig) -> Pose:
    """The rest pose: at ease, arms at the sides."""
    score = replace(Performer(rig.body, 1).score, liveliness=0.0)
    return perform(rig.body, score, np.zeros(1))


def frames(seconds: float) -> Array:
    """Times of all frames of a clip."""
    return np.asarray(np.arange(int(np.ceil(seconds * RATE)) + 1) / RATE)


def make_characters(out: Path) -> None:
    """Both people, and ada's forearms and hands."""
    for name, look in (("ada", ADA_LOOK), ("ben", BEN_LOOK)):
        rig = RIGS[name]()
        about = f"{rig.name}, a procedural person with {len(rig.paths())} joints. Synthetic, CC0."
        write_character(out / f"characters/{name}.usdc", rig, standing(rig),
                        person(rig.body, rig.bind, look), about)  # fmt: skip
    for sides, name in (("LR", "ada_hands"), ("R", "ada_hand_right")):
        rig = only_hands(ada(), sides)
        about = "Forearms and hands of Ada. Synthetic, CC0."
        parts = hands_only(rig.body, rig.bind, ADA_LOOK, sides)
        write_character(out / f"characters/{name}.usdc", rig, standing(rig), parts, about)


def make_gestures(out: Path) -> None:
    """Eight gestures in eight variations by ada, in two others by ben."""
    for name, folder, count, seed in (("ada", "gestures", 8, 1), ("ben", "gestures_ben", 2, 77)):
        rig = RIGS[name]()
        joints = [*arms_and_trunk(rig), *finger_joints(rig)]
        for gesture in GESTURES:
            for number, v in enumerate(variations(gesture, count, seed), 1):
                score, seconds = single(rig.body, gesture, v)
                motion = sample(rig, perform(rig.body, score, frames(seconds)), joints)
                about = {"label": gesture, "variation": number, "actor": name,
                         "pace": round(v.pace, 3), "height": round(v.height, 3),
                         "distance": round(v.distance, 3), "amplitude": round(v.amplitude, 3),
                         "hands": v.hands}  # fmt: skip
                write_clip(out / folder / f"{gesture}_{number:02d}.usdc", rig,
                           f"../characters/{name}.usdc", motion, RATE, about)  # fmt: skip


def make_conversations(out: Path) -> None:
    """Longer scenes, each with and without finger motion."""
    for title, name, seconds, seed in TALKS:
        rig = RIGS[name]()
        # Only ben shifts his weight: his clips have a moving root and moving legs.
        sway = 1.2 if name == "ben" else 0.0
        score, length = conversation(rig.body, seconds, seed, sway)
        pose = perform(rig.body, score, frames(length))
        body = arms_and_trunk(rig)
        if sway:
            body += [j for j in rig.joints if j[2:] in ("thigh", "shin", "foot")]
        for kind, joints in (("body", body), ("full", [*body, *finger_joints(rig)])):
            about = {"label": "conversation", "actor": name, "fingers": kind == "full"}
            motion = sample(rig, pose, joints)
            write_clip(out / f"conversations/{title}_{kind}.usdc", rig,
                       f"../characters/{name}.usdc", motion, RATE, about)  # fmt: skip


def make_hands(out: Path) -> None:
    """Parts of the first conversation, as if filmed again with hands only."""
    _, name, seconds, seed = TALKS[0]
    whole = RIGS[name]()
    score, _ = conversation(whole.body, seconds, seed)
    for number, excerpt in enumerate(EXCERPTS):
        rig = only_hands(whole, excerpt.sides)
        pose = hands_take(whole.body, score, excerpt, seed + 1000 + number, HANDS_RATE)
        joints = [j for j in rig.joints if not j.endswith("4")]
        about = {"label": "hands", "actor": name, "of": TALKS[0][0], "start": excerpt.start,
                 "end": excerpt.end}  # fmt: skip
        character = "ada_hands" if excerpt.sides == "LR" else "ada_hand_right"
        write_clip(out / f"hands/{excerpt.name}.usdc", rig, f"../characters/{character}.usdc",
                   sample(rig, pose, joints), HANDS_RATE, about)  # fmt: skip


STEPS = {
    "characters": make_characters,
    "gestures": make_gestures,
    "conversations": make_conversations,
    "hands": make_hands,
}


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--output", type=Path, default=Path(__file__).parent, metavar="DIR")
    parser.add_argument("--only", choices=STEPS, action="append", help="make only these")
    options = parser.parse_args(arguments)
    for name, step in STEPS.items():
        if options.only and name not in options.only:
            continue
        began = time.perf_counter()
        step(options.output)
        print(f"{name}: {time.perf_counter() - began:.1f} s", file=sys.stderr)
    return 0


if __name__ == "__main__":
    sys.exit(main())
