"""What `compare` reports."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from usdhand.evaluate.compare import Comparison
from usdhand.report.document import rounded
from usdhand.report.text import table


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


def summary(result: Mapping[str, Any], verbose: bool) -> str:
    """Totals, then channels, the worst first; all of them and the joints if ``verbose``."""
    lag = result["lag_s"]
    tips, jerk = result["fingertip_mm"], result["jerk_deg_s3"]
    parts = [
        f"{len(result['channels'])} hand channels over {result['frames']} frames: "
        f"RMS {result['rms_deg']:.3f} deg, max {result['max_deg']:.3f} deg\n"
        f"fingertips: mean {tips['mean']:.3f} mm, max {tips['max']:.3f} mm\n"
        f"jerk: A {jerk['a']:.3g}, B {jerk['b']:.3g} deg/s^3\n"
        f"lag of B: {'the hands move too little' if lag is None else f'{lag:+.4f} s'}"
    ]
    rows = sorted(result["channels"], key=lambda c: -c["rms_deg"])
    parts.append(_angles("channel", rows if verbose else rows[:5]))
    if verbose and result["joints"]:
        parts.append(_angles("joint", result["joints"]))
    return "\n\n".join(parts)


def _angles(what: str, rows: Sequence[Mapping[str, Any]]) -> str:
    lines = [[r["name"], f"{r['rms_deg']:.3f}", f"{r['max_deg']:.3f}"] for r in rows]
    return table([[what, "RMS deg", "max deg"], *lines], right=(1, 2))
