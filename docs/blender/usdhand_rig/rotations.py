"""From three channel angles to a bone's rotation, as expressions that Blender evaluates itself.

The rotation of a hand joint is ``reference frame * channels * inverse of joint frame``. It is
linear in the components of the channels' quaternion, so each component of a bone's quaternion is a
sum of a few products of sines. Blender computes such "simple expressions" without Python: they are
fast, and work where Auto Run Python Scripts is off and where this add-on is not installed.

Quaternions are numpy arrays (x, y, z, w); angles are degrees: a abduction, f flexion, t rotation
about the bone.
"""

import numpy as np

# Abduction and rotation about the bone are mirrored on the left hand.
MIRROR = np.diag([-1.0, 1.0, -1.0, 1.0])
LONGEST = 255  # what Blender keeps of an expression


def expressions(before: np.ndarray, after: np.ndarray, side: str, ball: bool) -> list[str]:
    """Expressions in a, f, t of w, x, y, z of ``before * channels * after``.

    Parameters
    ----------
    before, after : (4,) constant rotations
    side : "left" or "right"
    ball : swing and twist (the thumb's CMC) rather than flexion, then abduction, then rotation
    """
    matrix = left_product(before) @ right_product(after)
    if side == "left":
        matrix = matrix @ MIRROR
    component = swing_twist if ball else euler
    return [component(matrix[i]) for i in (3, 0, 1, 2)]


def euler(row: np.ndarray) -> str:
    """One component, a ``row`` (4,) times the quaternion of R_y(f) R_x(a) R_z(t)."""
    x, y, z, w = row * np.sqrt(0.5)
    # Of sine and cosine of (f - t) / 2, then of (f + t) / 2.
    minus, minus_phase = wave(y - z, x + w)
    plus, plus_phase = wave(y + z, w - x)
    return (
        f"{minus:.8f}*sin(radians(45+a/2))*sin(radians((f-t)/2{minus_phase:+.6f}))"
        f"{plus:+.8f}*cos(radians(45+a/2))*sin(radians((f+t)/2{plus_phase:+.6f}))"
    )


def swing_twist(row: np.ndarray) -> str:
    """One component, a ``row`` (4,) times the quaternion of a twist t, then a swing (a, f)."""
    x, y, z, w = row
    along, along_phase = wave(z, w)
    across, across_phase = wave(x, y)
    swing, turn = "sqrt(a*a+f*f)", f"radians(t/2{across_phase:+.6f})"
    return (
        f"{along:.8f}*cos(radians({swing}/2))*sin(radians(t/2{along_phase:+.6f}))"
        f"{across:+.8f}*sin(radians({swing}/2))/max({swing},0.000001)"
        f"*(a*cos({turn})+f*sin({turn}))"
    )


def wave(sine: float, cosine: float) -> tuple[float, float]:
    """Amplitude and phase in degrees: ``sine * sin(u) + cosine * cos(u) = A * sin(u + phase)``."""
    return float(np.hypot(sine, cosine)), float(np.degrees(np.arctan2(cosine, sine)))


def left_product(q: np.ndarray) -> np.ndarray:
    """Matrix (4, 4) that multiplies a quaternion by ``q`` from the left."""
    x, y, z, w = q
    return np.array([[w, -z, y, x], [z, w, -x, y], [-y, x, w, z], [-x, -y, -z, w]])


def right_product(q: np.ndarray) -> np.ndarray:
    """Matrix (4, 4) that multiplies a quaternion by ``q`` from the right."""
    x, y, z, w = q
    return np.array([[w, z, -y, x], [-z, w, x, y], [y, -x, w, z], [-x, -y, -z, w]])


def conjugate(q: np.ndarray) -> np.ndarray:
    """Inverse of a unit quaternion."""
    return q * [-1.0, -1.0, -1.0, 1.0]
