"""Two motions compared: joints, channels, fingertips, smoothness and timing."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from usdhand.anatomy.channels import Hands
from usdhand.display import displayed
from usdhand.errors import UsageError
from usdhand.motion import Clip, Skeleton
from usdhand.motion import rotations as rot
from usdhand.motion.resample import interpolate, interpolate_rotations
from usdhand.motion.rotations import Array

LONGEST_LAG_S = 2.0
# Channels that change less than this tell nothing about timing.
LEAST_RANGE_DEG = 1.0


@displayed(
    lambda found: {
        "frames": found.frames,
        "joints": len(found.joints),
        "channels": len(found.channels),
        "rms_deg": found.rms_deg,
        "max_deg": found.max_deg,
        "fingertip_mean": found.fingertip_mean,
        "lag": found.lag,
    }
)
@dataclass(frozen=True, eq=False)
class Comparison:
    """How motion B differs from motion A, over the time that both last.

    Attributes
    ----------
    joints : joints with the same name in both; ``joint_rms``, ``joint_max`` their angle, degrees
    channels : hand channels in both; ``channel_rms``, ``channel_max`` their difference, degrees
    fingertip_mean, fingertip_max : mm, relative to the wrist, in the axes of the palm
    jerk : RMS third derivative of the channels of A and of B, degrees / s^3
    lag : seconds by which B's hands are late (None where they hardly move)
    frames : compared, at A's frame rate
    """

    joints: tuple[str, ...]
    joint_rms: Array
    joint_max: Array
    channels: tuple[str, ...]
    channel_rms: Array
    channel_max: Array
    fingertip_mean: float
    fingertip_max: float
    jerk: tuple[float, float]
    lag: float | None
    frames: int

    @property
    def rms_deg(self) -> float:
        """RMS over the compared channels, degrees."""
        return float(np.sqrt(np.mean(self.channel_rms**2)))

    @property
    def max_deg(self) -> float:
        """Largest difference of a channel, degrees."""
        return float(self.channel_max.max())


def compare_clips(
    a: Clip, b: Clip, hands_a: Hands, hands_b: Hands, align: bool = False
) -> Comparison:
    """Compare B with A, both from their first frame on.

    Parameters
    ----------
    align : shift B by the lag that was found before comparing

    Raises
    ------
    UsageError
        if the clips have no hand channel in common.
    """
    channels_a, channels_b = hands_a.encode(a), hands_b.encode(b)
    names = tuple(n for n in channels_a.names if n in set(channels_b.names))
    if not names:
        raise UsageError(f"{a.name} and {b.name} have no hand joint in common.")
    curves_a = channels_a.select(names).values
    curves_b = channels_b.select(names).values
    lag = find_lag(curves_a, _at_rate(curves_b, b.fps, a.fps), a.fps)
    shift = (lag or 0.0) if align else 0.0
    first, count = _overlap(a, b, shift)
    at_a = np.arange(first, first + count, dtype=np.float64)
    at_b = np.asarray(at_a * (b.fps / a.fps) + shift * b.fps)
    span = slice(first, first + count)

    difference = interpolate(curves_b, at_b) - curves_a[span]
    difference -= 360.0 * np.rint(difference / 360.0)  # by the shorter way round
    joints, angles = _joint_angles(a, b, span, at_b)
    tips_a, tips_b = _common_tips(a, b, hands_a, hands_b)
    distance = 10.0 * np.linalg.norm(interpolate(tips_b, at_b) - tips_a[span], axis=-1)
    return Comparison(
        joints,
        np.sqrt(np.mean(angles**2, axis=0)),
        angles.max(axis=0, initial=0.0),
        names,
        np.sqrt(np.mean(difference**2, axis=0)),
        np.abs(difference).max(axis=0),
        float(distance.mean()),
        float(distance.max()),
        (rms_jerk(curves_a, a.fps), rms_jerk(curves_b, b.fps)),
        lag,
        count,
    )


def find_lag(a: Array, b: Array, fps: float) -> float | None:
    """Seconds by which curves B (frames, n) are late, the shift with the least RMS difference.

    Constant offsets do not matter. Refined below a frame by a parabola through the best three.
    """
    if (
        min(len(a), len(b)) < 8
        or max(np.ptp(a, axis=0).max(), np.ptp(b, axis=0).max()) < LEAST_RANGE_DEG
    ):
        return None
    most = min(int(LONGEST_LAG_S * fps), min(len(a), len(b)) // 2)
    shifts = np.arange(-most, most + 1)
    costs = _variances_of_difference(a, b, shifts)
    best = int(np.argmin(costs))
    fraction = 0.0
    if 0 < best < len(costs) - 1:
        low, mid, high = costs[best - 1 : best + 2]
        bend = low - 2 * mid + high
        fraction = 0.5 * (low - high) / bend if bend > 0 else 0.0
    return float((shifts[best] + fraction) / fps)


def _variances_of_difference(a: Array, b: Array, shifts: NDArray[np.intp]) -> Array:
    """Mean variance of ``b[t + shift] - a[t]`` over the curves, where both are, for every shift.

    Sums over the overlap are differences of running sums, products come from Fourier transforms.
    """
    a, b = a - a.mean(axis=0), b - b.mean(axis=0)
    start, end = np.maximum(0, -shifts), np.minimum(len(a), len(b) - shifts)
    count = (end - start)[:, None]

    def sums(curves: Array, first: NDArray[np.intp], last: NDArray[np.intp]) -> Array:
        running = np.concatenate([np.zeros((1, curves.shape[1])), np.cumsum(curves, axis=0)])
        return np.asarray(running[last] - running[first])

    size = len(a) + len(b)
    spectrum = np.fft.rfft(b, size, axis=0) * np.conj(np.fft.rfft(a, size, axis=0))
    products = np.fft.irfft(spectrum, size, axis=0)[shifts]
    squares = sums(a**2, start, end) + sums(b**2, start + shifts, end + shifts) - 2 * products
    total = sums(b, start + shifts, end + shifts) - sums(a, start, end)
    return np.asarray((squares / count - (total / count) ** 2).mean(axis=1))


def rms_jerk(curves: Array, fps: float) -> float:
    """RMS third derivative of curves (frames, n), in their unit / s^3; 0 for under 4 frames."""
    if len(curves) < 4:
        return 0.0
    return float(np.sqrt(np.mean((np.diff(curves, n=3, axis=0) * fps**3) ** 2)))


def _overlap(a: Clip, b: Clip, shift: float) -> tuple[int, int]:
    """First frame of A and number of frames for which B, late by ``shift`` s, has motion."""
    first = max(0, int(np.ceil(-shift * a.fps - 1e-6)))
    last = min(len(a) - 1, int(np.floor((b.duration - shift) * a.fps + 1e-6)))
    if last < first:
        raise UsageError(f"{a.name} and {b.name} do not overlap in time.")
    return first, last - first + 1


def _at_rate(curves: Array, fps: float, wanted: float) -> Array:
    if abs(fps - wanted) < 1e-6:
        return curves
    count = int(np.floor((len(curves) - 1) * wanted / fps + 1e-6)) + 1
    return interpolate(curves, np.arange(count, dtype=np.float64) * (fps / wanted))


def _joint_angles(a: Clip, b: Clip, span: slice, at_b: Array) -> tuple[tuple[str, ...], Array]:
    """Angle (frames, n) between local rotations of joints with the same, unique name."""
    joints_a, joints_b = _unique_joints(a.skeleton), _unique_joints(b.skeleton)
    names = [name for name in joints_a if name in joints_b]
    if not names:
        return (), np.empty((len(at_b), 0))
    in_a, in_b = [joints_a[n] for n in names], [joints_b[n] for n in names]
    other = interpolate_rotations(b.rotations[:, in_b], at_b)
    return tuple(names), rot.angle_between(a.rotations[span, in_a], other)


def _unique_joints(skeleton: Skeleton) -> dict[str, int]:
    """Joints by their leaf names, those whose name no other joint has."""
    count = Counter(skeleton.names)
    return {name: joint for joint, name in enumerate(skeleton.names) if count[name] == 1}


def _common_tips(a: Clip, b: Clip, hands_a: Hands, hands_b: Hands) -> tuple[Array, Array]:
    sides = [s for s in hands_a.frames if s in hands_b.frames]

    def tips(clip: Clip, hands: Hands, others: Hands) -> Array:
        only = replace(hands, frames={s: hands.frames[s] for s in sides})
        keep = [digit in others.frames[s].digits for s in sides for digit in hands.frames[s].digits]
        return only.fingertips(clip)[:, keep]

    return tips(a, hands_a, hands_b), tips(b, hands_b, hands_a)
