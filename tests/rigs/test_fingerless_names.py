"""Bodies that end at the wrist, in names of all kinds: fingers on both sides, with legal names."""

from __future__ import annotations

import pytest
from builders.rigs import build, known_rigs

from usdhand.anatomy.hand import SIDES
from usdhand.formats.usd.names import legal_name
from usdhand.rigs.conventions import load_conventions
from usdhand.rigs.fingerless import finger_names, fingerless_arms

BODY = {k: n for k, n in known_rigs()["humanik"].items() if k[0] is None}
ARM = {"clavicle": "Shoulder", "shoulder": "Arm", "elbow": "ForeArm", "wrist": "Hand"}


@pytest.mark.parametrize(
    "pattern",
    ["{Side}{Name}", "{Name}{Side}", "m{Name}{Side}", "{Name}_{S}", "{Name}.{S}", "{s}_{Name}",
     "Rig {Name} {Side}"],
)  # fmt: skip
@pytest.mark.parametrize("below", [0, 1, 3, 4])
def test_both_arms_are_found(pattern: str, below: int) -> None:
    """With nothing below the wrist, a mitten, or one chain that is called a finger."""
    named = dict(BODY)
    roles = ("IndexMCP", "IndexPIP", "IndexDIP", "IndexTip")[:below]
    for side in SIDES:
        spelled = {**ARM, **{role: f"HandIndex{i}" for i, role in enumerate(roles, 1)}}
        for role, name in spelled.items():
            words = {"Side": side.title(), "Name": name, "S": side[0].upper(), "s": side[0]}
            named[side, role] = pattern.format(**words)
    skeleton, expected = build(named)
    arms = fingerless_arms(skeleton)
    assert arms is not None
    assert set(arms.character.hands) == set(SIDES)
    for side, hand in arms.character.hands.items():
        for role in ARM:
            assert getattr(hand, role) == expected[side, role]
        names = finger_names(skeleton, arms, side, ["IndexMCP", "ThumbCMC"], load_conventions())
        assert all(name == legal_name(name) for name in names.values()), names
        assert not set(names.values()) & set(skeleton.names)
