"""What reduction loses on a folder of takes, as Markdown tables for the documentation.

    python benchmarks/reduce_takes.py [--data FOLDER] [--others FOLDER_OR_FILE ...] [--part PART]

Without a folder: the samples' gestures. Errors in degrees are RMS over the 50 modelled channels,
errors in millimetres are distances of the ten fingertips, both against the same motion with the
angles outside the model held; what holding them loses is a table of its own. Rigs fitted to the
takes are applied to the others as well.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from hand_agreement import agreement_of_rigs, off_axis_shares

from usdhand import find_hands, read_clip
from usdhand.anatomy.channels import Channels, Hands
from usdhand.motion import Clip
from usdhand.motion.rotations import Array
from usdhand.reduce.choose import subsets
from usdhand.reduce.curve import error_curve
from usdhand.reduce.errors import Errors, pca_rms
from usdhand.reduce.evidence import Takes, gather
from usdhand.reduce.fit import Statistics
from usdhand.reduce.method import apply_rig, fit_to
from usdhand.reduce.rig import ReducedRig
from usdhand.reduce.search import thresholds_for_count
from usdhand.reduce.settings import PRESETS, Criteria, Fit, Target
from usdhand.verbs.files import find_files

SAMPLES = Path(__file__).resolve().parent.parent / "samples" / "gestures"
FITS: dict[str, tuple[Fit, int]] = {
    "paper": ("paper", 1),
    "least squares": ("least-squares", 1),
    "up to 3 controllers": ("least-squares", 3),
}
COUNTS = range(5, 55, 5)
# Best channels and thresholds searched for the same number: label -> most controllers.
BEST: dict[str, int | None] = {"best": None, "best, at most 3": 3, "best, 1": 1}
SEARCHED: dict[str, int] = {"searched, at most 3": 3, "searched, 1": 1}


def files(folder: Path) -> list[Path]:
    """A folder's clips, by name."""
    return find_files([str(folder)])


@dataclass(eq=False)
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

    @cached_property
    def curves(self) -> Array:
        """(frames, 50) degrees."""
        return self.source.select(self.hands.model_names).values

    @cached_property
    def evidence(self) -> Takes:
        """What a fit to this take alone needs."""
        return gather([(self.clip, self.hands, self.source)])

    def missed(self, rig: ReducedRig) -> float:
        """Mean squared error of a rig in degrees."""
        given = rig.evaluate(rig.on_turn(self.source.select(rig.free))).select(rig.names).values
        away = given - self.source.select(rig.names).values
        return float(np.mean((away - 360.0 * np.rint(away / 360.0)) ** 2))


def together(takes: Sequence[Take]) -> Takes:
    """What a fit to all takes needs."""
    return gather((t.clip, t.hands, t.source) for t in takes)


def fitted(evidence: Takes, target: Target, fit: str) -> ReducedRig:
    """One rig by the paper's rules."""
    kind, most = FITS[fit]
    return fit_to(evidence, target, kind, most)


def best(
    evidence: Takes, count: int, most: int | None = None, choice: Criteria | None = None
) -> ReducedRig:
    """One rig of the best channels."""
    return fit_to(evidence, Target(free_channels=count), "least-squares", most, choice)


def searched(evidence: Takes, count: int, most: int) -> ReducedRig:
    """One rig by the paper's rules, with thresholds searched for the count."""
    statistics = Statistics.from_moments(evidence.moments)
    target = Target(thresholds_for_count(statistics, count, "least-squares"))
    return fit_to(evidence, target, "least-squares", most)


def rms(rig: ReducedRig, takes: Sequence[Take]) -> float:
    """RMS degrees over takes."""
    weights = [len(t.clip) for t in takes]
    return float(np.sqrt(np.average([t.missed(rig) for t in takes], weights=weights)))


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
    rigs = [fitted(t.evidence, target, fit) for t in takes]
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
        free = [len(fitted(t.evidence, Target(thresholds), "paper").free) for t in takes]
        pca = np.mean([pca_rms(t.curves, n) for t, n in zip(takes, free, strict=True)])
        rows.append(loss_row(preset, found[0][0], [x for _, x in found], float(pca)))
    table(LOSS_HEADS, rows)

    print("**One rig for all takes together.**\n")
    evidence = together(takes)
    rows = []
    for preset, thresholds in PRESETS.items():
        rigs = [fitted(evidence, Target(thresholds), fit) for fit in FITS]
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
    evidence = together(known)
    rows = []
    for preset, thresholds in PRESETS.items():
        rigs = [fitted(evidence, Target(thresholds), fit) for fit in FITS]
        free = len(rigs[0].free)
        pca = pca_on_others(known_curves, held_curves, free)
        rows.append(loss_row(preset, free, [loss(r, held) for r in rigs], pca))
    table(LOSS_HEADS, rows)

    rig = fitted(together(takes), Target(PRESETS[1]), "paper")
    model = loss(rig, takes, "model_errors")
    print(
        "**The model's own loss**: the 40 angles outside the 25 channels a hand, held at their "
        f"mean over all takes, differ by {model.rms:.2f} degrees RMS; fingertips "
        f"{model.tips_mean:.1f} mm (max {model.tips_max:.0f}).\n"
    )


