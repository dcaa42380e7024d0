"""Inputs that same_results.py makes for its commands: odd figures, damaged files, tables."""

from __future__ import annotations

import shutil
import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from pxr import Sdf, Usd, UsdGeom, UsdSkel, Vt
from scipy.spatial.transform import Rotation

sys.path.insert(0, str(Path(__file__).resolve().parent.parent / "tests"))

from builders.fbx_files import Node, write_fbx

ODD_HAND = {
    "wrist": "Hand", "elbow": "ForeArm", "shoulder": "Arm",
    "ThumbCMC": "HandThumb1", "ThumbMCP": "HandThumb2", "ThumbIP": "HandThumb3",
    "IndexMCP": "HandIndex1", "IndexPIP": "HandIndex2", "IndexDIP": "HandIndex3",
    "MiddleMCP": "HandMiddle1", "MiddlePIP": "HandMiddle2", "MiddleDIP": "HandMiddle3",
}  # fmt: skip


@dataclass(frozen=True)
class Figure:
    """A moving skeleton in centimetres, Y up.

    ``bind`` and ``rest`` are (joints, 4, 4) as USD writes them, ``rotations`` (frames, joints, 4)
    as x, y, z, w, ``translations`` and ``scales`` (frames, joints, 3).
    """

    joints: tuple[str, ...]
    bind: np.ndarray
    rest: np.ndarray
    rotations: np.ndarray
    translations: np.ndarray
    scales: np.ndarray
    times: tuple[float, ...]

    @classmethod
    def read(cls, path: Path) -> Figure:
        """The sample at a path, joints without motion at rest."""
        stage = Usd.Stage.Open(str(path))
        prims = list(stage.Traverse())
        skeleton = next(UsdSkel.Skeleton(p) for p in prims if p.IsA(UsdSkel.Skeleton))
        motion = next(UsdSkel.Animation(p) for p in prims if p.IsA(UsdSkel.Animation))
        joints = tuple(skeleton.GetJointsAttr().Get())
        rest = np.array(skeleton.GetRestTransformsAttr().Get())
        times = tuple(motion.GetRotationsAttr().GetTimeSamples())
        at = [joints.index(joint) for joint in motion.GetJointsAttr().Get()]
        turns = Rotation.from_matrix(np.swapaxes(rest[:, :3, :3], 1, 2)).as_quat()
        rotations, places = (np.tile(v, (len(times), 1, 1)) for v in (turns, rest[:, 3, :3]))
        for i, time in enumerate(times):
            rotations[i, at] = np.array(motion.GetRotationsAttr().Get(time))
            places[i, at] = np.array(motion.GetTranslationsAttr().Get(time))
        bind = np.array(skeleton.GetBindTransformsAttr().Get())
        return cls(joints, bind, rest, rotations, places, np.ones_like(places), times)

    @property
    def names(self) -> list[str]:
        """The joints' own names."""
        return [joint.rpartition("/")[2] for joint in self.joints]

    @property
    def parents(self) -> list[int]:
        """The parent's index by joint, -1 for a root."""
        above = [joint.rpartition("/")[0] for joint in self.joints]
        return [self.joints.index(path) if path else -1 for path in above]

    def without(self, gone: Callable[[str], bool], frames: int) -> Figure:
        """Without the joints whose path says so, the first frames only."""
        keep = [j for j, joint in enumerate(self.joints) if not gone(joint)]
        moving = (self.rotations, self.translations, self.scales)
        return Figure(
            tuple(self.joints[j] for j in keep),
            self.bind[keep],
            self.rest[keep],
            *(values[:frames, keep] for values in moving),
            self.times[:frames],
        )

    def called(self, new: Callable[[str], str]) -> Figure:
        """With other names."""
        joints = ("/".join(map(new, joint.split("/"))) for joint in self.joints)
        return replace(self, joints=tuple(joints))

    def beside(self, other: Figure) -> Figure:
        """Both as one skeleton."""
        arrays = ("bind", "rest"), ("rotations", "translations", "scales")
        return Figure(self.joints + other.joints, *(
            np.concatenate([getattr(self, name), getattr(other, name)], axis=axis)
            for axis, names in enumerate(arrays) for name in names), self.times)  # fmt: skip

    def write(self, path: Path) -> None:
        """Write a UsdSkel character without a mesh."""
        stage = Usd.Stage.CreateNew(str(path))
        UsdGeom.SetStageUpAxis(stage, "Y")
        UsdGeom.SetStageMetersPerUnit(stage, 0.01)
        stage.SetTimeCodesPerSecond(30)
        stage.SetFramesPerSecond(30)
        stage.SetStartTimeCode(self.times[0])
        stage.SetEndTimeCode(self.times[-1])
        stage.SetDefaultPrim(UsdSkel.Root.Define(stage, "/Hero").GetPrim())
        skeleton = UsdSkel.Skeleton.Define(stage, "/Hero/Skel")
        skeleton.CreateJointsAttr(self.joints)
        skeleton.CreateBindTransformsAttr(Vt.Matrix4dArray.FromNumpy(self.bind))
        skeleton.CreateRestTransformsAttr(Vt.Matrix4dArray.FromNumpy(self.rest))
        motion = UsdSkel.Animation.Define(stage, "/Hero/Anim")
        motion.CreateJointsAttr(self.joints)
        turns, places, sizes = (
            create()
            for create in (motion.CreateRotationsAttr, motion.CreateTranslationsAttr,
                           motion.CreateScalesAttr)
        )  # fmt: skip
        for i, time in enumerate(self.times):
            turns.Set(Vt.QuatfArray.FromNumpy(self.rotations[i].astype(np.float32)), time)
            places.Set(Vt.Vec3fArray.FromNumpy(self.translations[i].astype(np.float32)), time)
        sizes.Set(Vt.Vec3hArray.FromNumpy(self.scales[0].astype(np.float16)))
        binding = UsdSkel.BindingAPI.Apply(skeleton.GetPrim())
        binding.CreateAnimationSourceRel().SetTargets([motion.GetPath()])
        stage.Save()


