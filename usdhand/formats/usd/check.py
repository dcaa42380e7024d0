"""Checks of a file: all of UsdValidation, and what it does not see."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np
from pxr import Sdf, Usd, UsdGeom, UsdValidation

from usdhand.formats.usd.check_animation import animation_findings
from usdhand.formats.usd.check_skeleton import skeleton_findings
from usdhand.formats.usd.damage import refuses_damage
from usdhand.formats.usd.rig import rig_findings, rig_prims
from usdhand.formats.usd.stage import choose_skeleton, find_skeletons, open_stage
from usdhand.problems import Problem, Severity

__all__ = ["Problem", "Severity", "check_file"]

# Errors to UsdValidation that change no motion: USD assumes Y up and centimetres then.
ONLY_WARNINGS = {"MissingMetersPerUnitMetadata", "MissingUpAxisMetadata"}


@refuses_damage
def check_file(path: str | Path, skel: str | None = None) -> tuple[Problem, ...]:
    """Check everything about a file that matters to the motion of its characters.

    Parameters
    ----------
    path : a .usd, .usda, .usdc or .usdz file
    skel : path or name of the one skeleton to check; all of them by default

    Returns
    -------
    tuple of Problem
        errors first; empty for a file that is right.

    Raises
    ------
    InputError
        if the file cannot be read at all.
    UsageError
        if ``skel`` does not choose one skeleton.
    """
    path = Path(path)
    stage, _ = open_stage(path)
    found = dict.fromkeys(_stage_findings(path, stage, skel))
    return tuple(sorted(found, key=lambda finding: finding.severity != "error"))


def _stage_findings(path: Path, stage: Usd.Stage, skel: str | None) -> Iterator[Problem]:
    yield from validator_findings(stage)
    yield from unit_findings(stage)
    yield from rate_findings(stage)
    yield from rig_findings(stage, path)
    skeletons = find_skeletons(stage)
    if not skeletons and not any(rig_prims(stage)):  # a rig may be fitted without a character
        yield Problem("no-skeleton", "there is no UsdSkel skeleton", str(path), "warning")
    for skeleton in [choose_skeleton(path, skeletons, skel)] if skel else skeletons:
        yield from skeleton_findings(skeleton)
        yield from animation_findings(skeleton)


def validator_findings(stage: Usd.Stage) -> Iterator[Problem]:
    """Run all validators that this USD has."""
    validators = UsdValidation.ValidationRegistry().GetOrLoadAllValidators()
    for error in UsdValidation.ValidationContext(validators).Validate(stage):
        fatal = error.GetType() == UsdValidation.ValidationErrorType.Error
        severity: Severity = (
            "error" if fatal and error.GetName() not in ONLY_WARNINGS else "warning"
        )
        where = ", ".join(_site_name(site) for site in error.GetSites())
        yield Problem(str(error.GetIdentifier()), error.GetMessage(), where, severity)


def unit_findings(stage: Usd.Stage) -> Iterator[Problem]:
    """Stage metadata that can be no unit or rate."""
    for name, value in (
        ("timeCodesPerSecond", stage.GetTimeCodesPerSecond()),
        ("metersPerUnit", UsdGeom.GetStageMetersPerUnit(stage)),
    ):
        if not 0.0 < value < np.inf:
            where = stage.GetRootLayer().identifier
            yield Problem("bad-unit", f"{name} is {value:g}: it must be above 0", where, "error")


def rate_findings(stage: Usd.Stage) -> Iterator[Problem]:
    """Layers whose time codes USD rescales since they count another number to a second.

    That is right where both say what they count. A layer that does not is taken to count 24.
    """
    root, rate = stage.GetRootLayer(), stage.GetTimeCodesPerSecond()
    for layer in stage.GetUsedLayers():
        own = layer.timeCodesPerSecond
        if own == rate or not layer.ListAllTimeSamples():
            continue
        silent = [each for each in (root, layer) if not _says_rate(each)]
        advice = (
            f"author timeCodesPerSecond in {', '.join(each.identifier for each in silent)}, "
            "which is taken to have 24"
            if silent
            else "this is right if it is meant"
        )
        yield Problem(
            "time-rescaled",
            f"time codes of a layer with {own:g} a second are rescaled to the stage's {rate:g}: "
            f"{advice}",
            layer.identifier,
            "error" if silent else "warning",
        )


def _says_rate(layer: Sdf.Layer) -> bool:
    return bool(layer.HasTimeCodesPerSecond() or layer.HasFramesPerSecond())


def _site_name(site: UsdValidation.ValidationErrorSite) -> str:
    if site.IsProperty():
        return str(site.GetProperty().GetPath())
    if site.IsPrim() and not site.GetPrim().IsPseudoRoot():
        return str(site.GetPrim().GetPath())
    layer = site.GetLayer() or (site.GetStage() and site.GetStage().GetRootLayer())
    return str(layer.identifier) if layer else ""
