"""Small BVH files for tests, and a plain reading of any: a matrix a channel, frame by frame."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

ARM = """HIERARCHY
ROOT Hips
{
  OFFSET 0 90 0
  CHANNELS 6 Xposition Yposition Zposition Zrotation Xrotation Yrotation
  JOINT Arm
  {
    OFFSET 10 40 0
    CHANNELS 3 Zrotation Xrotation Yrotation
    JOINT Hand
    {
      OFFSET 50 0 0
      CHANNELS 3 Zrotation Xrotation Yrotation
      End Site
      {
        OFFSET 8 0 0
      }
    }
  }
}
MOTION
Frames: 3
Frame Time: 0.0333333
0 91 0 10 20 30 40 50 60 1 2 3
1 92 0 11 21 31 41 51 61 4 5 6
2 93 0 12 22 32 42 52 62 7 8 9
"""


def written(folder: Path, text: str | bytes, name: str = "take.bvh") -> Path:
    path = folder / name
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    return path


def edited(folder: Path, *changes: tuple[str, str], text: str = ARM) -> Path:
    """The arm, or another text, with parts replaced; each must be there."""
    for old, new in changes:
        assert old in text, old
        text = text.replace(old, new)
    return written(folder, text)


def plain_positions(path: Path, frames: Sequence[int]) -> np.ndarray:
    """World positions (frames, joints, 3) in the file's units, joints and End Sites in its order.

    For files as they should be: tokens one after the other, 4 x 4 matrices, no cleverness.
    """
    words = path.read_text().split()
    motion = words.index("MOTION")
    parents: list[int] = []
    offsets: list[list[float]] = []
    channels: list[list[str]] = []
    stack: list[int] = []
    for i, word in enumerate(words[:motion]):
        if word in ("ROOT", "JOINT", "End"):
            parents.append(stack[-1] if stack else -1)
            channels.append([])
            stack.append(len(parents) - 1)
        elif word == "OFFSET":
            offsets.append([float(w) for w in words[i + 1 : i + 4]])
        elif word == "CHANNELS":
            count = int(words[i + 1])
            channels[stack[-1]] = words[i + 2 : i + 2 + count]
        elif word == "}":
            stack.pop()
    numbers = [float(w) for w in words[words.index("Time:", motion) + 2 :]]
    width = sum(map(len, channels))
    found = []
    for frame in frames:
        row = iter(numbers[frame * width : (frame + 1) * width])
        world: list[np.ndarray] = []
        for parent, offset, own in zip(parents, offsets, channels, strict=True):
            place, turn = np.array(offset), np.eye(3)
            for channel in own:
                axis, value = "XYZ".index(channel[0]), next(row)
                if channel.endswith("position"):
                    place[axis] = value
                else:
                    turn = turn @ turn_about(axis, value)
            local = np.eye(4)
            local[:3, :3], local[:3, 3] = turn, place
            world.append(local if parent < 0 else world[parent] @ local)
        found.append([m[:3, 3] for m in world])
    return np.array(found)


def turn_about(axis: int, degrees: float) -> np.ndarray:
    c, s = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
    i, j = (axis + 1) % 3, (axis + 2) % 3
    matrix = np.eye(3)
    matrix[i, i] = matrix[j, j] = c
    matrix[i, j], matrix[j, i] = -s, s
    return matrix
