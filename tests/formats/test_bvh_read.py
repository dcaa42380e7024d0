"""BVH files in all their forms are read as they are meant, or refused at the line that is wrong."""

from __future__ import annotations

from io import BytesIO
from pathlib import Path

import numpy as np
import pytest
from builders.bvh_files import ARM, edited, plain_positions, written
from hypothesis import given, settings
from hypothesis import strategies as st

from usdhand.errors import InputError, UsageError
from usdhand.formats.bvh.numbers import RowError, compiled_rows, plain_rows
from usdhand.formats.bvh.read import animation_names, read_character, read_clip
from usdhand.formats.reading import Reading
from usdhand.motion import Clip, forward_kinematics
from usdhand.motion import rotations as rot

NEAR_CM = 0.001  # 0.01 mm
CHANNELS = "CHANNELS 3 Zrotation Xrotation Yrotation\n    JOINT"


def positions(clip: Clip) -> np.ndarray:
    return forward_kinematics(clip).positions


def as_is(path: Path) -> Clip:
    return read_clip(path, Reading(up="Y", cm_per_unit=1.0))


def codes(clip: Clip) -> set[str]:
    return {problem.code for problem in clip.problems}


# --- grammar -------------------------------------------------------------------------------------


def test_the_arm_is_read(tmp_path: Path) -> None:
    path = written(tmp_path, ARM)
    clip = as_is(path)
    assert clip.skeleton.joints == (
        "Hips", "Hips/Arm", "Hips/Arm/Hand", "Hips/Arm/Hand/Hand_End",
    )  # fmt: skip
    assert np.allclose(positions(clip), plain_positions(path, [0, 1, 2]))
    assert np.allclose(clip.skeleton.bind_positions[3], [68, 130, 0])
    assert (len(clip), clip.fps, clip.name) == (3, 30.0, "take")
    assert clip.origin.path == path
    assert animation_names(path) == (clip.origin.animation_path,) == ("take",)


@pytest.mark.parametrize(
    "changes",
    [
        [("\n", "\r\n")],
        [("\n", "\r")],
        [("  ", "\t")],
        [("  ", "")],
        [("\n", "   \n\n  ")],
        [("{", " {  ")],
        [("\n{", " {"), ("\n  {", " {")],
        [("OFFSET", "Offset"), ("ROOT", "root"), ("JOINT", "Joint"), ("End Site", "END SITE")],
        [("position", "POSITION"), ("MOTION", "Motion"), ("Frames:", "FRAMES:")],
        [("Frame Time: ", "Frame Time:\t")],
        [("Frames: 3", "Frames:3")],
        [("HIERARCHY", "# made by a program\nHIERARCHY"), ("MOTION", "// moves\nMOTION")],
        [("1 92 0", "# frame 2\n1 92 0")],
        [("11 21 31", "11 21 31\n")],
        [("0 91 0", "0.0e0 9.1E+1 -0")],
        [("40 50 60", "4e1 +50. 600e-1")],
        [("End Site", "End Site Tip")],
    ],
    ids=lambda changes: repr(changes)[2:40],
)
def test_forms_that_mean_the_same(tmp_path: Path, changes: list[tuple[str, str]]) -> None:
    clip, plain = as_is(edited(tmp_path, *changes)), as_is(written(tmp_path, ARM, "plain.bvh"))
    assert clip.skeleton.joints == plain.skeleton.joints
    assert np.allclose(positions(clip), positions(plain), atol=1e-9)
    assert len(clip) == 3


@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig", "latin-1"])
def test_names_are_kept(tmp_path: Path, encoding: str) -> None:
    text = ARM.replace("Hips", "rig:Hüfte 1").replace("JOINT Hand", "JOINT L/Hand #2")
    clip = as_is(written(tmp_path, text.encode(encoding)))
    assert clip.skeleton.names == ("rig:Hüfte 1", "Arm", "L_Hand #2", "L_Hand #2_End")


def test_siblings_of_one_name_are_told_apart(tmp_path: Path) -> None:
    end = "      End Site\n      {\n        OFFSET 8 0 0\n      }\n"
    clip = as_is(edited(tmp_path, (end, end * 3)))
    assert clip.skeleton.names[3:] == ("Hand_End", "Hand_End_2", "Hand_End_3")


