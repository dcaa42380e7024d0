"""Versions of the encoding of reduced rigs, and what those of each may be used for."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from pxr import Usd

from usdhand.errors import InputError

# 2: the thumb's channels are about the axes of a pronated thumb.
VERSION = 2
# Older versions, whose channels mean something with the frames stored beside them alone.
OWN_FRAMES_ONLY = (1,)


def rig_version(prim: Usd.Prim) -> Any:
    """The version that a rig says it has, of whatever type it is."""
    return prim.GetAttribute("usdhand:version").Get()


def check_version(version: Any, path: Path, *, with_frames: bool = False) -> None:
    """Refuse a rig that means other channels than those of today.

    ``with_frames``: it is used with the frames that are stored beside it.

    Raises
    ------
    InputError
        if the rig is of such a version.
    """
    if version not in (*OWN_FRAMES_ONLY, VERSION):
        raise InputError(
            f"{path}: the rig has version {version}, this usdhand reads version {VERSION}."
        )
    if version in OWN_FRAMES_ONLY and not with_frames:
        raise InputError(
            f"{path}: the rig has version {version}, whose thumbs are measured about other axes: "
            "it can be expanded on its own character only. 'usdhand reduce CLIP -o RIG' fits it "
            "again."
        )
