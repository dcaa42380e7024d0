"""What messages advise to do works when it is done."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import pytest
from builders import stages
from builders.bare_bodies import bare, without
from builders.cli_runner import run
from builders.shared_work import SharedWork, few_gestures
from click.testing import CliRunner
from conftest import REPOSITORY
from pxr import Sdf, Usd, UsdSkel

import usdhand
from usdhand.cli.main import main
from usdhand.motion import Clip, Skeleton, parents_from_paths

SAMPLES = REPOSITORY / "samples"
OK, OTHER = (SAMPLES / "gestures" / f"ok_0{i}.usdc" for i in (1, 2))
BEN = SAMPLES / "gestures_ben" / "wipe_01.usdc"
BODY = SAMPLES / "conversations" / "talk_01_body.usdc"
HANDS = SAMPLES / "hands" / "talk_01_hands_a.usdc"

Arguments = tuple[object, ...]


@dataclass(frozen=True)
class Case:
    """A command that fails, words of its advice, and the command of a person who follows it.

    ``follow`` may also mend files; it gets the message.
    """

    arguments: Arguments
    advice: str
    follow: Callable[[str], Arguments]


def adding(arguments: Arguments, advice: str, *more: object) -> Case:
    """A case in which options are added."""
    return Case(arguments, advice, lambda _: (*arguments, *more))


def choosing(arguments: Arguments, option: str) -> Case:
    """A case in which the first of the skeletons that the message lists is chosen."""

    def follow(message: str) -> Arguments:
        first = re.split(r"[,\s]", message.split(f"{option}: ")[1].strip())[0]
        return (*arguments, option, first)

    return Case(arguments, f"choose one with {option}", follow)


def in_file(clip: Clip, path: Path) -> Path:
    usdhand.write_new(clip, path)
    return path


def two_on_a_stage(folder: Path) -> Path:
    path = folder / "two.usda"
    stage = Usd.Stage.CreateNew(str(path))
    for name in ("One", "Two"):
        stage.DefinePrim(f"/{name}", "SkelRoot").GetReferences().AddReference(str(OK))
    stage.SetTimeCodesPerSecond(30)
    stage.SetFramesPerSecond(30)
    stage.Save()
    return path


def an_output_that_exists(folder: Path) -> Case:
    (folder / "o.usda").write_text("#usda 1.0\n")
    return adding(("reduce", OK, "-o", folder / "o.usda"), "use --force", "--force")


def several_skeletons(folder: Path) -> Case:
    return choosing(("reduce", two_on_a_stage(folder), "-o", folder / "o.usda"), "--skel")


def several_skeletons_of_hands(folder: Path) -> Case:
    two = two_on_a_stage(folder)
    return choosing(("splice", OK, two, "-o", folder / "o.usda"), "--hands-skel")


def unknown_names(folder: Path) -> Case:
    """Hands without thumbs, with names that tell nothing."""
    clip = usdhand.read_clip(OK)
    thumbs = {i for i, name in enumerate(clip.skeleton.names) if "Thumb" in name}
    clip = without(clip, thumbs)
    hands = usdhand.find_hands(clip).character.hands
    s = clip.skeleton
    names = [f"joint{i}" for i in range(len(s))]
    paths = tuple("/".join(names[j] for j in reversed((i, *s.ancestors(i)))) for i in range(len(s)))
    hidden = replace(clip, skeleton=Skeleton(paths, parents_from_paths(paths), s.bind, s.rest))
    arguments = ("inspect", in_file(hidden, folder / "hidden.usda"))

    def follow(_: str) -> Arguments:
        lines = []
        for side, hand in hands.items():
            lines += [f"[{side}]", f'wrist = "{names[hand.wrist]}"']
            lines += [f'{role} = "{names[joint]}"' for role, joint in hand.joints.items()]
        (folder / "names.toml").write_text("\n".join(lines))
        return (*arguments, "--map", folder / "names.toml")

    return Case(arguments, "--map FILE", follow)


def a_body_without_fingers(folder: Path) -> Case:
    body = in_file(bare(usdhand.read_clip(BODY)), folder / "body.usdc")
    arguments = ("fill", body, "--library", folder / "few.usdc", "-o", folder / "o.usda")
    return adding(arguments, "--fingers-from CHARACTER", "--fingers-from", OK)


def fingers_that_move(folder: Path) -> Case:
    arguments = ("fill", BEN, "--library", folder / "few.usdc", "-o", folder / "o.usda")
    return adding(arguments, "--replace replaces them", "--replace")


def a_library_of_another_version(folder: Path) -> Case:
    library = folder / "mine.usda"
    run("library", "build", OK, OTHER, "-o", library, "-q")
    layer = Sdf.Layer.FindOrOpen(str(library))
    layer.GetAttributeAtPath("/Library.usdhand:libraryVersion").default = 99
    layer.Save()

    def follow(message: str) -> Arguments:
        assert f"-o {library} --rebuild" in message
        run("library", "build", OK, OTHER, "-o", library, "--rebuild")
        return ("library", "info", library)

    return Case(("library", "info", library), "--rebuild", follow)


def several_controllers(folder: Path) -> Case:
    arguments = ("reduce", OK, "-o", folder / "o.usda", "--controllers", 2)
    return adding(arguments, "least-squares fit", "--fit", "least-squares")


def several_inputs(folder: Path) -> Case:
    return Case(
        ("convert", OK, OTHER, "-o", folder / "o.usda"),
        "need --out-dir DIR instead of -o",
        lambda _: ("convert", OK, OTHER, "--out-dir", folder / "out"),
    )


def hands_without_a_trunk(folder: Path) -> Case:
    pins = ("--pin", "1:1", "--pin", "181:403")
    arguments = ("splice", BODY, HANDS, *pins, "-o", folder / "o.usda", "--align", "trunk")
    return adding(arguments, "use --align local", "--align", "local")


def a_file_that_is_cut_off(folder: Path) -> Case:
    bvh = folder / "take.bvh"
    run("convert", OK, "-o", bvh)
    lines = bvh.read_text().splitlines()
    bvh.write_text("\n".join(lines[:-5]) + "\n")

    def follow(message: str) -> Arguments:
        [advised] = re.findall(r"set '(Frames: \d+)'", message)
        bvh.write_text(re.sub(r"Frames: \d+", advised, bvh.read_text()))
        return ("inspect", bvh)

    return Case(("inspect", bvh), "if it ends there", follow)


def no_animation(folder: Path) -> Case:
    path = folder / "ok.usda"
    layer = Usd.Stage.Open(str(OK)).Flatten()
    stage = Usd.Stage.Open(layer)
    bound = [p for p in stage.Traverse() if p.GetRelationship("skel:animationSource").GetTargets()]
    [animation] = bound[0].GetRelationship("skel:animationSource").GetTargets()
    for prim in bound:
        prim.RemoveProperty("skel:animationSource")
    layer.Export(str(path))

    def follow(_: str) -> Arguments:
        mended = Usd.Stage.Open(str(path))
        skeleton = next(p for p in mended.Traverse() if p.IsA(UsdSkel.Skeleton))
        UsdSkel.BindingAPI.Apply(skeleton).CreateAnimationSourceRel().SetTargets([animation])
        mended.Save()
        return ("reduce", path, "-o", folder / "o.usda")

    return Case(("reduce", path, "-o", folder / "o.usda"), "Bind a SkelAnimation", follow)


def illegal_names(folder: Path) -> Case:
    joints = [j.replace("LeftArm", "Left Arm") for j in stages.JOINTS]
    path = stages.character(folder / "hero.usda", joints=joints)

    def follow(message: str) -> Arguments:
        assert "Rename 'Left Arm' to 'Left_Arm'" in message
        stage = Usd.Stage.Open(str(path))
        for prim in (stages.SKELETON, stages.ANIMATION):
            attribute = stage.GetPrimAtPath(prim).GetAttribute("joints")
            attribute.Set([j.replace("Left Arm", "Left_Arm") for j in attribute.Get()])
        stage.Save()
        return ("check", path)

    return Case(("check", path), "Rename", follow)


def labels_that_are_missing(folder: Path) -> Case:
    library, table = folder / "mine.usdc", folder / "labels.csv"
    copies = []
    for name, source in (("a", OK), ("b", OTHER), ("c", BEN)):
        copies.append(folder / f"{name}.usdc")
        Usd.Stage.Open(str(source)).Flatten().Export(str(copies[-1]))
    run("library", "build", *copies, "-o", library, "-q")
    arguments = ("evaluate", library, "--labels-only")

    def follow(_: str) -> Arguments:
        table.write_text("file,label\na,ok\nb,ok\nc,wipe\n")
        run("library", "build", *copies, "-o", library, "--labels", table)
        return arguments

    return Case(arguments, "give --labels FILE.csv to 'library build'", follow)


CASES = [
    an_output_that_exists,
    several_skeletons,
    several_skeletons_of_hands,
    unknown_names,
    a_body_without_fingers,
    fingers_that_move,
    a_library_of_another_version,
    several_controllers,
    several_inputs,
    hands_without_a_trunk,
    a_file_that_is_cut_off,
    no_animation,
    illegal_names,
    labels_that_are_missing,
]


@pytest.mark.parametrize("make", CASES, ids=lambda make: make.__name__)
def test_advice_works_when_it_is_followed(
    make: Callable[[Path], Case], tmp_path: Path, shared_work: SharedWork
) -> None:
    (tmp_path / "few.usdc").write_bytes(few_gestures(shared_work).read_bytes())
    case = make(tmp_path)
    failed = CliRunner().invoke(main, [str(a) for a in case.arguments])
    assert failed.exit_code in (1, 2, 3, 4), failed.output
    assert case.advice in failed.output
    run(*case.follow(failed.output))