def test_an_end_on_its_joint_says_nothing(tmp_path: Path) -> None:
    assert as_is(edited(tmp_path, ("OFFSET 8 0 0", "OFFSET 0 0 0"))).skeleton.names[-1] == "Hand"


@pytest.mark.parametrize(
    "order",
    ["Zrotation Yrotation Xrotation", "Xrotation Yrotation Zrotation", "Yrotation Zrotation",
     "Xrotation", "Zrotation Xrotation Zrotation", "Zrotation Zposition Xrotation",
     "Yposition Xrotation Yrotation Zrotation Xposition Zposition", ""],
)  # fmt: skip
def test_every_order_of_channels(tmp_path: Path, order: str) -> None:
    count = len(order.split())
    rows = [" ".join(str(v + f) for v in range(5, 5 + count)) for f in range(3)]
    changes = [(CHANNELS, f"CHANNELS {count} {order}\n    JOINT")]
    changes += [(f"{40 + f} {50 + f} {60 + f}", rows[f]) for f in range(3)]
    path = edited(tmp_path, *changes)
    assert np.allclose(positions(as_is(path)), plain_positions(path, [0, 1, 2]))


def test_scale_channels_are_left_out_and_said(tmp_path: Path) -> None:
    changes = [(CHANNELS, f"CHANNELS 6 Xscale Yscale Zscale {CHANNELS[11:]}")]
    changes += [
        (f"{40 + f} {50 + f} {60 + f}", f"1 1 1 {40 + f} {50 + f} {60 + f}") for f in (0, 1, 2)
    ]
    clip, plain = as_is(edited(tmp_path, *changes)), as_is(written(tmp_path, ARM, "plain.bvh"))
    assert np.allclose(positions(clip), positions(plain))
    assert "scale-channels" in codes(clip)


def test_several_roots(tmp_path: Path) -> None:
    root = ARM[ARM.index("ROOT") : ARM.index("MOTION")]
    changes = [("MOTION", root.replace("Hips", "Prop") + "MOTION")]
    rows = ["0 91 0 10 20 30 40 50 60 1 2 3", "1 92 0 11 21 31 41 51 61 4 5 6",
            "2 93 0 12 22 32 42 52 62 7 8 9"]  # fmt: skip
    path = edited(tmp_path, *changes, *((row, f"{row} {row[:-1]}1") for row in rows))
    both, prop = as_is(path), read_clip(path, Reading(skel="Prop", up="Y", cm_per_unit=1.0))
    assert list(np.flatnonzero(both.skeleton.parents < 0)) == [0, 4]
    assert np.allclose(positions(both), plain_positions(path, [0, 1, 2]))
    assert prop.skeleton.joints[:2] == ("Prop", "Prop/Arm")
    assert np.allclose(positions(prop), positions(both)[:, 4:])
    with pytest.raises(UsageError, match="no ROOT 'Hat'; it has Hips, Prop"):
        read_clip(path, Reading(skel="Hat"))


def test_units_and_axes_as_told(tmp_path: Path) -> None:
    path = written(tmp_path, ARM)
    told = read_clip(path, Reading(cm_per_unit=2.5, up="Z"))
    plain = plain_positions(path, [0, 1, 2]) * 2.5
    turned = np.stack([plain[..., 0], plain[..., 2], -plain[..., 1]], axis=-1)
    assert np.allclose(positions(told), turned)
    assert (told.origin.cm_per_unit, told.origin.up_axis) == (2.5, "Z")
    assert not codes(told) & {"guessed-units", "guessed-up-axis"}
    away = rot.multiply(
        told.rotations[0, 0], rot.conjugate(rot.from_matrix(told.skeleton.bind_rotations[0]))
    )
    file_away = as_is(path).rotations[0, 0]
    assert rot.angle_between(away, rot.IDENTITY) == pytest.approx(
        rot.angle_between(file_away, rot.IDENTITY)
    )


def test_positions_that_seem_to_be_added_are_said(tmp_path: Path) -> None:
    assert "near-zero-positions" not in codes(as_is(written(tmp_path, ARM)))
    changes = [(" 91 0", " 1 0"), (" 92 0", " 2 0"), (" 93 0", " 3 0")]
    assert "near-zero-positions" in codes(as_is(edited(tmp_path, *changes)))


