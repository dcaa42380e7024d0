"""What each joint of a hand is measured from, and which joints must be carried along with it.

In most rigs a joint hangs off the one before it in its digit. In flat ones, such as hand tracking
devices give, joints are side by side, and where each is says its translation.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

from usdhand.anatomy.hand import DIGITS, HandMap, digit_joints
from usdhand.errors import HandNotFoundError
from usdhand.motion import Skeleton

Link = tuple[int, int]  # a joint and the one that it is measured from


@dataclass(frozen=True)
class HandLinks:
    """How the joints of a hand hang together.

    Attributes
    ----------
    joints : all joints that move with the hand's channels and what each is measured from, so that
        whatever moves a joint comes before it
    followers : those that do not hang off what they are measured from, in the middle of a digit or
        all along it, so that they must be moved along with it
    """

    joints: tuple[Link, ...]
    followers: frozenset[int]

    @property
    def moving(self) -> tuple[int, ...]:
        """The joints alone, without what they are measured from."""
        return tuple(joint for joint, _ in self.joints)


def hand_links(skeleton: Skeleton, hand: HandMap) -> HandLinks:
    """Find what the joints of a hand are measured from.

    That is the parent; the wrist for a digit that as a whole does not hang off it; and in a flat
    digit the joint before it, the first one's metacarpal or the wrist.

    Raises
    ------
    HandNotFoundError
        if the joints of a flat rig hang off each other in another order than that of a hand.
    """
    palm: list[Link] = []
    joints: list[Link] = []
    ends: list[Link] = []
    followers: set[int] = set()

    def detached(joint: int, above: int) -> bool:
        return above not in skeleton.ancestors(joint)

    for digit in DIGITS:
        chain = [hand.joints[n] for n in _names(digit) if n in hand.joints]
        if not chain:
            continue
        first, flat = chain[0], any(detached(j, above) for above, j in pairwise(chain))
        base = hand.wrist
        if flat and digit in hand.metacarpals:
            base = hand.metacarpals[digit]
            if detached(base, hand.wrist):
                palm.append((base, hand.wrist))
        joints.append((first, base if detached(first, base) else int(skeleton.parents[first])))
        for above, j in pairwise(chain):
            joints.append((j, above if detached(j, above) else int(skeleton.parents[j])))
        if flat:
            followers |= {
                j for j, above in pairwise([*reversed(chain), base]) if detached(j, above)
            }
        tip = hand.tips.get(digit)
        if (
            tip is not None
            and detached(tip, chain[-1])
            and not _carries_others(skeleton, hand, tip)
        ):
            ends.append((tip, chain[-1]))
    links = (*palm, *joints, *ends)
    followers |= {j for j, _ in (*palm, *ends)}
    if followers:
        _check_order(skeleton, hand, links)
    return HandLinks(links, frozenset(followers))


def _names(digit: str) -> list[str]:
    return [digit + j for j in digit_joints(digit)]


def _carries_others(skeleton: Skeleton, hand: HandMap, tip: int) -> bool:
    """Whether other joints of the hand hang off a tip, so that it cannot follow a finger."""
    others = (hand.wrist, *hand.joints.values(), *hand.metacarpals.values(), *hand.tips.values())
    return any(tip in skeleton.ancestors(j) for j in others)


def _check_order(skeleton: Skeleton, hand: HandMap, links: tuple[Link, ...]) -> None:
    later = {joint for joint, _ in links}
    wrist = skeleton.ancestors(hand.wrist)
    for joint, reference in links:
        movers = {*skeleton.ancestors(joint), reference, *skeleton.ancestors(reference), *wrist}
        if skeleton.parents[joint] != reference and (wrong := later & movers):
            raise HandNotFoundError(
                f"Joint '{skeleton.joints[joint]}' of the {hand.side} hand moves with "
                f"'{skeleton.joints[min(wrong)]}', which should move with it. Name the hand's "
                "joints in a file and pass it with --map, or give them the hierarchy of a hand."
            )
        later.remove(joint)