def make(samples: Path, folder: Path) -> None:
    """Make all inputs in a folder."""
    folder.mkdir(parents=True)
    gesture = samples / "gestures" / "ok_01.usdc"
    ok, talk = Figure.read(gesture), Figure.read(samples / "conversations" / "talk_01_body.usdc")
    bare = talk.without(lambda joint: "Hand/" in joint, 240)
    bare.write(folder / "bare.usda")
    _mirrored(bare).write(folder / "mirrored.usda")
    ok.without(lambda joint: "Shoulder" in joint, 20).write(folder / "no_hand.usda")
    odd = {name: f"j{i:03}" for i, name in enumerate(ok.names)}
    ok.called(odd.__getitem__).write(folder / "odd_names.usda")
    (folder / "odd.toml").write_text(_odd_map(odd))
    ok.beside(ok.called(lambda n: "Extra" if n == "Hips" else n)).write(folder / "two_hands.usda")
    _edited(ok, folder / "late_scale.usda", _late_scale)
    _edited(ok, folder / "not_a_number.usda", lambda stage: _one_rotation(stage, np.nan))
    _edited(ok, folder / "zero.usda", lambda stage: _one_rotation(stage, 0.0))
    _two_skeletons(samples, folder / "two_skeletons.usda")
    stage = Usd.Stage.CreateNew(str(folder / "no_skeleton.usda"))
    UsdGeom.Xform.Define(stage, "/Set")
    stage.Save()
    _fbx(ok, folder / "signs.fbx", {"FrontAxisSign": -1, "CoordAxisSign": -1})
    _fbx(ok, folder / "sides.fbx", {"CoordAxisSign": -1})
    (folder / "two.bvh").write_text(_bvh([ok, ok.called(lambda n: "Second" if n == "Hips" else n)]))
    _damaged(gesture, folder)
    (folder / "wrong.toml").write_text("[left\nwrist = 3\n")
    rows = ("file,label,actor", "ok_01.usdc,fine,eve", "wipe_02.usdc,clean,", "none.usdc,none,eve")
    (folder / "labels.csv").write_text("\n".join(rows))
    (folder / "wrong.csv").write_text("name;kind\nok_01;fine\n")


def edit_rig(rig: Path, output: Path) -> None:
    """Give three free channels of a rig two keys instead of a curve, as a person would."""
    layer = Sdf.Layer.OpenAsAnonymous(str(rig))
    curves: list[Sdf.Path] = []

    def collect(path: Sdf.Path) -> None:
        if str(path).endswith(":value") and layer.GetNumTimeSamplesForPath(path):
            curves.append(path)

    layer.Traverse(Sdf.Path.absoluteRootPath, collect)
    for path in sorted(curves)[:3]:
        times = layer.ListTimeSamplesForPath(path)
        for time in times:
            layer.EraseTimeSample(path, time)
        layer.SetTimeSample(path, times[0], 10.0)
        layer.SetTimeSample(path, times[-1], 20.0)
    layer.Export(str(output))


def copy(source: Path, target: Path) -> None:
    """Copy a file, for steps that change one in place."""
    shutil.copyfile(source, target)


def _odd_map(names: Mapping[str, str]) -> str:
    lines = []
    for side in ("Left", "Right"):
        lines.append(f"[{side.lower()}]")
        lines += [f'{role} = "{names[side + own]}"' for role, own in ODD_HAND.items()]
    return "\n".join(lines)


def _edited(figure: Figure, path: Path, change: Callable[[Usd.Stage], object]) -> None:
    figure.write(path)
    stage = Usd.Stage.Open(str(path))
    change(stage)
    stage.Save()


def _late_scale(stage: Usd.Stage) -> None:
    scales = UsdSkel.Animation.Get(stage, "/Hero/Anim").GetScalesAttr()
    value = scales.Get()
    scales.Clear()
    scales.Set(value, -1000.0)


