"""The anatomical frames that a rig was fitted with, put on the hands of today."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

from usdhand.anatomy.channels import Hands
from usdhand.anatomy.frames import HandFrames
from usdhand.anatomy.hand import Side
from usdhand.motion.rotations import Array


@dataclass(frozen=True, eq=False)
class StoredFrames:
    """Anatomical frames as the rig has them: hand joints and quaternions (n, 4)."""

    names: tuple[str, ...]
    reference_frames: Array
    joint_frames: Array

    def on(self, frames: HandFrames) -> HandFrames:
        """Return these frames on a hand with the same joints, else the hand's own."""
        if self.names != frames.names:
            return frames
        return replace(
            frames, reference_frames=self.reference_frames, joint_frames=self.joint_frames
        )


def with_stored_frames(hands: Hands, stored: Mapping[Side, StoredFrames]) -> Hands:
    """Return hands with the frames that a rig was fitted with."""
    return replace(
        hands, frames={s: stored[s].on(f) if s in stored else f for s, f in hands.frames.items()}
    )
