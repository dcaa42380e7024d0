"""`check_file` on files made wrong in one way each, and on files that are right."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from builders import stages
from conftest import REPOSITORY, shared_data
from pxr import Sdf, Usd, UsdGeom, UsdSkel, Vt

from usdhand.errors import InputError, UsageError
from usdhand.formats.usd.check import check_file
from usdhand.problems import Problem

SKEL_BINDING = "usdSkelValidators:SkelBindingApiAppliedValidator.MissingSkelBindingAPI"
METADATA = "usdGeomValidators:StageMetadataChecker.Missing"
UNRESOLVED = "usdUtilsValidators:MissingReferenceValidator.UnresolvableDependency"
Make = Callable[[Path], Path]


def character(**options: object) -> Make:
    return lambda folder: stages.character(folder / "made.usda", **options)


def changed(change: Callable[[Usd.Stage], None], **options: object) -> Make:
    """A character that is changed once it is written."""

    def make(folder: Path) -> Path:
        path = stages.character(folder / "made.usda", **options)
        stage = stages.edited(path)
        change(stage)
        stage.Save()
        return path

    return make


def animation(stage: Usd.Stage) -> UsdSkel.Animation:
    return UsdSkel.Animation(stage.GetPrimAtPath(stages.ANIMATION))


def joints_named(*names: str) -> Make:
    return character(joints=["Hips", *(f"Hips/{name}" for name in names)])


def waves(bad: float | None = None, frame: int = 3, joint: int = 2) -> np.ndarray:
    values = stages.waves(stages.TIMES, len(stages.JOINTS))
    if bad is not None:
        values[frame, joint] *= bad
    return values


def short_row(stage: Usd.Stage) -> None:
    row = Vt.QuatfArray.FromNumpy(np.ascontiguousarray(waves()[0][:4]))
    animation(stage).GetRotationsAttr().Set(row, 5.0)


def identity_bind(stage: Usd.Stage) -> None:
    binds = stages.bind_matrices(stages.JOINTS)
    binds[-2:] = np.eye(4)
    UsdSkel.Skeleton.Get(stage, stages.SKELETON).GetBindTransformsAttr().Set(stages.matrices(binds))


def pose(name: str, values: np.ndarray) -> Callable[[Usd.Stage], None]:
    def change(stage: Usd.Stage) -> None:
        stage.GetPrimAtPath(stages.SKELETON).GetAttribute(f"{name}Transforms").Set(
            stages.matrices(values)
        )

    return change


def bound_to(target: str, on: str = stages.SKELETON) -> Callable[[Usd.Stage], None]:
    return lambda stage: stages.bind(stage.GetPrimAtPath(on), target)


def second_animation(stage: Usd.Stage) -> None:
    UsdSkel.Animation.Define(stage, "/Hero/Other")
    stages.bind(stage.GetPrimAtPath(stages.ROOT), "/Hero/Other")


def over(rate: float | None, below: float | None, **options: object) -> Make:
    """A layer that counts ``rate`` time codes a second over one that counts ``below``."""

    def make(folder: Path) -> Path:
        stages.character(folder / "below.usda", rate=below)
        return stages.sublayering(folder / "made.usda", folder / "below.usda", rate=rate, **options)

    return make


def lost(how: str) -> Make:
    def make(folder: Path) -> Path:
        if how == "sublayer":
            stages.character(folder / "made.usda")
            layer = Sdf.Layer.FindOrOpen(str(folder / "made.usda"))
            layer.subLayerPaths.append("./nowhere.usda")
            layer.Save()
            return folder / "made.usda"
        return stages.referencing(folder / "made.usda", folder / "nowhere.usda", how=how)

    return make


WRONG: dict[str, tuple[Make, str, str, str]] = {
    "space": (joints_named("left hand"), "error", "illegal-joint-name", "'left_hand'"),
    "colon": (joints_named("rig:hand"), "error", "illegal-joint-name", "'rig_hand'"),
    "hyphen": (joints_named("hand-L"), "error", "illegal-joint-name", "'hand_L'"),
    "dot": (joints_named("hand.L"), "error", "illegal-joint-name", "'hand_L'"),
    "digit": (joints_named("1hand"), "error", "illegal-joint-name", "'_1hand'"),
    "same leaf": (
        joints_named("a", "a/end", "b", "b/end"), "warning", "duplicate-joint-name", "end",
    ),
    "twice": (joints_named("a", "a"), "error", "duplicate-joint", "Hips/a"),
    "order": (joints_named("a/b", "a"), "error", "joint-order", "Hips/a/b"),
    "no joints": (character(joints=[]), "error", "no-joints", "no joints"),
    "no bind": (character(without=["bind"]), "error", "missing-bind", "no bind"),
    "no rest": (character(without=["rest"]), "error", "missing-rest", "no rest"),
    "short bind": (
        changed(pose("bind", stages.bind_matrices(stages.JOINTS)[:3])),
        "error", "bind-length", "3 bind transforms for 11 joints",
    ),
    "short rest": (
        changed(pose("rest", stages.rest_matrices(stages.JOINTS)[:3])),
        "error", "rest-length", "3 rest transforms for 11 joints",
    ),
    "singular bind": (
        changed(pose("bind", np.zeros((11, 4, 4)))), "error", "bad-bind", "11 bind",
    ),
    "nan rest": (
        changed(pose("rest", np.full((11, 4, 4), np.nan))), "error", "bad-rest", "11 rest",
    ),
    "no scales": (character(without=["scales"]), "error", "missing-scales", "rest pose"),
    "no translations": (
        character(without=["translations"]), "error", "missing-translations", "rest pose",
    ),
    "no rotations": (character(without=["rotations"]), "error", "missing-rotations", "rest pose"),
    "unknown joints": (
        character(animated=[*stages.JOINTS, "Hips/Tail"]), "warning", "unknown-joints", "Hips/Tail",
    ),
    "no known joint": (
        character(animated=["a", "a/b"]), "error", "no-joints-animated", "a, a/b",
    ),
    "no api": (character(without=["api"]), "error", SKEL_BINDING, stages.SKELETON),
    "no animation": (character(without=["binding"]), "warning", "no-animation", "no animation"),
    "lost animation": (changed(bound_to("/Hero/No")), "error", "no-such-animation", "not exist"),
    "no SkelAnimation": (
        changed(bound_to("/Hero")), "error", "no-such-animation", "not a SkelAnimation",
    ),
    "lost binding": (changed(second_animation), "warning", "lost-binding", "/Hero/Other"),
    "static": (character(rotations=waves()[:1]), "warning", "static-rotations", "Blender"),
    "array length": (
        changed(short_row), "error", "array-length", "4 values for 11 joints at time code 5",
    ),
    "blocked": (
        changed(lambda s: animation(s).GetTranslationsAttr().Set(Sdf.ValueBlock(), 4.0),
                translations=np.tile(stages.offsets(11), (12, 1, 1))),
        "error", "blocked-sample", "time code 4",
    ),
    "nan": (character(rotations=waves(np.nan)), "error", "not-a-number", "Head at time code 4"),
    "infinite": (
        character(translations=stages.offsets(11)[None] * np.inf),
        "error", "not-a-number", "the default value",
    ),
    "zero": (character(rotations=waves(0.0)), "error", "zero-quaternion", "Head at time code 4"),
    "long": (
        character(rotations=waves(1.2)), "error", "non-unit-quaternion", "Head at time code 4",
    ),
    "sign flip": (
        character(rotations=waves(-1.0)), "warning", "sign-flip", "Head at time code 4 and 1 more",
    ),
    "silently rescaled": (over(None, 60.0), "error", "time-rescaled", "60 a second"),
    "silently rescaled below": (over(60.0, None), "error", "time-rescaled", "below.usda"),
    "rescaled": (over(30.0, 60.0), "warning", "time-rescaled", "60 a second"),
    "no start": (character(start=None), "warning", "no-time-range", "1 to 12"),
    "no end": (character(end=None), "warning", "no-time-range", "1 to 12"),
    "late start": (character(start=3.0), "warning", "time-range", "3 to 12"),
    "early end": (character(end=11.0), "warning", "time-range", "1 to 11"),
    "identity bind": (changed(identity_bind), "warning", "identity-bind", "LeftHandIndex2"),
    "lost sublayer": (lost("sublayer"), "error", UNRESOLVED, "nowhere.usda"),
    "lost reference": (lost("reference"), "error", UNRESOLVED, "nowhere.usda"),
    "lost payload": (lost("payload"), "error", UNRESOLVED, "nowhere.usda"),
    "no up axis": (character(up=None), "warning", f"{METADATA}UpAxisMetadata", "upAxis"),
    "no unit": (
        character(meters=None), "warning", f"{METADATA}MetersPerUnitMetadata", "metersPerUnit",
    ),
    "zero scale": (
        changed(lambda s: stages.place(s, scale=(0, 0, 0)) and None),
        "error", "zero-scale", "zero scale",
    ),
    "mirrored": (
        changed(lambda s: stages.place(s, scale=(-1, 1, 1)) and None),
        "warning", "mirrored", "left and right",
    ),
    "non-uniform": (
        changed(lambda s: stages.place(s, scale=(1, 2, 1)) and None),
        "warning", "non-uniform-scale", "scale",
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", WRONG)
def test_finds(name: str, tmp_path: Path) -> None:
    make, severity, code, words = WRONG[name]
    found = check_file(make(tmp_path))
    assert [(f.severity, f.code) for f in found if f.code == code] == [(severity, code)]
    assert any(words in str(finding) for finding in found if finding.code == code)


RIGHT: dict[str, Make] = {
    "plain": character(),
    "with translations and scales over time": character(
        translations=np.tile(stages.offsets(11), (12, 1, 1)), scales=np.ones((12, 11, 3))
    ),
    "fewer joints": character(animated=stages.JOINTS[5:]),
    "Z up, metres": character(up="Z", meters=1.0),
    "placed and scaled": changed(
        lambda s: stages.place(s, translate=(1, 2, 3), rotate=(-90, 0, 0), scale=(2, 2, 2)) and None
    ),
    "inherited binding": changed(
        lambda s: stages.bind(s.GetPrimAtPath(stages.ROOT), stages.ANIMATION), without=["binding"]
    ),
    "sublayers of one rate": over(30.0, 30.0),
    "a layer without samples and rate": lambda folder: stages.sublayering(
        folder / "made.usda",
        Path(stages.layer(folder / "empty.usda", rate=None).realPath),
        stages.character(folder / "below.usda", rate=30.0),
        rate=30.0,
    ),
    "letters of all languages": joints_named("Hüfte", "手"),
}


@pytest.mark.parametrize("name", RIGHT)
def test_finds_nothing(name: str, tmp_path: Path) -> None:
    assert check_file(RIGHT[name](tmp_path)) == ()


def test_errors_come_first(tmp_path: Path) -> None:
    path = stages.character(tmp_path / "made.usda", without=["bind"], up=None, start=None)
    severities = [finding.severity for finding in check_file(path)]
    assert severities == ["error", "warning", "warning"]


def test_checks_all_skeletons_or_the_one_that_is_chosen(tmp_path: Path) -> None:
    path = stages.character(tmp_path / "made.usda")
    stage = stages.edited(path)
    stages.add_character(stage, "/Twin", without=["bind"])
    stage.Save()
    assert [f.where for f in check_file(path)] == ["/Twin/Skel"]
    assert check_file(path, "Hero") == ()
    with pytest.raises(UsageError, match="/Hero/Skel, /Twin/Skel"):
        check_file(path, "Nobody")


def test_two_characters_with_one_animation_report_it_once(tmp_path: Path) -> None:
    path = stages.character(tmp_path / "made.usda", rotations=waves(0.0))
    stage = stages.edited(path)
    twin = stages.add_character(stage, "/Twin")
    stages.bind(twin.GetPrim(), stages.ANIMATION)
    stage.Save()
    assert [f.code for f in check_file(path)].count("zero-quaternion") == 1


def test_looks_inside_instances(tmp_path: Path) -> None:
    stages.character(tmp_path / "inner.usda", without=["bind"])
    path = stages.referencing(tmp_path / "made.usda", tmp_path / "inner.usda", instanceable=True)
    assert [f.code for f in check_file(path)] == ["missing-bind"]


def test_no_skeleton(tmp_path: Path) -> None:
    layer = stages.layer(tmp_path / "made.usda")
    UsdGeom.Xform.Define(Usd.Stage.Open(layer), stages.ROOT)
    layer.Save()
    assert [f.code for f in check_file(tmp_path / "made.usda")] == ["no-skeleton"]


def test_what_is_no_usd_is_refused(tmp_path: Path) -> None:
    (tmp_path / "text.usd").write_text("hello")
    with pytest.raises(InputError, match=r"text\.usd: USD cannot read"):
        check_file(tmp_path / "text.usd")


def test_a_finding_as_a_sentence() -> None:
    assert str(Problem("code", "it is wrong", "/A", "error")) == "it is wrong (/A)"
    assert str(Problem("code", "it is odd")) == "it is odd"


@pytest.mark.real_data
@pytest.mark.parametrize(
    ("take", "expected"),
    [
        ("studiogalt/full", {"sign-flip"}),
        ("studiogalt/mini", {"sign-flip"}),
        ("maya", {"sign-flip", "identity-bind"}),
    ],
)
def test_what_real_files_report(take: str, expected: set[str]) -> None:
    files = sorted(
        p for p in shared_data(*take.split("/")).iterdir() if p.suffix in (".usda", ".usdc")
    )
    codes = {finding.code for file in files[::6] for finding in check_file(file)}
    assert codes == expected


@pytest.mark.parametrize(
    "kind", ["characters", "gestures", "gestures_ben", "hands", "conversations"]
)
def test_samples_are_right(kind: str) -> None:
    files = sorted((REPOSITORY / "samples" / kind).glob("*.usd*"))
    assert files
    codes = {finding.code for file in files[::6] for finding in check_file(file)}
    assert codes == ({"no-animation"} if kind == "characters" else set())


def test_other_verbs_do_not_need_usd_validation(tmp_path: Path) -> None:
    path = stages.character(tmp_path / "in.usda")
    program = (
        "import sys; sys.modules['pxr.UsdValidation'] = None; "
        "from usdhand.cli.main import main; main(sys.argv[1:])"
    )
    for line in (["convert", path, "-o", tmp_path / "a.usdz"], ["compare", path, path]):
        done = subprocess.run(
            [sys.executable, "-c", program, *line], capture_output=True, text=True
        )
        assert "UsdValidation" not in done.stderr
        assert "unexpected" not in done.stderr
    assert (tmp_path / "a.usdz").exists()
