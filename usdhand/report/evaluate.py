"""What `evaluate` reports."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from usdhand.evaluate.agreement import Agreement
from usdhand.evaluate.reconstruction import METHODS, HandError
from usdhand.report.document import rounded
from usdhand.report.text import table


def evaluation_result(
    agreements: Sequence[Agreement], errors: Sequence[HandError]
) -> dict[str, Any]:
    """Everything `evaluate` reports; the confusion matrix is that of the best metric."""
    result: dict[str, Any] = {}
    if agreements:
        best = max(agreements, key=lambda a: a.share)
        result["label_agreement"] = {
            "segments": best.segments,
            "metrics": [{"name": a.metric, "share": rounded(a.share)} for a in agreements],
            "best": best.metric,
            "labels": list(best.labels),
            "confusion": [[rounded(x) for x in row] for row in best.confusion],
        }
    if errors:
        result["reconstruction"] = {
            side: {method: _mean_error(errors, side, method) for method in METHODS}
            for side in sorted({e.side for e in errors})
        }
        result["takes"] = [
            {
                "take": e.take,
                "side": e.side,
                "method": e.method,
                "degrees": rounded(e.degrees),
                "fingertip_mm": rounded(e.fingertip_mm),
                "jerk": rounded(e.jerk),
            }
            for e in errors
        ]
    return result


def summary(result: Mapping[str, Any], verbose: bool) -> str:
    """Shares of labels with their confusion, then errors by hand and method."""
    del verbose
    parts = []
    if "label_agreement" in result:
        found = result["label_agreement"]
        rows = [[m["name"], f"{100 * m['share']:.1f} %"] for m in found["metrics"]]
        head = ["feature", "same label among the nearest"]
        parts.append(f"{found['segments']} labelled segments\n" + table([head, *rows], right=(1,)))
        labels = found["labels"]
        matrix = [
            [label, *(f"{100 * x:.0f}" for x in row)]
            for label, row in zip(labels, found["confusion"], strict=True)
        ]
        parts.append(
            f"confusion of {found['best']} (% of the nearest)\n"
            + table([["", *labels], *matrix], right=range(1, len(labels) + 1))
        )
    for side, methods in result.get("reconstruction", {}).items():
        rows = [
            [name, f"{e['degrees']:.2f}", f"{e['fingertip_mm']:.1f}", f"{e['jerk']:.3g}"]
            for name, e in methods.items()
        ]
        head = [f"{side} hand", "deg", "fingertips mm", "jerk deg/s^3"]
        parts.append(table([head, *rows], right=(1, 2, 3)))
    return "\n\n".join(parts)


def _mean_error(errors: Sequence[HandError], side: str, method: str) -> dict[str, float]:
    """Means over all frames of all takes."""
    own = [e for e in errors if e.side == side and e.method == method]
    weights = [e.frames for e in own]

    def mean(values: list[float]) -> float:
        return rounded(np.average(values, weights=weights))

    return {
        "degrees": mean([e.degrees for e in own]),
        "fingertip_mm": mean([e.fingertip_mm for e in own]),
        "jerk": mean([e.jerk for e in own]),
    }
