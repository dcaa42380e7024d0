"""Real FBX takes: against Blender's own importer and against their USD versions."""

from __future__ import annotations

import re
import subprocess
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from builders.blender import blender_python
from builders.written_over import assert_shows, channels_scaled
from conftest import REPOSITORY, SHARED, shared_data

from usdhand import find_hands, read_clip, write_clip
from usdhand.formats.fbx import read
from usdhand.formats.reading import Reading
from usdhand.formats.usd import read as usd
from usdhand.motion import Clip, forward_kinematics
from usdhand.rigs import map_character

pytest.importorskip("ufbx", reason="no ufbx: pip install 'usdhand[convert]'")
pytestmark = pytest.mark.real_data
TOLERANCE_CM = 0.001  # 0.01 mm
Y_UP = np.array([[1.0, 0, 0], [0, 0, 1], [0, -1, 0]])  # Blender is Z up
FILES = sorted(path.relative_to(SHARED / "data") for path in (SHARED / "data").rglob("*.fbx"))
FILES = FILES or [Path("studiogalt", "fbx")]  # skipped, saying so
TAKES = [path for path in FILES if path.parts[0] == "studiogalt"]
# Two of the files hold more than one take.
FIRST = {"SG_ASL_10_Alt": "SG ASL 10 Animation", "SG_ASL_7_2023": "SG ASL 7 Animation"}


@cache
def clip_of(path: Path) -> Clip:
    names = [name for start, name in FIRST.items() if path.name.startswith(start)]
    several = len(read.animation_names(shared_data(*path.parts))) > 1
    return read.read_clip(
        shared_data(*path.parts), Reading(animation=names[0] if several else None)
    )


def below_scaled(clip: Clip) -> frozenset[int]:
    """Joints under one that is scaled at rest.

    A bone of Blender has no scale at rest, so that its importer and its USD files leave it out.
    """
    scaled = {int(j) for j in np.flatnonzero(np.abs(clip.scales[0] - 1.0).max(axis=1) > 0.01)}
    skeleton = clip.skeleton
    return frozenset(j for j in range(len(skeleton)) if scaled & set(skeleton.ancestors(j)))


def test_there_are_files() -> None:
    shared_data("studiogalt", "fbx")
    assert len(TAKES) >= 10


@pytest.mark.parametrize("path", FILES, ids=lambda path: path.stem)
def test_reads(path: Path) -> None:
    clip = clip_of(path)
    assert clip.skeleton.names[clip.skeleton.parents.tolist().index(-1)] != ""
    assert len(clip) > 30
    assert not [p for p in clip.problems if p.severity == "warning"]
    head = forward_kinematics(clip, [clip.skeleton.names.index("Head")]).positions
    assert 120.0 < head[..., 1].min() < head[..., 1].max() < 200.0
    character = read.read_character(shared_data(*path.parts))
    assert character.skeleton.joints == clip.skeleton.joints
    assert np.allclose(
        forward_kinematics(character).positions[0], clip.skeleton.bind_positions, atol=1e-6
    )


@pytest.mark.parametrize("path", TAKES, ids=lambda path: path.stem)
def test_agrees_with_the_usd_version(path: Path) -> None:
    clip = clip_of(path)
    [(name, size)] = re.findall(r"(.*)_No_Mesh_(Full|Mini)", path.stem)
    other = usd.read_clip(shared_data("studiogalt", size.lower(), name.replace("-", "_") + ".usdc"))
    assert clip.skeleton.joints == other.skeleton.joints
    assert (clip.fps, len(clip)) == (other.fps, len(other))
    ours, theirs = forward_kinematics(clip).positions, forward_kinematics(other).positions
    left_out = below_scaled(clip)
    scaled_eyes = (name, size) == ("SG_ASL_ABC_2023-2-3", "Full")
    ends = {"Eye_L_end", "Eye_R_end"} if scaled_eyes else set()
    assert {clip.skeleton.names[j] for j in left_out} == ends
    joints = [j for j in range(len(clip.skeleton)) if j not in left_out]
    assert np.abs(ours - theirs)[:, joints].max() < TOLERANCE_CM
    bind = clip.skeleton.bind_positions - other.skeleton.bind_positions
    assert np.abs(bind)[joints].max() < TOLERANCE_CM


@pytest.mark.parametrize("path", TAKES, ids=lambda path: path.stem)
def test_hands_are_found(path: Path) -> None:
    character = map_character(clip_of(path).skeleton)
    assert set(character.hands) == {"left", "right"}


@pytest.mark.parametrize("path", TAKES, ids=lambda path: path.stem)
def test_results_lie_over_what_was_read(path: Path, tmp_path: Path) -> None:
    take = clip_of(path).origin.animation_path
    clip = read_clip(shared_data(*path.parts), reading=Reading(animation=take))
    made, output = channels_scaled(clip, 0.5), tmp_path / "out.usdc"
    write_clip(made, output)
    left_out = below_scaled(clip)
    found = assert_shows(output, made, left_out)
    moving = {j for f in find_hands(clip).frames.values() for j in f.links.moving}
    skeleton = clip.skeleton
    lines = {j: {j, *skeleton.ancestors(j)} for j in range(len(skeleton)) if j not in left_out}
    still = [j for j, line in lines.items() if not moving & line]
    before, after = forward_kinematics(clip, still), forward_kinematics(found, still)
    assert np.abs(before.positions - after.positions).max() < TOLERANCE_CM


@pytest.mark.blender
@pytest.mark.parametrize("path", FILES, ids=lambda path: path.stem)
def test_agrees_with_blender(path: Path, tmp_path: Path) -> None:
    clip = clip_of(path)
    # One file has keys at every second frame; Blender's importer makes straight lines between keys.
    frames = np.unique(np.linspace(0, (len(clip) - 1) // 2, 6).astype(int)) * 2
    script, target = REPOSITORY / "tests" / "blender" / "fbx_dump.py", tmp_path / "blender.npz"
    arguments = [str(shared_data(*path.parts)), str(target), clip.origin.animation_path]
    done = subprocess.run(
        [blender_python(), str(script), *arguments, *map(str, frames)],
        capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    data = np.load(target)
    left_out = below_scaled(clip)
    joints = [j for j in range(len(clip.skeleton)) if j not in left_out]
    names = list(data["names"])
    theirs = data["positions"][:, [names.index(clip.skeleton.names[j]) for j in joints]] @ Y_UP.T
    ours = forward_kinematics(clip, joints).positions[frames]
    assert np.linalg.norm(ours - theirs, axis=-1).max() < TOLERANCE_CM
    assert np.ptp(ours, axis=0).max() > 5.0, "nothing moves"
