"""What `reduce` reports of a clip."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from usdhand.reduce.errors import Errors, pca_rms
from usdhand.reduce.method import Reduction
from usdhand.reduce.rig import ReducedRig
from usdhand.report.document import rounded
from usdhand.report.text import problems_data, table, written_to


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


def summary(result: Mapping[str, Any], verbose: bool) -> str:
    """The rig, which all clips share, then the errors of each clip."""
    clips = result.get("clips", [result])
    lines = [_rig_text(clips[0], verbose)]
    for clip in clips:
        lines += [_error_text(clip), f"  {written_to(clip)}"]
    return "\n".join(lines)


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


def _rig_text(result: Mapping[str, Any], verbose: bool) -> str:
    channels = result["channels"]
    free = [c["name"] for c in channels if c["kind"] == "free"]
    kinds = [c["kind"] for c in channels]
    thresholds = result["thresholds"]
    lines = [
        f"{len(free)} of {len(channels)} channels stay free "
        f"({kinds.count('constant')} constant, {kinds.count('linear')} follow; range < "
        f"{thresholds['range_deg']:g} deg, rmsd < {thresholds['rmsd']:g}, {result['fit']} fit)",
        "free: " + (" ".join(free) or "none"),
    ]
    if over := result["followed_to_root_over_threshold"]:
        lines.append(f"{len(over)} follow a root beyond the threshold: {' '.join(over)}")
    if verbose:
        head = ["channel", "kind", "follows", "slope", "rmsd", "RMS deg", "max deg"]
        rows = [
            [
                c["name"],
                c["kind"],
                " ".join(c["controllers"]),
                " ".join(f"{s:.3f}" for s in c["slopes"]),
                "" if c["rmsd"] is None else f"{c['rmsd']:.2f}",
                f"{c['rms_error_deg']:.3f}",
                f"{c['max_error_deg']:.3f}",
            ]
            for c in channels
        ]
        lines += ["", table([head, *rows], right=(3, 4, 5, 6)), ""]
    return "\n".join(lines)


def _error_text(result: Mapping[str, Any]) -> str:
    tips, total = result["fingertip_error_mm"], result["total_error"]["fingertip_error_mm"]
    rms, largest = result["rms_error_deg"], result["max_error_deg"]
    return (
        f"{result['clip']}\n"
        f"  reduction: RMS {rms:.2f} deg, max {largest:.1f} deg; "
        f"fingertips mean {tips['mean']:.1f} mm, max {tips['max']:.1f} mm "
        f"(PCA of the same size: RMS {result['pca_rms_error_deg']:.2f} deg)\n"
        f"  with the {len(result['held_channels'])} angles outside the model held: fingertips mean "
        f"{total['mean']:.1f} mm, max {total['max']:.1f} mm"
    )
