"""A rig fitted once: written alone, applied to clips, shown, and hands made of few channels."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from builders.cli_runner import edit, run
from conftest import REPOSITORY
from pxr import Usd

import usdhand
from usdhand.anatomy.channels import Channels

GESTURES = REPOSITORY / "samples" / "gestures"
TAKES = [GESTURES / f"{name}_0{i}.usdc" for name in ("ok", "wipe") for i in (1, 2, 3)]
OTHER = GESTURES / "ok_05.usdc"
BEN = REPOSITORY / "samples" / "gestures_ben" / "ok_01.usdc"


@pytest.fixture(scope="module")
def show(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("show") / "show_rig.usdc"
    run("reduce", *TAKES, "--fit-only", "--target-dofs", 14, "-o", path, "-q")
    return path


@pytest.fixture(scope="module")
def few(tmp_path_factory: pytest.TempPathFactory, show: Path) -> Path:
    """A clip whose hands have the free channels alone: all others at zero."""
    path = tmp_path_factory.mktemp("few") / "few.usdc"
    clip = usdhand.read_clip(OTHER)
    hands = usdhand.find_hands(clip)
    source = hands.encode(clip)
    free = source.select(usdhand.read_rig(show).free)
    bare = Channels(source.names, np.zeros_like(source.values)).replaced(free)
    usdhand.write_clip(hands.decode(bare, clip), path)
    return path


def test_a_rig_alone_is_right_without_a_skeleton(show: Path) -> None:
    assert usdhand.check_file(show) == ()


def test_one_file_with_relations_alone(show: Path, tmp_path: Path) -> None:
    stage = Usd.Stage.Open(str(show))
    [prim] = stage.GetPseudoRoot().GetChildren()
    assert prim.GetName() == "HandRig"
    assert not prim.GetRelationship("usdhand:skeleton")
    rig = usdhand.read_rig(show)
    assert len(rig.free) == 14
    assert rig.sources == tuple(path.stem for path in TAKES)
    fitted = usdhand.fit_rig(TAKES, usdhand.ReduceSettings(free_channels=14))
    assert fitted.relations == rig.relations
    usdhand.write_rig(rig, tmp_path / "again.usda")
    assert usdhand.read_rig(tmp_path / "again.usda").relations == rig.relations
    assert run("check", show).exit_code == 0


@pytest.mark.parametrize("by", ["function", "command"])
def test_no_clip_is_held_when_the_next_is_read(
    by: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Memory does not grow with the number of clips: counted, not measured."""
    import gc
    import weakref

    from usdhand.verbs import reduce

    motions: list[weakref.ref[np.ndarray]] = []
    alive: list[int] = []
    real = reduce.read_clip

    def counted(path: Path, skel: str | None = None) -> usdhand.Clip:
        gc.collect()
        alive.append(sum(ref() is not None for ref in motions))
        clip = real(path, skel)
        motions.append(weakref.ref(clip.rotations))
        return clip

    monkeypatch.setattr(reduce, "read_clip", counted)
    if by == "command":
        out = tmp_path / "rig.usdc"
        run("reduce", *TAKES, "--fit-only", "--target-dofs", 9, "-o", out, "-q")
    else:
        usdhand.fit_rig(TAKES, usdhand.ReduceSettings(free_channels=9))
    assert len(alive) == len(TAKES)
    assert max(alive) <= 1  # the one that the loop lets go of when the next has come


def test_the_report_has_the_curve(tmp_path: Path) -> None:
    out = tmp_path / "rig.usdc"
    fit = ("--fit-only", "--target-dofs", 9, "--symmetric", "--prefer", "flexion")
    said = run("reduce", *TAKES, *fit, "-o", out, "-n", "--json", "--plots", tmp_path / "p")
    report = json.loads(said.stdout)
    assert report["free_channels"] == 8
    assert report["output"] is None
    assert not out.exists()
    points = report["curve"]["points"]
    assert all(p["left_out"]["deg"] > 0 for p in points if p["channels"] < 40)
    assert 1 <= report["curve"]["suggested_channels"] <= 30
    assert sorted(p.name for p in (tmp_path / "p").iterdir()) == [
        "reduce_errors.png", "reduce_errors.svg",
    ]  # fmt: skip


