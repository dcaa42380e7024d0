"""One file composes to what its stage did, on random stages."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory

import pytest
from builders import stages
from builders.random_stages import random_stage
from hypothesis import HealthCheck, assume, given, reject, settings
from hypothesis import strategies as st
from oracles.composition import assert_composes_alike
from pxr import Tf, Usd

from usdhand.formats.usd.composed import variant_places
from usdhand.formats.usd.flatten import flat_layer
from usdhand.formats.usd.stage import one_thread, usd_diagnostics
from usdhand.formats.usd.write import save_flat

SUFFIXES = ("usda", "usdc", "usdz")
MOST_PRIMS = 200
LENIENT = {"suppress_health_check": list(HealthCheck), "print_blob": True}


def check_one(data: st.DataObject) -> None:
    suffix = data.draw(st.sampled_from(SUFFIXES))
    with TemporaryDirectory() as folder, usd_diagnostics(), one_thread():
        source = random_stage(Path(folder), data.draw)
        target = Path(folder, f"out.{suffix}")
        try:
            stage = Usd.Stage.Open(str(source))
        except Tf.ErrorException:  # USD trips over some arcs that lead nowhere
            reject()
        assume(len(list(stage.TraverseAll())) <= MOST_PRIMS)  # arcs multiply
        lost = save_flat(stage, target)
        before, after = (Usd.Stage.Open(str(path)) for path in (source, target))
        codes = {problem.code for problem in lost}
        assert_composes_alike(before, after, targets="targets" not in codes)
        if "variants" not in codes:
            check_variants(before, after)


def check_variants(before: Usd.Stage, after: Usd.Stage) -> None:
    choices = [
        (str(prim.GetPath()), name, variant)
        for prim, name in variant_places(before)
        if not prim.IsInstanceProxy() and not prim.IsAbstract()
        for variant in prim.GetVariantSets().GetVariantSet(name).GetVariantNames()
    ]
    for path, name, variant in choices:
        with selected(before, after, path, name, variant):
            assert_composes_alike(before, after)


@contextmanager
def selected(
    before: Usd.Stage, after: Usd.Stage, path: str, name: str, variant: str
) -> Iterator[None]:
    for stage in (before, after):
        stage.SetEditTarget(stage.GetSessionLayer())
        stage.GetPrimAtPath(path).GetVariantSets().SetSelection(name, variant)
    yield
    for stage in (before, after):
        stage.GetSessionLayer().Clear()


@settings(max_examples=30, **LENIENT)
@given(st.data())
def test_random_stages_stay_what_they_are(data: st.DataObject) -> None:
    check_one(data)


@pytest.mark.slow
@settings(max_examples=300, derandomize=False, **LENIENT)
@given(st.data())
def test_many_random_stages_stay_what_they_are(data: st.DataObject) -> None:
    check_one(data)


def test_variants_that_usd_cannot_compose_are_said(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Seldom, specializes arcs below references make USD fail where a variant is selected."""

    def failing(*_: object, **__: object) -> str:
        return str(Usd.Stage.Open(str(tmp_path / "none.usda")))

    path = stages.character(tmp_path / "in.usda")
    stage = stages.edited(path)
    stage.GetPrimAtPath(stages.ROOT).GetVariantSets().AddVariantSet("look").AddVariant("red")
    stage.Save()
    monkeypatch.setattr("usdhand.formats.usd.flatten.first_difference", failing)
    _, [lost] = flat_layer(Usd.Stage.Open(str(path)))
    assert lost.code == "variants"
    assert "only the selected variants are kept, since USD cannot compose" in lost.message
