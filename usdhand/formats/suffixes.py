"""Which files are read and written, told by their suffix."""

from __future__ import annotations

USD_SUFFIXES = (".usd", ".usda", ".usdc", ".usdz")
# Suffix -> package of the reader and writer; each is imported when such a file is met.
FORMATS = {
    ".bvh": "usdhand.formats.bvh",
    ".glb": "usdhand.formats.gltf",
    ".gltf": "usdhand.formats.gltf",
    ".vrm": "usdhand.formats.gltf",
    ".vrma": "usdhand.formats.gltf",
    ".fbx": "usdhand.formats.fbx",
}
READABLE = (*USD_SUFFIXES, *FORMATS)
WRITABLE = (*USD_SUFFIXES, ".bvh", ".glb", ".gltf")

# What to do about a file with several animations; only convert has the option.
CHOOSE_ANIMATION = (
    "'usdhand convert FILE --animation NAME -o OUT.usdc' takes one of them, --out-dir DIR all."
)
