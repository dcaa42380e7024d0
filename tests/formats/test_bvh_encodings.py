"""BVH files of other encodings, and positions that are added to the OFFSETs."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from conftest import REPOSITORY

import usdhand
from usdhand.errors import InputError
from usdhand.formats.bvh.read import read_clip
from usdhand.formats.files import read_any
from usdhand.formats.reading import Reading

NAMES = {
    "cp932": "センター 上半身 首 左腕 左手首 左親指１ 右腕 右手首",
    "gb18030": "中心 上半身 颈 左臂 左手 左拇指1 右臂 右手",
    "euc_kr": "엉덩이 척추 목 왼팔 왼손 왼엄지1 오른팔 오른손",
    "cp1252": "Hanche Thorax Tête Épaule_gauche Poignée Main_gauche Épaule_droite Main_droite",
    "utf-8": "センター 上半身 首 左腕 左手首 左親指１ 右腕 右手首",
}


def chain(names: list[str], encoding: str) -> bytes:
    """A chain of joints 20 cm apart, one frame long."""
    lines, channels = ["HIERARCHY"], "CHANNELS 3 Zrotation Xrotation Yrotation"
    for i, name in enumerate(names):
        lines += ["JOINT " * (i > 0) + "ROOT " * (i == 0) + name, "{", "OFFSET 0 20 0", channels]
    lines += ["End Site", "{", "OFFSET 0 10 0", "}", *["}"] * len(names)]
    values = " ".join(["0"] * 3 * len(names))
    lines += ["MOTION", "Frames: 2", "Frame Time: 0.04", values, values]
    return "\n".join(lines).encode(encoding)


@pytest.mark.parametrize("encoding", NAMES)
def test_names_are_decoded_and_a_guess_is_told(encoding: str, tmp_path: Path) -> None:
    path, names = tmp_path / "in.bvh", NAMES[encoding].split()
    path.write_bytes(chain(names, encoding))
    clip = read_clip(path)
    assert list(clip.skeleton.names)[: len(names)] == names
    told = [p for p in clip.problems if p.code == "guessed-encoding"]
    assert len(told) == (encoding != "utf-8")
    assert all(p.severity == "warning" and any(map(p.message.__contains__, names)) for p in told)


def test_utf_16_is_refused_with_what_to_do(tmp_path: Path) -> None:
    path = tmp_path / "in.bvh"
    path.write_bytes(chain(["Hips", "Spine"], "utf-16"))
    with pytest.raises(InputError, match=r"UTF-16 text\. Save it as UTF-8"):
        read_clip(path)


def with_zero_positions(folder: Path) -> tuple[Path, Path]:
    """A sample as BVH, and the same with position channels of 0 on all inner joints."""
    plain, other = folder / "plain.bvh", folder / "zeros.bvh"
    usdhand.convert(REPOSITORY / "samples" / "gestures" / "ok_01.usdc", plain)
    head, motion = plain.read_text("utf-8").split("MOTION\n")
    inner = head.replace("CHANNELS 3 ", "CHANNELS 6 Xposition Yposition Zposition ")
    rows = motion.splitlines()
    zeros = []
    for row in (line.split() for line in rows[2:] if line):
        turns = [row[i : i + 3] for i in range(6, len(row), 3)]
        zeros.append(" ".join([*row[:6], *(v for t in turns for v in ("0", "0", "0", *t))]))
    other.write_text(f"{inner}MOTION\n" + "\n".join([*rows[:2], *zeros]) + "\n", "utf-8")
    return plain, other


def test_positions_of_zero_on_all_joints_are_additions(tmp_path: Path) -> None:
    plain, other = with_zero_positions(tmp_path)
    meant = read_any(plain)[0]
    for reading in (Reading(), Reading(positions="add")):
        found = read_any(other, reading=reading)[0]
        assert np.allclose(found.translations, meant.translations)
    [told] = [p for p in read_any(other)[0].problems if p.code == "near-zero-positions"]
    assert "--positions replace" in told.message
    replaced = read_clip(other, Reading(positions="replace", cm_per_unit=1.0, up="Y"))
    assert not replaced.translations[:, 1:].any()
    assert not [p for p in replaced.problems if p.code == "near-zero-positions"]
