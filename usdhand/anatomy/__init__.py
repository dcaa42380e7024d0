"""Hands: their joints, channels, and where to find them on a rig."""

from usdhand.anatomy.channels import Channels, Hands, decode, encode
from usdhand.anatomy.conventions import Conventions, load_conventions
from usdhand.anatomy.fingertips import fingertips
from usdhand.anatomy.frames import HandFrames, hand_frames
from usdhand.anatomy.hand import DIGITS, HAND_JOINTS, SIDES, CharacterMap, HandMap, Side
from usdhand.anatomy.mapping import map_character

__all__ = [
    "DIGITS",
    "HAND_JOINTS",
    "SIDES",
    "Channels",
    "CharacterMap",
    "Conventions",
    "HandFrames",
    "HandMap",
    "Hands",
    "Side",
    "decode",
    "encode",
    "fingertips",
    "hand_frames",
    "load_conventions",
    "map_character",
]