def _one_rotation(stage: Usd.Stage, value: float) -> None:
    rotations = UsdSkel.Animation.Get(stage, "/Hero/Anim").GetRotationsAttr()
    row = np.array(rotations.Get(5.0))
    row[7] = value
    rotations.Set(Vt.QuatfArray.FromNumpy(row), 5.0)


def _two_skeletons(samples: Path, path: Path) -> None:
    stage = Usd.Stage.CreateNew(str(path))
    for name, folder in (("Ada", "gestures"), ("Ben", "gestures_ben")):
        prim = stage.DefinePrim(f"/{name}")
        place = Path("..") / samples.name / folder / "ok_01.usdc"
        prim.GetReferences().AddReference(place.as_posix())
    stage.SetTimeCodesPerSecond(30)
    stage.Save()


def _mirrored(figure: Figure) -> Figure:
    """The left wrist mirrored, as rigs are whose left arm is the right one scaled by -1."""
    wrist = figure.names.index("LeftHand")
    mirror = np.diag([-1.0, 1.0, 1.0, 1.0])
    made = replace(figure, bind=figure.bind.copy(), rest=figure.rest.copy(),
                   scales=figure.scales.copy())  # fmt: skip
    made.bind[wrist] = mirror @ figure.bind[wrist]
    made.rest[wrist] = mirror @ figure.rest[wrist]
    made.scales[:, wrist, 0] = -1.0
    return made


def _angles(figure: Figure, order: str) -> np.ndarray:
    frames, joints = figure.rotations.shape[:2]
    turns = Rotation.from_quat(figure.rotations.reshape(-1, 4)).as_euler(order, degrees=True)
    unwrapped = np.unwrap(turns.reshape(frames, joints, 3), axis=0, period=360.0)
    return np.asarray(unwrapped)


def _fbx(figure: Figure, path: Path, signs: Mapping[str, float]) -> None:
    """The figure as FBX, in a scene some of whose axes point the other way."""
    angles, seconds = _angles(figure, "xyz"), np.arange(len(figure.times)) / 30.0
    nodes = []
    for j, (name, parent) in enumerate(zip(figure.names, figure.parents, strict=True)):
        keys = {("Lcl Rotation", axis): list(zip(seconds, angles[:, j, i], strict=True))
                for i, axis in enumerate("XYZ")}  # fmt: skip
        place = tuple(figure.translations[0, j])
        nodes.append(Node(name, parent, vectors={"Lcl Translation": place}, keys=keys))
    write_fbx(path, nodes, takes={"Take 001": (0.0, seconds[-1])}, settings=signs)


def _bvh(figures: Sequence[Figure]) -> str:
    """Several figures as the ROOTs of one file."""
    lines, columns = ["HIERARCHY"], []
    for figure in figures:
        angles = _angles(figure, "ZXY")
        parents = figure.parents

        def joint(j: int, depth: int, figure: Figure = figure, angles: np.ndarray = angles,
                  parents: list[int] = parents) -> None:  # fmt: skip
            root, pad = parents[j] < 0, "  " * depth
            lines.extend([
                f"{pad}{'ROOT' if root else 'JOINT'} {figure.names[j]}", f"{pad}{{",
                f"{pad}  OFFSET {_row(figure.translations[0, j])}",
                f"{pad}  CHANNELS {'6 Xposition Yposition Zposition' if root else '3'} "
                "Zrotation Xrotation Yrotation",
            ])  # fmt: skip
            columns.extend([figure.translations[:, j]] if root else [])
            columns.append(angles[:, j])
            below = [k for k, parent in enumerate(parents) if parent == j]
            for k in below:
                joint(k, depth + 1)
            if not below:
                lines.extend([f"{pad}  End Site", f"{pad}  {{", f"{pad}    OFFSET 2 0 0",
                              f"{pad}  }}"])  # fmt: skip
            lines.append(f"{pad}}}")

        for j in range(len(parents)):
            if parents[j] < 0:
                joint(j, 0)
    table = np.concatenate(columns, axis=1)
    lines += ["MOTION", f"Frames: {len(table)}", "Frame Time: 0.0333333", *map(_row, table)]
    return "\n".join(lines) + "\n"


def _row(numbers: np.ndarray) -> str:
    return " ".join(f"{number:.6f}" for number in numbers)


def _damaged(gesture: Path, folder: Path) -> None:
    (folder / "text.usda").write_text("this is no usd file\n")
    (folder / "empty.usdc").touch()
    (folder / "suffix.mov").write_bytes(gesture.read_bytes())
    (folder / "cut.usdc").write_bytes(gesture.read_bytes()[:-400])
    (folder / "cut.glb").write_bytes(b"glTF\x02\x00\x00\x00\x00\x10\x00\x00")
    for name, whole in (("cut.bvh", "two.bvh"), ("cut.fbx", "signs.fbx")):
        text = (folder / whole).read_text()
        (folder / name).write_text(text[: len(text) // 2])