def test_the_pose_of_a_file_without_motion(tmp_path: Path) -> None:
    path = written(tmp_path, ARM[: ARM.index("Frames")] + "Frames: 0\nFrame Time: 0.02\n")
    still = read_character(path, Reading(cm_per_unit=1.0))
    assert len(still) == 1
    assert np.allclose(positions(still)[0], still.skeleton.bind_positions)
    with pytest.raises(InputError, match="no motion"):
        read_clip(path)


# --- refused -------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("changes", "line", "what"),
    [
        ([("HIERARCHY", "<html>")], 1, "not a BVH file"),
        ([("OFFSET 10 40 0", "OFFSET 10 40")], 9, "'CHANNELS' is not a usable number"),
        ([("OFFSET 10 40 0", "OFFSET 10 nan 0")], 8, "'nan' is not a usable number"),
        ([("    OFFSET 10 40 0\n", "")], 18, "has no OFFSET"),
        ([("Xposition", "Xpos")], 5, "'Xpos' is not a channel"),
        ([("Yposition", "Xposition")], 5, "twice"),
        ([("CHANNELS 6", "CHANNELS 1e9")], 5, "not plausible"),
        ([("CHANNELS 6", "CHANNELS 7")], 6, "is not a channel"),
        ([("JOINT Arm", "ROOT Arm")], 6, "ROOT inside"),
        ([("JOINT Arm", "JOINT")], 6, "no name"),
        ([("JOINT Arm\n  {", "JOINT Arm")], 7, "no brace"),
        ([("}\nMOTION", "MOTION")], 20, "does not belong here"),
        ([("}\nMOTION", "}}\nMOTION")], 20, "does not belong here"),
        ([("Frames: 3", "Frames: many")], 22, "not a number of frames"),
        ([("Frames: 3", "Frames: -3")], 22, "not a number of frames"),
        ([("Frames: 3\n", "")], 21, "no 'Frames:'"),
        ([("Frame Time: 0.0333333\n", "")], 22, "no 'Frame Time:'"),
        ([("0.0333333", "0")], 23, "not a usable frame time"),
        ([("0.0333333", "nan")], 23, "not a usable frame time"),
        ([("0.0333333", "1e400")], 23, "not a usable frame time"),
        ([("11 21 31", "11 x 31")], 25, r"\(frame 2\): 'x'"),
        ([("11 21 31", "11 nan 31")], 25, r"\(frame 2\): 'nan'"),
        ([("11 21 31", "11 -inf 31")], 25, r"\(frame 2\): '-inf'"),
        ([("11 21 31", "11 1e999 31")], 25, r"\(frame 2\): '1e999'"),
        ([("11 21 31", "11 2_1 31")], 25, r"\(frame 2\): '2_1'"),
        ([("11 21 31", "11 21,5 31")], 25, r"\(frame 2\): '21,5'"),
        ([("11 21 31", "11 31")], 25, r"\(frame 2\): 23 numbers where there are 12"),
        ([("11 21 31", "11 21 31 31")], 25, r"\(frame 2\): 13 numbers"),
        ([(" 7 8 9\n", " 7 8")], 26, r"\(frame 3\): 11 numbers"),
        ([("2 93 0 12 22 32 42 52 62 7 8 9\n", "")], 25, "cut off after frame 2 of 3"),
        ([("Frames: 3", "Frames: 1000000000")], 26, "cut off after frame 3 of 1000000000"),
        ([("Frames: 3", "Frames: 3\nFrames: 3")], 22, "no 'Frame Time:'"),
    ],
    ids=lambda value: value if isinstance(value, str) else None,
)
def test_damage_is_refused_at_its_line(
    tmp_path: Path, changes: list[tuple[str, str]], line: int, what: str
) -> None:
    with pytest.raises(InputError, match=rf"take\.bvh, line {line}\b.*({what})"):
        read_clip(edited(tmp_path, *changes))


def test_rows_beyond_those_declared_are_read_and_said(tmp_path: Path) -> None:
    clip = as_is(edited(tmp_path, ("Frames: 3", "Frames: 2")))
    assert len(clip) == 3
    assert "more-frames" in codes(clip)


def test_missing_and_empty_files(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"none\.bvh: cannot be read"):
        read_clip(tmp_path / "none.bvh")
    with pytest.raises(InputError, match="line 1: this is not a BVH file"):
        read_clip(written(tmp_path, b""))
    with pytest.raises(UsageError, match="one animation, 'take'"):
        read_clip(written(tmp_path, ARM), Reading(animation="walk"))


