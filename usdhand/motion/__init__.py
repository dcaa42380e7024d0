"""Motion as values: skeletons, clips, forward kinematics, rotations, resampling."""

from usdhand.motion.clip import Clip, Origin
from usdhand.motion.kinematics import Pose, forward_kinematics
from usdhand.motion.resample import resample
from usdhand.motion.skeleton import Skeleton, leaf_name, parents_from_paths

__all__ = [
    "Clip",
    "Origin",
    "Pose",
    "Skeleton",
    "forward_kinematics",
    "leaf_name",
    "parents_from_paths",
    "resample",
]
