"""What `reduce` reports of a clip."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from usdhand.anatomy.hand import DIGITS
from usdhand.reduce.curve import Loss, error_curve
from usdhand.reduce.errors import Errors, pca_rms
from usdhand.reduce.evidence import Takes
from usdhand.reduce.method import Reduction
from usdhand.reduce.rig import ReducedRig, Relation
from usdhand.reduce.settings import ReduceSettings
from usdhand.report.document import rounded
from usdhand.report.text import problems_data, table, written_to

SHOWN_COUNTS = (5, 10, 15, 20, 30)


def reduce_result(reduction: Reduction) -> dict[str, Any]:
    """Everything `reduce` reports of one clip."""
    rig, errors = reduction.rig, reduction.errors
    curves = reduction.source.select(rig.names).values
    over = followed_over(rig)
    return {
        "clip": reduction.clip.name,
        "free_channels": len(rig.free),
        "total_channels": len(rig.names),
        **_fit_data(rig),
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


def fit_result(rig: ReducedRig, evidence: Takes) -> dict[str, Any]:
    """Everything `reduce --fit-only` reports but the curve."""
    moments = evidence.moments
    return {
        "free_channels": len(rig.free),
        "total_channels": len(rig.names),
        "frames": moments.frames,
        **_fit_data(rig),
        "relations": relations_data(rig),
        "followed_to_root_over_threshold": followed_over(rig),
        "held_channels": {name: rounded(value) for name, value in rig.held.items()},
    }


def _fit_data(rig: ReducedRig) -> dict[str, Any]:
    """How a rig was fitted, and to what."""
    return {
        "thresholds": {
            "range_deg": rounded(rig.range_threshold),
            "rmsd": rounded(rig.rmsd_threshold),
        },
        "fit": rig.fit,
        "measure": rig.measure or None,
        "fitted_to": list(rig.sources),
    }


def fit_summary(result: Mapping[str, Any], verbose: bool) -> str:
    """The rig, what it was fitted to, and the curve."""
    shown = {**result, "channels": result["relations"]}
    return "\n".join(
        [
            _rig_text(shown, verbose=False),
            *(relation_lines(result["relations"]) if verbose else ()),
            f"fitted to {len(result['fitted_to'])} clips, {result['frames']} frames; "
            f"{written_to(result)}",
            curve_text(result["curve"], verbose),
        ]
    )


def relations_data(rig: ReducedRig) -> list[dict[str, Any]]:
    """What follows what, and how well it was told."""
    return [
        {
            "name": r.name,
            "kind": r.kind,
            "controllers": list(r.controllers),
            "slopes": [rounded(s) for s in r.slopes],
            "offset": None if r.kind == "free" else rounded(r.offset),
            "fitted": fitted_data(r),
        }
        for r in rig.relations
    ]


def relation_lines(relations: Sequence[Mapping[str, Any]]) -> list[str]:
    """What follows what, in words."""
    lines = []
    for r in relations:
        fitted = r["fitted"]
        if r["kind"] == "free":
            text = "is free"
        elif r["kind"] == "constant":
            text = f"stays at {r['offset']:.1f} deg"
        else:
            terms = " ".join(
                f"{slope:+.2f} {channel_in_words(c)}"
                for c, slope in zip(r["controllers"], r["slopes"], strict=True)
            )
            text = f"follows {terms}"
        if r["kind"] != "free":
            told = "" if fitted["told"] is None else f", {100 * fitted['told']:.0f} % told"
            text += f" (RMS error {fitted['rms_error_deg']:.1f} deg{told})"
        lines.append(f"{r['name']}, {channel_in_words(r['name'])}, {text}")
    return lines


def channel_in_words(channel: str) -> str:
    """``riRingDIPy`` -> ``right ring DIP flexion``."""
    side = "right" if channel.startswith("ri") else "left"
    joint, letter = channel[2:-1], channel[-1]
    digit = next((d for d in DIGITS if joint.startswith(d)), joint)
    letters = "xzy" if digit == "Thumb" else "xyz"
    motion = ("abduction", "flexion", "rotation")[letters.index(letter)]
    return f"{side} {digit.lower()} {joint.removeprefix(digit)} {motion}"


def curve_data(evidence: Takes, settings: ReduceSettings) -> dict[str, Any]:
    """Errors by number of channels, PCA's beside them, and the number at the knee."""
    curve = error_curve(evidence, settings.choice, settings.controllers)

    def loss(found: Loss | None) -> dict[str, float] | None:
        return None if found is None else {"deg": rounded(found.deg), "mm": rounded(found.mm)}

    return {
        "measure": settings.measure,
        "points": [
            {
                "channels": point.channels,
                "fitted": loss(point.fitted),
                "left_out": loss(point.left_out),
                "pca": loss(point.pca),
                "pca_left_out": loss(point.pca_left_out),
            }
            for point in curve.points
        ],
        "presets": [
            {"preset": preset, "channels": count, "fitted": loss(found)}
            for preset, (count, found) in curve.presets.items()
        ],
        "suggested_channels": curve.suggested,
    }


