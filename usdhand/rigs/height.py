"""How tall a character is, which is what motion of different bodies is scaled by."""

from __future__ import annotations

import numpy as np

from usdhand.anatomy.hand import CharacterMap, HandMap
from usdhand.motion.skeleton import Skeleton
from usdhand.motion.transforms import unit

REFERENCE_HEIGHT_CM = 170.0
SMALLEST_HEIGHT_CM = 1.0  # less is no body, but joints in one place
LEAST_STANDING = 0.5  # of the height that the arms tell: less, and the body does not stand
HEAD_TO_HEIGHT = 0.93  # lowest joint to the head joint, which lies at the top of the neck
ARM_TO_HEIGHT = 0.332  # shoulder to wrist
FOREARM_TO_ARM = 0.44
UPRIGHT = 0.7  # of the way from hips to head goes up where a body stands


def body_height(skeleton: Skeleton, character: CharacterMap) -> float:
    """Height of a character at its bind pose, cm.

    From the lowest joint to the head's, also of a body that lies; for what is no whole body, from
    the length of an arm (Winter, Biomechanics and Motor Control of Human Movement, 2009, figure
    4.1).
    """
    length = max(_arm_length(skeleton, h) for h in character.hands.values())
    height = length / ARM_TO_HEIGHT
    if character.head is not None and character.hips is not None:
        hips, head = character.hips, character.head
        body = [hips, *skeleton.descendants(hips)]
        places = skeleton.bind_positions
        back = unit(places[head] - places[hips])
        # Where the bind pose lies, the back tells which way is up.
        up = np.array([0.0, 1.0, 0.0]) if back[1] > UPRIGHT else back
        # Not to the highest joint: some rigs have eyes, hair or an end above the head joint.
        standing = float(((places[head] - places[body]) @ up).max()) / HEAD_TO_HEIGHT
        if standing > LEAST_STANDING * height:  # else it is curled up
            height = standing
    return height if height > SMALLEST_HEIGHT_CM else REFERENCE_HEIGHT_CM


def _arm_length(skeleton: Skeleton, hand: HandMap) -> float:
    chain = [j for j in (hand.shoulder, hand.elbow, hand.wrist) if j is not None]
    points = skeleton.bind_positions[chain]
    # Without a shoulder, the forearm stands for nearly half of the arm.
    share = 1.0 if hand.shoulder is not None else FOREARM_TO_ARM
    return float(np.linalg.norm(np.diff(points, axis=0), axis=1).sum()) / share
