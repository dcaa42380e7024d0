"""What a hand is: five digits of three joints, and the channels that describe their rotation.

A channel is one rotation angle of one joint, named as in Joerg & O'Sullivan 2009: side, digit,
joint, axis, e.g. ``riRingDIPy``. Axis ``y`` of a finger is flexion, ``x`` abduction, ``z``
rotation about the bone; for the thumb ``z`` is flexion.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Literal

from usdhand.display import displayed
from usdhand.problems import Problem

Side = Literal["left", "right"]
SIDES: tuple[Side, ...] = ("left", "right")
DIGITS = ("Thumb", "Index", "Middle", "Ring", "Pinky")
FINGERS = DIGITS[1:]
SIDE_PREFIX: dict[Side, str] = {"left": "le", "right": "ri"}


def digit_joints(digit: str) -> tuple[str, str, str]:
    """Names of a digit's joints from the palm outwards."""
    return ("CMC", "MCP", "IP") if digit == "Thumb" else ("MCP", "PIP", "DIP")


# The fifteen joints of a hand, e.g. "ThumbCMC" ... "PinkyDIP".
HAND_JOINTS: tuple[str, ...] = tuple(d + j for d in DIGITS for j in digit_joints(d))

# Joints beyond the hand that the methods need, found where the rig has them.
BODY_JOINTS = ("hips", "chest", "neck", "head")
ARM_JOINTS = ("clavicle", "shoulder", "elbow", "wrist")


@displayed(
    lambda hand: {
        "side": hand.side,
        "wrist": hand.wrist,
        "joints": len(hand.joints),
        "missing": hand.missing,
    }
)
@dataclass(frozen=True)
class HandMap:
    """Which joints of a skeleton are which joints of one hand (indices into the skeleton).

    Attributes
    ----------
    side : "left" or "right"
    wrist : the joint whose rotation moves the palm
    joints : hand joint name ("IndexPIP") -> skeleton joint; a rig may lack some
    metacarpals : digit -> joint between wrist and MCP, where there is one
    tips : digit -> joint at the end of the digit, where there is one
    elbow, shoulder, clavicle : joints of the arm, None where there are none
    """

    side: Side
    wrist: int
    joints: Mapping[str, int]
    metacarpals: Mapping[str, int] = field(default_factory=dict)
    tips: Mapping[str, int] = field(default_factory=dict)
    elbow: int | None = None
    shoulder: int | None = None
    clavicle: int | None = None

    @property
    def digits(self) -> tuple[str, ...]:
        """Digits of which at least one joint is there."""
        return tuple(d for d in DIGITS if any(n.startswith(d) for n in self.joints))

    @property
    def missing(self) -> tuple[str, ...]:
        """Hand joints that this rig does not have."""
        return tuple(n for n in HAND_JOINTS if n not in self.joints)


@displayed(
    lambda character: {
        "convention": character.convention,
        "hands": tuple(character.hands),
        "notes": character.notes,
    }
)
@dataclass(frozen=True)
class CharacterMap:
    """The hands of a character and the body joints that go with them.

    ``convention`` names the rig convention that matched ("geometry" where names were unknown);
    ``pronation`` is what its thumbs have at the bind pose, in degrees, where that is known;
    ``notes`` say in words what was guessed, ``contradictions`` those of them where the bind pose
    says otherwise than names do; ``evidence`` says what each hand was found by.
    """

    hands: Mapping[Side, HandMap]
    convention: str
    hips: int | None = None
    chest: int | None = None
    neck: int | None = None
    head: int | None = None
    notes: tuple[str, ...] = ()
    contradictions: tuple[str, ...] = ()
    evidence: tuple[str, ...] = ()
    pronation: float | None = None

    @property
    def problems(self) -> tuple[Problem, ...]:
        """Warnings of the contradictions."""
        return tuple(Problem("misleading-name", message) for message in self.contradictions)

    def corrected(self, *contradictions: str) -> CharacterMap:
        """The map with more notes on names that the bind pose contradicts."""
        return replace(
            self,
            notes=(*self.notes, *contradictions),
            contradictions=(*self.contradictions, *contradictions),
        )
