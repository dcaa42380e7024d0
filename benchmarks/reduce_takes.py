"""What reduction loses on a folder of takes, as Markdown tables for the documentation.

    python benchmarks/reduce_takes.py [--data FOLDER]

Without a folder: the samples' gestures. Errors in degrees are RMS over the 50 modelled channels,
errors in millimetres are distances of the ten fingertips, both against the same motion with the
angles outside the model held; what holding them loses is a table of its own.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from hand_agreement import agreement_of_rigs, off_axis_shares

from usdhand import find_hands, read_clip
from usdhand.anatomy.channels import Channels, Hands
from usdhand.motion import Clip
from usdhand.motion.rotations import Array
from usdhand.reduce.errors import Errors, pca_rms
from usdhand.reduce.method import apply_rig, fit_rig
from usdhand.reduce.rig import ReducedRig
from usdhand.reduce.settings import PRESETS, Fit, Target

SAMPLES = Path(__file__).resolve().parent.parent / "samples" / "gestures"
FITS: dict[str, tuple[Fit, int]] = {
    "paper": ("paper", 1),
    "least squares": ("least-squares", 1),
    "up to 3 controllers": ("least-squares", 3),
}
COUNTS = range(5, 55, 5)


@dataclass(frozen=True, eq=False)
class Take:
    """A clip with its hands and all their channels."""

    clip: Clip
    hands: Hands
    source: Channels

    @classmethod
    def read(cls, path: Path) -> Take:
        """Read a file and encode its hands."""
        clip = read_clip(path)
        hands = find_hands(clip)
        return cls(clip, hands, hands.encode(clip))

    @property
    def curves(self) -> Array:
        """(frames, 50) degrees."""
        return self.source.select(self.hands.model_names).values


def fitted(takes: Sequence[Take], target: Target, fit: str) -> ReducedRig:
    """One rig for all takes."""
    kind, most = FITS[fit]
    clips, hands, sources = zip(*((t.clip, t.hands, t.source) for t in takes), strict=True)
    return fit_rig(clips, hands, target, kind, most, sources)


@dataclass(frozen=True)
class Loss:
    """Errors over several takes: degrees RMS, fingertips in mm."""

    rms: float
    tips_mean: float
    tips_max: float

    @classmethod
    def of(cls, parts: Sequence[Errors], frames: Sequence[int]) -> Loss:
        """Put the errors of several takes together, by their numbers of frames."""
        weights = np.array(frames) / np.sum(frames)
        return cls(
            float(np.sqrt(weights @ [e.rms_deg**2 for e in parts])),
            float(weights @ [e.fingertip_mean for e in parts]),
            max(e.fingertip_max for e in parts),
        )


def loss(rig: ReducedRig, takes: Sequence[Take], which: str = "errors") -> Loss:
    """What a rig loses on takes, fitted or not."""
    done = [apply_rig(rig, t.clip, t.hands, t.source) for t in takes]
    return Loss.of([getattr(r, which) for r in done], [len(t.clip) for t in takes])


def single(takes: Sequence[Take], target: Target, fit: str) -> tuple[float, Loss]:
    """A rig for every take alone: mean number of free channels, mean of the takes' errors."""
    rigs = [fitted([t], target, fit) for t in takes]
    losses = [loss(rig, [t]) for rig, t in zip(rigs, takes, strict=True)]
    return float(np.mean([len(r.free) for r in rigs])), Loss(
        float(np.mean([x.rms for x in losses])),
        float(np.mean([x.tips_mean for x in losses])),
        max(x.tips_max for x in losses),
    )


def pca_on_others(fitted_to: Array, others: Array, components: int) -> float:
    """RMS error of curves in the subspace of other curves."""
    mean = fitted_to.mean(axis=0)
    axes = np.linalg.svd(fitted_to - mean, full_matrices=False)[2][:components]
    rest = (others - mean) - (others - mean) @ axes.T @ axes
    return float(np.sqrt(np.mean(rest**2)))


def table(heads: Sequence[str], rows: Sequence[Sequence[Any]]) -> None:
    """Print a Markdown table."""
    print("| " + " | ".join(heads) + " |")
    print("|---" * len(heads) + "|")
    for row in rows:
        cells = [f"{c:.2f}" if isinstance(c, float) else str(c) for c in row]
        print("| " + " | ".join(cells) + " |")
    print()


LOSS_HEADS = (
    "preset",
    "free of 50",
    *(f"RMS, {fit}" for fit in FITS),
    "RMS, PCA of that size",
    *(f"tips, {fit}: mean (max)" for fit in FITS),
)