def test_it_is_applied_to_clips_of_any_character(show: Path, tmp_path: Path) -> None:
    for clip in (OTHER, BEN):
        out = tmp_path / f"{clip.parent.name}.usda"
        report = json.loads(run("reduce", clip, "--rig", show, "-o", out, "--json").stdout)
        assert report["free_channels"] == 14
        assert report["measure"] == "deg"
        assert "curve" not in report
        assert usdhand.read_rig(out).relations == usdhand.read_rig(show).relations


def test_a_clip_of_free_channels_gets_whole_hands(show: Path, few: Path, tmp_path: Path) -> None:
    out, reduced = tmp_path / "whole.usdc", tmp_path / "reduced.usda"
    said = run("expand", show, "--motion", few, "-o", out, "--json")
    report = json.loads(said.stdout)
    assert report["from_clip"]
    assert len(report["dependent_channels"]) == 36
    told = [c["fitted"]["told"] for c in report["dependent_channels"]]
    assert np.median(told) > 0.5
    assert all(c["fitted"]["left_out_error_deg"] >= 0 for c in report["dependent_channels"])
    run("reduce", OTHER, "--rig", show, "-o", reduced, "-q")
    same = json.loads(run("compare", reduced, out, "--json").stdout)
    assert same["max_deg"] < 0.01
    text = run("expand", show, "--motion", few, "-o", out, "--force").output
    assert "of their motion was told" in text
    onto = tmp_path / "onto.usdc"
    run("expand", show, "--motion", few, "--onto", BEN, "-o", onto, "-q")
    clip = usdhand.read_clip(onto)
    channels = usdhand.find_hands(clip).encode(clip)
    rig = usdhand.read_rig(show)
    own = usdhand.read_clip(few)
    wanted = usdhand.find_hands(own).encode(own).select(rig.free).values
    assert np.abs(channels.select(rig.free).values - wanted).max() < 0.01


def test_free_channels_that_are_no_evidence_are_named(show: Path, tmp_path: Path) -> None:
    clip = usdhand.read_clip(OTHER)
    hands = usdhand.find_hands(clip)
    source = hands.encode(clip)
    name = next(n for n in usdhand.read_rig(show).free if n.endswith("y") and "Thumb" not in n)
    for value, code in ((20.0, "still-free-channels"), (150.0, "beyond-limits")):
        values = source.values.copy()
        values[:, source.names.index(name)] = value
        path = tmp_path / f"{code}.usdc"
        usdhand.write_clip(hands.decode(Channels(source.names, values), clip), path)
        out = tmp_path / f"{code}_out.usda"
        report = json.loads(run("expand", show, "--motion", path, "-o", out, "--json").stdout)
        [problem] = [p for p in report["outcome"]["problems"] if p["code"] == code]
        assert name in problem["message"]


def test_hands_without_a_free_channel_are_refused(show: Path, tmp_path: Path) -> None:
    rig = usdhand.read_rig(show)
    clip = usdhand.read_clip(OTHER)
    other = replace(
        rig,
        relations=tuple(
            replace(r, name="riToeMCPy")
            if r.name == rig.free[0]
            else replace(
                r, controllers=tuple("riToeMCPy" if c == rig.free[0] else c for c in r.controllers)
            )
            for r in rig.relations
        ),
    )
    with pytest.raises(usdhand.UsageError, match="riToeMCPy"):
        usdhand.expand_motion(other, clip)
    said = run("expand", show, "-o", tmp_path / "x.usda", code=3)
    assert "--motion" in said.output


def test_variation_is_repeatable_and_off_by_default(show: Path, tmp_path: Path) -> None:
    def made(*options: object) -> usdhand.Clip:
        out = tmp_path / "out.usdc"
        run("expand", show, "--motion", OTHER, "-o", out, "--force", "-q", *options)
        return usdhand.read_clip(out)

    plain, off = made(), made("--variation", 0, "--seed", 5)
    assert np.array_equal(plain.rotations, off.rotations)
    one, again, other = (made("--variation", 1, "--seed", seed) for seed in (1, 1, 2))
    assert np.array_equal(one.rotations, again.rotations)
    assert not np.array_equal(one.rotations, other.rotations)
    rig = usdhand.read_rig(show)
    free = [usdhand.find_hands(c).encode(c).select(rig.free).values for c in (plain, one)]
    assert np.abs(free[0] - free[1]).max() < 1e-3
    run("expand", show, "--motion", OTHER, "-o", tmp_path / "y.usdc", "--variation", -1, code=2)


