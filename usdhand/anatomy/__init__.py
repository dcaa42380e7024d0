"""What a hand is: digits, joints, channels, anatomical frames."""

from usdhand.anatomy.channels import Channels, Hands, decode, encode
from usdhand.anatomy.fingertips import fingertips
from usdhand.anatomy.frames import HandFrames, hand_frames
from usdhand.anatomy.hand import DIGITS, HAND_JOINTS, SIDES, CharacterMap, HandMap, Side

__all__ = [
    "DIGITS",
    "HAND_JOINTS",
    "SIDES",
    "Channels",
    "CharacterMap",
    "HandFrames",
    "HandMap",
    "Hands",
    "Side",
    "decode",
    "encode",
    "fingertips",
    "hand_frames",
]