def loss_row(preset: int, free: float | int, losses: Sequence[Loss], pca: float) -> tuple[Any, ...]:
    """Cells under `LOSS_HEADS`."""
    tips = (f"{x.tips_mean:.1f} ({x.tips_max:.0f})" for x in losses)
    shown = free if isinstance(free, int) else f"{free:.1f}"
    return (preset, shown, *(x.rms for x in losses), pca, *tips)


def print_presets(takes: Sequence[Take]) -> None:
    """Tables of the presets: single takes, all together, takes that were not fitted."""
    pooled = np.concatenate([t.curves for t in takes])
    print("**Every take alone** (means over the takes; max over all). Degrees, mm.\n")
    rows = []
    for preset, thresholds in PRESETS.items():
        found = [single(takes, Target(thresholds), fit) for fit in FITS]
        free = [len(fitted([t], Target(thresholds), "paper").free) for t in takes]
        pca = np.mean([pca_rms(t.curves, n) for t, n in zip(takes, free, strict=True)])
        rows.append(loss_row(preset, found[0][0], [x for _, x in found], float(pca)))
    table(LOSS_HEADS, rows)

    print("**One rig for all takes together.**\n")
    rows = []
    for preset, thresholds in PRESETS.items():
        rigs = [fitted(takes, Target(thresholds), fit) for fit in FITS]
        free = len(rigs[0].free)
        rows.append(loss_row(preset, free, [loss(r, takes) for r in rigs], pca_rms(pooled, free)))
    table(LOSS_HEADS, rows)

    known = [t for i, t in enumerate(takes) if i % 3 != 2]
    held = [t for i, t in enumerate(takes) if i % 3 == 2]
    print(
        f"**Takes that were not fitted**: one rig for {len(known)} takes, "
        f"errors on the other {len(held)} (every third by name).\n"
    )
    known_curves, held_curves = (np.concatenate([t.curves for t in g]) for g in (known, held))
    rows = []
    for preset, thresholds in PRESETS.items():
        rigs = [fitted(known, Target(thresholds), fit) for fit in FITS]
        free = len(rigs[0].free)
        pca = pca_on_others(known_curves, held_curves, free)
        rows.append(loss_row(preset, free, [loss(r, held) for r in rigs], pca))
    table(LOSS_HEADS, rows)

    rig = fitted(takes, Target(PRESETS[1]), "paper")
    model = loss(rig, takes, "model_errors")
    print(
        "**The model's own loss**: the 40 angles outside the 25 channels a hand, held at their "
        f"mean over all takes, differ by {model.rms:.2f} degrees RMS; fingertips "
        f"{model.tips_mean:.1f} mm (max {model.tips_max:.0f}).\n"
    )


def print_curve(takes: Sequence[Take]) -> None:
    """Table of errors by number of free channels."""
    print("**Error against number of channels**, one rig for all takes (`--target-dofs`).\n")
    pooled = np.concatenate([t.curves for t in takes])
    rows = []
    for count in COUNTS:
        rigs = [fitted(takes, Target(free_channels=count), fit) for fit in FITS]
        losses = [loss(r, takes) for r in rigs]
        rig = rigs[0]
        rows.append(
            (
                len(rig.free),
                f"{rig.range_threshold:.1f}, {rig.rmsd_threshold:.2f}",
                *(x.rms for x in losses),
                pca_rms(pooled, len(rig.free)),
                *(f"{x.tips_mean:.1f} ({x.tips_max:.0f})" for x in losses),
            )
        )
    table(("free", "range (deg), rmsd", *LOSS_HEADS[2:]), rows)


def main() -> None:
    """Read the takes and print every table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--data", type=Path, default=SAMPLES)
    folder: Path = parser.parse_args().data
    takes = [Take.read(p) for p in sorted(folder.glob("*.usd*"))]
    frames = sum(len(t.clip) for t in takes)
    print(f"{len(takes)} takes, {frames} frames.\n")
    parts: tuple[Callable[[Sequence[Take]], None], ...] = (print_presets, print_curve)
    for part in parts:
        part(takes)
    print("**Share of variance off the flexion axis**, each take about its own mean.\n")
    table(("joint", "left", "right"), off_axis_shares([t.source for t in takes]))
    other = folder.parent / "mini"
    if folder.name == "full" and other.is_dir():
        print("**The same takes on another rig** (`mini`), offset removed. Degrees RMS.\n")
        table(("channels", "hands", "median", "worst"), agreement_of_rigs(folder, other))


if __name__ == "__main__":
    main()