def fitted_data(relation: Relation) -> dict[str, Any]:
    """How well a channel was told on the motion that its rig was fitted to, and its limits."""
    limits = relation.limits

    def number(value: float | None) -> float | None:
        return None if value is None else rounded(value)

    return {
        "std_deg": number(relation.std),
        "rms_error_deg": rounded(relation.rms_error),
        "left_out_error_deg": number(relation.left_out_error),
        "told": number(relation.told),
        "limits_deg": None
        if limits is None
        else [rounded(end) for end in (limits.low, limits.soft_low, limits.soft_high, limits.high)],
    }


def followed_over(rig: ReducedRig) -> list[str]:
    """Channels that follow the root of a chain of controllers beyond the threshold."""
    return [r.name for r in rig.relations if r.rmsd is not None and r.rmsd >= rig.rmsd_threshold]


def summary(result: Mapping[str, Any], verbose: bool) -> str:
    """The rig, which all clips share, then the errors of each clip."""
    clips = result.get("clips", [result])
    lines = [_rig_text(clips[0], verbose)]
    for clip in clips:
        lines += [_error_text(clip), f"  {written_to(clip)}"]
    if curve := result.get("curve"):
        lines.append(curve_text(curve, verbose))
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
            "fitted": fitted_data(r),
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
    if result["measure"]:
        most = max((len(c["controllers"]) for c in channels), default=0)
        of = "degrees of all channels" if result["measure"] == "deg" else "mm at the fingertips"
        each = f" up to {most} channels each" if most > 1 else " one channel each" if most else ""
        how = f"{each}; the best channels by {of}"
    else:
        how = (
            f"; range < {thresholds['range_deg']:g} deg, rmsd < {thresholds['rmsd']:g}, "
            f"{result['fit']} fit"
        )
    lines = [
        f"{len(free)} of {len(channels)} channels stay free "
        f"({kinds.count('constant')} constant, {kinds.count('linear')} follow{how})",
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


def curve_text(curve: Mapping[str, Any], verbose: bool) -> str:
    """The error by number of channels: a table where verbose, else some of it in a line."""
    points = curve["points"]
    kind = "left_out" if any(p["left_out"] for p in points) else "fitted"
    unit = curve["measure"]
    suggested = f"suggested: --target-dofs {curve['suggested_channels']}"
    if not verbose:
        shown = [p for p in points if p["channels"] in SHOWN_COUNTS and p[kind]] or points[-1:]
        numbers = ", ".join(f"{p['channels']}: {p[kind][unit]:.2f}" for p in shown)
        on = "on takes left out" if kind == "left_out" else "on this motion"
        return f"RMS {unit} {on} by number of free channels: {numbers}; {suggested}"
    head = ["free", "deg", "mm", "left out deg", "mm", "PCA deg", "mm"]
    rows = []
    for p in points:
        losses = (p["fitted"], p["left_out"], p["pca"])
        cells = [f"{x[k]:.2f}" if x else "" for x in losses for k in ("deg", "mm")]
        rows.append([str(p["channels"]), *cells])
    presets = ", ".join(
        f"{p['preset']}: {p['channels']} free, {p['fitted']['deg']:.2f} deg"
        for p in curve["presets"]
    )
    return "\n".join([table([head, *rows], right=tuple(range(7))), f"presets {presets}", suggested])