def test_nothing_is_nested_too_deep_or_too_much(tmp_path: Path) -> None:
    joint = "JOINT a{OFFSET 0 1 0 CHANNELS 0 "
    for text in (
        "HIERARCHY ROOT a{OFFSET 0 0 0 " + joint * 1_000_000,
        "HIERARCHY ROOT a{OFFSET 0 0 0 " + (joint + "}") * 1_000_000,
    ):
        with pytest.raises(InputError, match="line 1: more than 10000 joints"):
            read_clip(written(tmp_path, text))


def test_few_channels_do_not_fill_the_memory(tmp_path: Path) -> None:
    ends = "End Site{OFFSET 0 1 0}" * 9000
    head = f"HIERARCHY ROOT a{{OFFSET 0 0 0 CHANNELS 1 Xrotation {ends}}} MOTION\n"
    text = head + "Frames: 100000\nFrame Time: 0.01\n" + "1\n" * 100_000
    with pytest.raises(InputError, match="not plausible"):
        read_clip(written(tmp_path, text))


# --- the two parsers of numbers ------------------------------------------------------------------

NUMBERS = st.one_of(
    st.floats(-1e9, 1e9, allow_nan=False).map(lambda v: f"{v:.6f}"),
    st.integers(-(10**9), 10**9).map(str),
    st.sampled_from(["-0", "+1.50", ".5", "5.", "000.100", "-.25", "0.1234567890123456"]),
)


def compiled(text: bytes, shape: tuple[int, int]) -> np.ndarray | None:
    return compiled_rows(BytesIO(text), shape)


@given(st.lists(st.lists(NUMBERS, min_size=3, max_size=3), min_size=1, max_size=9), st.booleans())
@settings(max_examples=60)
def test_both_parsers_read_the_same(rows: list[list[str]], crlf: bool) -> None:
    text = ("\r\n\r\n" if crlf else "\n").join(" ".join(row) for row in rows).encode()
    found = compiled(text, (len(rows), 3))
    assert found is not None
    plain = plain_rows(text, 0, 3)
    assert np.allclose(found, plain, rtol=3e-16, atol=0)
    assert np.array_equal(plain, [[float(word) for word in row] for row in rows])


@pytest.mark.parametrize(
    "text",
    ["1 2 3\n4 5\n", "1 2 3 4\n5 6\n", "1 2 3\n4 5 x\n", "1 2 3\n4 5 nan\n",
     "1 2 3\n4 5 6e2\n", "1 2 3\n4 5 6 7\n", "1 2 3\n4 5 6\n7 8 9\n", "1 2 3\n", "1 2 3\r4 5 6\r",
     "1 2 3\n4 5 9999999999\n", "1 2 3\n4 5 -\n", "1 2 3\n4 5 --6\n", "1 2 3\n4 5 6-7\n",
     "1 2 3\n4 5 1234567890123456789\n", "1 2 3\n4 5 6\n # 1\n", "1 2 3\n4 5 6.\x00\n"],
)  # fmt: skip
def test_the_compiled_parser_leaves_what_is_odd(text: str) -> None:
    assert compiled(text.encode(), (2, 3)) is None


def test_large_files_come_out_the_same(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    body = "\n".join(" ".join(f"{v:.4f}" for v in row) for row in wave(30_000))
    text = ARM[: ARM.index("Frames")] + f"Frames: 30000\nFrame Time: 0.01\n{body}\n"
    path = written(tmp_path, text)
    plain = as_is(path)
    monkeypatch.setattr("usdhand.formats.bvh.file.LARGE_ONCE_LOADED", 1_000_000)
    monkeypatch.setattr("usdhand.formats.bvh.file.LARGE", 1_000_000)
    fast = as_is(path)
    assert np.allclose(fast.rotations, plain.rotations, atol=1e-15)
    assert np.array_equal(fast.translations, plain.translations)
    cut = written(tmp_path, text[:-30])
    with pytest.raises(InputError, match=r"line 30023 \(frame 30000\): \d+ numbers"):
        read_clip(cut)


def wave(frames: int) -> np.ndarray:
    return 90.0 * np.sin(np.arange(frames)[:, None] / 50.0 + np.arange(12))


def test_a_row_error_knows_its_place() -> None:
    with pytest.raises(RowError) as caught:
        plain_rows(b"1 2\n3 x\n", 0, 2)
    assert (caught.value.place, caught.value.frame) == (6, 1)
