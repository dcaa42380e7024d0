"""What each verb reports, as plain data."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from usdhand.anatomy import Hands
from usdhand.anatomy.channels import is_flexion
from usdhand.anatomy.hand import CharacterMap, HandMap
from usdhand.evaluate.compare import Comparison
from usdhand.formats.usd.check import Finding
from usdhand.motion import Clip, Problem
from usdhand.reduce.errors import Errors, pca_rms
from usdhand.reduce.method import Reduction
from usdhand.reduce.rig import ReducedRig
from usdhand.report.document import rounded


def inspect_result(clip: Clip, hands: Hands | None, animated: bool = True) -> dict[str, Any]:
    """Everything `inspect` shows of one file; ``hands`` is None where there are none."""
    origin = clip.origin
    result: dict[str, Any] = {
        "skeleton": origin.skeleton_path,
        "animation": origin.animation_path or None,
        "joints": len(clip.skeleton),
        "frames": len(clip) if animated else 0,
        "fps": rounded(clip.fps),
        "start_s": rounded(clip.start),
        "end_s": rounded(clip.start + clip.duration),
        "time_codes_per_second": origin.time_codes_per_second,
        "cm_per_unit": rounded(origin.cm_per_unit),
        "up_axis": origin.up_axis,
        "problems": problems_data(clip.problems),
    }
    if hands is not None:
        result |= map_data(clip, hands.character)
        if animated:
            result["channels"] = _channel_ranges(clip, hands)
            result["off_axis_share"] = _off_axis_shares(clip, hands)
        result["notes"] = list(hands.notes)
    return result


def map_data(clip: Clip, character: CharacterMap) -> dict[str, Any]:
    """The joints that were found, by path."""
    joints = clip.skeleton.joints

    def name(index: int | None) -> str | None:
        return None if index is None else joints[index]

    def hand(found: HandMap) -> dict[str, Any]:
        return {
            "wrist": name(found.wrist),
            "elbow": name(found.elbow),
            "shoulder": name(found.shoulder),
            "clavicle": name(found.clavicle),
            "joints": {k: joints[v] for k, v in found.joints.items()},
            "metacarpals": {k: joints[v] for k, v in found.metacarpals.items()},
            "tips": {k: joints[v] for k, v in found.tips.items()},
            "missing": list(found.missing),
        }

    return {
        "convention": character.convention,
        "hands": {side: hand(found) for side, found in character.hands.items()},
        "hips": name(character.hips),
        "chest": name(character.chest),
        "neck": name(character.neck),
        "head": name(character.head),
        "notes": list(character.notes),
    }


def problems_data(problems: Sequence[Problem]) -> list[dict[str, str]]:
    """Problems as plain data."""
    return [
        {"severity": p.severity, "code": p.code, "message": p.message, "where": p.where}
        for p in problems
    ]


def reduce_result(reduction: Reduction) -> dict[str, Any]:
    """Everything `reduce` reports of one clip."""
    rig, errors = reduction.rig, reduction.errors
    curves = reduction.source.select(rig.names).values
    over = [r.name for r in rig.relations if r.rmsd is not None and r.rmsd >= rig.rmsd_threshold]
    return {
        "clip": reduction.clip.name,
        "free_channels": len(rig.free),
        "total_channels": len(rig.names),
        "thresholds": {
            "range_deg": rounded(rig.range_threshold),
            "rmsd": rounded(rig.rmsd_threshold),
        },
        "fit": rig.fit,
        "fitted_to": list(rig.sources),
        "channels": _channels_data(rig, errors, curves),
        "followed_to_root_over_threshold": over,
        "rms_error_deg": rounded(errors.rms_deg),
        "max_error_deg": rounded(errors.max_deg),
        "fingertip_error_mm": _tips(errors),
        "pca_rms_error_deg": rounded(pca_rms(curves, len(rig.free))),
        "held_channels": {name: rounded(value) for name, value in rig.held.items()},
        "model_error": {
            "rms_deg": rounded(reduction.model_errors.rms_deg),
            "max_deg": rounded(reduction.model_errors.max_deg),
            "fingertip_error_mm": _tips(reduction.model_errors),
        },
        "total_error": {
            "rms_deg": rounded(reduction.total_errors.rms_deg),
            "max_deg": rounded(reduction.total_errors.max_deg),
            "fingertip_error_mm": _tips(reduction.total_errors),
        },
        "problems": problems_data(reduction.clip.problems),
    }


def compare_result(comparison: Comparison) -> dict[str, Any]:
    """Everything `compare` reports."""
    return {
        "frames": comparison.frames,
        "rms_deg": rounded(comparison.rms_deg),
        "max_deg": rounded(comparison.max_deg),
        "fingertip_mm": {
            "mean": rounded(comparison.fingertip_mean),
            "max": rounded(comparison.fingertip_max),
        },
        "lag_s": None if comparison.lag is None else rounded(comparison.lag),
        "jerk_deg_s3": {"a": rounded(comparison.jerk[0]), "b": rounded(comparison.jerk[1])},
        "channels": [
            {"name": n, "rms_deg": rounded(r), "max_deg": rounded(m)}
            for n, r, m in zip(
                comparison.channels, comparison.channel_rms, comparison.channel_max, strict=True
            )
        ],
        "joints": [
            {"name": n, "rms_deg": rounded(r), "max_deg": rounded(m)}
            for n, r, m in zip(
                comparison.joints, comparison.joint_rms, comparison.joint_max, strict=True
            )
        ],
    }


def check_result(findings: Sequence[Finding]) -> dict[str, Any]:
    """Everything `check` reports of one file."""
    return {
        "ok": all(f.severity != "error" for f in findings),
        "findings": [
            {"severity": f.severity, "code": f.code, "message": f.message, "where": f.where}
            for f in findings
        ],
    }


def _channels_data(rig: ReducedRig, errors: Errors, curves: Any) -> list[dict[str, Any]]:
    ranges = np.ptp(curves, axis=0)
    return [
        {
            "name": r.name,
            "kind": r.kind,
            "controller": r.controllers[0] if r.controllers else None,
            "slope": rounded(r.slopes[0]) if r.slopes else None,
            "controllers": list(r.controllers),
            "slopes": [rounded(s) for s in r.slopes],
            "offset": None if r.kind == "free" else rounded(r.offset),
            "rmsd": None if r.rmsd is None else rounded(r.rmsd),
            "range_deg": rounded(width),
            "rms_error_deg": rounded(rms),
            "max_error_deg": rounded(largest),
        }
        for r, width, rms, largest in zip(
            rig.relations, ranges, errors.rms, errors.max, strict=True
        )
    ]


def _tips(errors: Errors) -> dict[str, float]:
    return {"mean": rounded(errors.fingertip_mean), "max": rounded(errors.fingertip_max)}


def _channel_ranges(clip: Clip, hands: Hands) -> list[dict[str, Any]]:
    channels = hands.encode(clip)
    modelled = set(hands.model_names)
    return [
        {
            "name": name,
            "modelled": name in modelled,
            "flexion": is_flexion(name),
            "min_deg": rounded(curve.min()),
            "max_deg": rounded(curve.max()),
            "mean_deg": rounded(curve.mean()),
        }
        for name, curve in zip(channels.names, channels.values.T, strict=True)
    ]


def _off_axis_shares(clip: Clip, hands: Hands) -> dict[str, float]:
    """Share of the variance of hinge joints that is not flexion, where they move."""
    channels = hands.encode(clip)
    variance = dict(zip(channels.names, channels.values.var(axis=0), strict=True))
    shares = {}
    for name in channels.names:
        joint = name[:-1]
        if not (is_flexion(name) and joint.endswith("IP")):  # the hinges: PIP, DIP, thumb IP
            continue
        total = sum(variance[joint + letter] for letter in "xyz")
        if total > 1.0:
            shares[joint] = rounded(1.0 - variance[name] / total)
    return shares
