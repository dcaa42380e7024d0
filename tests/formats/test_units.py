"""Units that BVH files do not say: told by names, by a body's size, by a hand's size."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from usdhand.formats.guess import CMU_CM, guess_units

CMU = ("Hips", "LHipJoint", "LeftLeg", "RHipJoint", "RightLeg", "LowerBack", "LeftHand")


def hand(names: Callable[[int, int], str] = lambda d, i: f"Hand{d}_{i}"):  # type: ignore[no-untyped-def]
    """A hand of 18 cm from wrist to tip: offsets, parents, names."""
    offsets, parents, found = [np.zeros(3)], [-1], ["Wrist"]
    for digit in range(5):
        parent = 0
        for i, length in enumerate((9.0, 4.0, 3.0, 2.0)):
            offsets.append(np.array([length, 0.0, 0.0]))
            parents.append(parent)
            found.append(names(digit, i))
            parent = len(parents) - 1
    return np.array(offsets), np.array(parents), found


@pytest.mark.parametrize("reach", [15.0, 20.0, 26.0, 40.0, 60.0])
def test_skeletons_of_the_cmu_library_have_one_scale(reach: float) -> None:
    parents = np.array([-1, 0, 1, 0, 3, 0, 5])
    offsets = np.zeros((7, 3))
    offsets[1:, 1] = reach / 2
    cm, problem = guess_units(offsets, parents, CMU)
    assert cm == CMU_CM
    assert problem.severity == "note"


@pytest.mark.parametrize(
    ("cm", "severity"),
    [(1.0, "note"), (0.1, "note"), (100.0, "note"), (2.54, "warning"), (10.0, "warning")],
)
@pytest.mark.parametrize("size", [0.8, 1.0, 1.2])
def test_hands_alone_are_as_long_as_hands(cm: float, severity: str, size: float) -> None:
    offsets, parents, names = hand()
    found, problem = guess_units(size * offsets / cm, parents, names)
    assert found == cm
    assert problem.severity == severity


def test_an_arm_is_no_hand_alone() -> None:
    offsets, parents, names = hand()
    names[0] = "ForeArm"
    cm, _ = guess_units(offsets * 3, parents, names)
    assert cm == 1.0