def test_inspect_says_and_draws_what_follows_what(show: Path, tmp_path: Path) -> None:
    plots = tmp_path / "plots"
    text = run("inspect", show, "--plots", plots).output
    assert "hand rig: 14 of 50 channels free" in text
    rig = usdhand.read_rig(show)
    for relation in rig.relations:
        [line] = [x for x in text.splitlines() if x.strip().startswith(f"{relation.name},")]
        assert {"free": "is free", "linear": "follows", "constant": "stays at"}[
            relation.kind
        ] in line
    assert sorted(p.name for p in plots.iterdir()) == ["rig_hands.png", "rig_hands.svg"]
    report = json.loads(run("inspect", show, "--json").stdout)
    assert len(report["files"][0]["rig"]["relations"]) == 50
    assert "0 of these files" in run("inspect", OTHER, "--plots", plots, "--force", code=2).output
    bound = tmp_path / "bound.usda"
    run("reduce", OTHER, "--rig", show, "-o", bound, "-q")
    both = run("inspect", bound).output
    assert "hands by convention" in both
    assert "hand rig: 14 of 50" in both
    run("inspect", bound, show, "--plots", tmp_path / "p2", code=2)


def test_rigs_without_limits_read_as_they_did(show: Path, tmp_path: Path) -> None:
    """As earlier versions wrote them."""
    new = ("min", "softMin", "softMax", "max", "std", "leftOutError")

    def older(stage: Usd.Stage) -> None:
        prim = stage.GetPrimAtPath("/HandRig")
        for name in [a.GetName() for a in prim.GetAttributes()]:
            if name.split(":")[-1] in new or "residual" in name or name == "usdhand:measure":
                prim.RemoveProperty(name)

    old = usdhand.read_rig(edit(show, tmp_path / "old.usdc", older))
    rig = usdhand.read_rig(show)
    assert old.residuals is None
    assert old.measure == ""
    for a, b in zip(old.relations, rig.relations, strict=True):
        assert (a.kind, a.controllers, a.slopes, a.offset) == (
            b.kind, b.controllers, b.slopes, b.offset,
        )  # fmt: skip
        assert a.limits is None
    far = Channels(old.free, np.full((1, len(old.free)), 1000.0))
    values = old.evaluate(far)
    for r in old.relations:
        if r.kind == "linear":
            wanted = r.offset + 1000.0 * sum(r.slopes)
            assert values.select([r.name]).values[0, 0] == pytest.approx(wanted, abs=1e-6)
    out = tmp_path / "x.usdc"
    said = run("expand", tmp_path / "old.usdc", "--motion", OTHER, "-o", out, "--variation", 1,
               code=2)  # fmt: skip
    assert "reduce again" in said.output


@pytest.mark.parametrize("ends", [{"min": 80.0}, {"softMax": float("nan")}, {"max": None}])
def test_damaged_limits_are_refused(
    show: Path, tmp_path: Path, ends: dict[str, float | None]
) -> None:
    def damage(stage: Usd.Stage) -> None:
        prim = stage.GetPrimAtPath("/HandRig")
        [(end, value)] = ends.items()
        name = f"usdhand:channel:{usdhand.read_rig(show).free[0]}:{end}"
        if value is None:
            prim.RemoveProperty(name)
        else:
            prim.GetAttribute(name).Set(value)

    damaged = edit(show, tmp_path / "damaged.usdc", damage)
    with pytest.raises(usdhand.InputError, match=r"damaged\.usdc"):
        usdhand.read_rig(damaged)


def test_damaged_residuals_are_refused(show: Path, tmp_path: Path) -> None:
    def damage(stage: Usd.Stage) -> None:
        attribute = stage.GetPrimAtPath("/HandRig").GetAttribute("usdhand:residual:mixtures")
        attribute.Set(list(attribute.Get())[:-1])

    with pytest.raises(usdhand.InputError, match="residuals is damaged"):
        usdhand.read_rig(edit(show, tmp_path / "damaged.usdc", damage))