def print_alone(takes: Sequence[Take]) -> None:
    """Table of every take alone: best channels, and thresholds searched for the same count."""
    print("**Every take alone**, so many channels free (means over the takes). Degrees RMS.\n")
    rows = []
    for count in (6, 10, 15, 20):
        pca = float(np.mean([pca_rms(t.curves, count) for t in takes]))
        cells: list[Any] = [count, pca]
        cells += [
            float(np.mean([rms(best(t.evidence, count, n), [t]) for t in takes]))
            for n in BEST.values()
        ]
        cells += [
            float(np.mean([rms(searched(t.evidence, count, n), [t]) for t in takes]))
            for n in SEARCHED.values()
        ]
        rows.append(cells)
    table(("free", "PCA", *BEST, *SEARCHED), rows)
    needed = [_for_one_degree(t.evidence) for t in takes]
    own, pca_count = (float(np.mean([n[k] for n in needed])) for k in (0, 1))
    print(
        f"For 1 degree RMS a take needs {own:.1f} free channels (mean), PCA {pca_count:.1f} "
        f"components: {own / pca_count:.2f} times as many.\n"
    )


def _for_one_degree(evidence: Takes) -> tuple[int, int]:
    """Fewest free channels, and components of PCA, with 1 degree RMS."""
    variances = np.linalg.eigvalsh(evidence.moments.covariance)[::-1]
    left = np.sqrt(np.maximum(variances.sum() - np.cumsum([0.0, *variances]), 0.0) / 50)
    components = int(np.argmax(left <= 1.0))
    search = subsets(evidence, Criteria())
    for count in range(components, len(search.groups) + 1):
        residual = search.residual(search.best(count))
        if np.sqrt(np.diag(residual).mean()) <= 1.0:
            return count, components
    return len(evidence.names), components


def print_others(takes: Sequence[Take], others: Sequence[Path]) -> None:
    """Tables of one rig for two thirds of the takes, on the last third and on other motion."""
    known = [t for i, t in enumerate(takes) if i % 3 != 2]
    groups = {"left out": [t for i, t in enumerate(takes) if i % 3 == 2]}
    for folder in others:
        paths = files(folder)
        if folder.resolve() == SAMPLES:
            paths = paths[2::3]  # constants were chosen on the others: `reduce_constants.py`
        groups[folder.name] = [t for t in map(Take.read, paths) if _fits(t, known[0])]
    known_curves = np.concatenate([t.curves for t in known])
    print(
        f"**One rig for {len(known)} takes**, so many channels free: on these, on the other "
        f"{len(groups['left out'])} (every third by name)"
        + "".join(f", on {len(g)} of `{n}`" for n, g in list(groups.items())[1:])
        + ". Degrees RMS.\n"
    )
    groups = {"fitted": known, **groups}
    evidence = together(known)
    rows: list[list[Any]] = []
    for count in (10, 15, 20, 25):
        rigs = {label: best(evidence, count, n) for label, n in BEST.items()}
        rigs |= {label: searched(evidence, count, n) for label, n in SEARCHED.items()}
        for name, group in groups.items():
            curves = np.concatenate([t.curves for t in group])
            pca = pca_on_others(known_curves, curves, count)
            rows.append([count, name, pca, *(rms(r, group) for r in rigs.values())])
    table(("free", "on", "PCA", *BEST, *SEARCHED), rows)

    print("**The fingertips**, one rig for the same takes, 15 channels free. Mean mm.\n")
    rigs = {
        "best by deg": best(evidence, 15),
        "best by mm": best(evidence, 15, None, Criteria("mm")),
        **{label: searched(evidence, 15, n) for label, n in SEARCHED.items()},
    }
    table(
        ("on", *rigs),
        [[n, *(loss(r, g).tips_mean for r in rigs.values())] for n, g in groups.items()],
    )


def _fits(take: Take, other: Take) -> bool:
    return take.hands.model_names == other.hands.model_names


def print_curve(takes: Sequence[Take]) -> None:
    """Table of errors by number of free channels, one rig for all takes."""
    print("**Error against number of channels**, one rig for all takes (`--target-dofs`).\n")
    curve = error_curve(together(takes))
    rows = []
    for point in curve.points:
        cells: list[Any] = [point.channels]
        for found in (point.fitted, point.left_out, point.pca, point.pca_left_out):
            cells += ["", ""] if found is None else [found.deg, found.mm]
        rows.append(cells)
    heads = ("fitted", "left out", "PCA", "PCA, left out")
    table(("free", *(f"{h}, {unit}" for h in heads for unit in ("deg", "mm RMS"))), rows)
    print(f"Suggested number of channels (the knee): {curve.suggested}.\n")


def main() -> None:
    """Read the takes and print every table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--data", type=Path, default=SAMPLES)
    parser.add_argument("--others", type=Path, nargs="*", default=[])
    parser.add_argument("--part", choices=("best", "presets"), help="one half of the tables alone")
    given = parser.parse_args()
    folder: Path = given.data
    takes = [Take.read(p) for p in files(folder)]
    frames = sum(len(t.clip) for t in takes)
    print(f"{len(takes)} takes, {frames} frames.\n")
    if given.part != "presets":
        print_alone(takes)
        print_others(takes, given.others)
        print_curve(takes)
    if given.part == "best":
        return
    print_presets(takes)
    print("**Share of variance off the flexion axis**, each take about its own mean.\n")
    table(("joint", "left", "right"), off_axis_shares([t.source for t in takes]))
    other = folder.parent / "mini"
    if folder.name == "full" and other.is_dir():
        print("**The same takes on another rig** (`mini`), offset removed. Degrees RMS.\n")
        table(("channels", "hands", "median", "worst"), agreement_of_rigs(folder, other))


if __name__ == "__main__":
    main()
