"""Real takes of the shared data that several rooms read, by their paths there."""

from __future__ import annotations

USD_TAKES = (
    "studiogalt/full/SG_ASL_7_2023_1_29.usdc",  # several roots
    "studiogalt/mini/SG_ASL_10_Alt_2023_1_28.usdc",
    "maya/HIK_Export.usda",
)
BVH_TAKES = (
    "bvh/animated-drawings/jesse_dance.bvh",
    "bvh/animated-drawings/jumping_jacks.bvh",
    "bvh/animated-drawings/wave_hello.bvh",
    "bvh/performs/Idle.bvh",
)
