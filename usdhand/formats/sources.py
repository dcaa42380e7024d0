"""What a clip was read from, and the character that it is written over."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from usdhand.errors import InputError
from usdhand.formats.usd.character import character_of
from usdhand.formats.usd.names import legal_skeleton
from usdhand.formats.usd.stage import Character, ClosedCharacter
from usdhand.motion import Clip


@dataclass(frozen=True, eq=False)
class ClipAsRead:
    """A clip as it was read from a file that is not USD; whether that file had motion for it."""

    clip: Clip
    animated: bool


def remembered(clip: Clip, *, animated: bool) -> Clip:
    """Return a clip that keeps, as its source, how it is now."""
    clip = replace(clip, source=None)
    return replace(clip, source=ClipAsRead(clip, animated))


def character_under(clip: Clip, *, animated: bool = False) -> Character:
    """Return the character that a clip is written over.

    That is the one on the stage that it was read from. For a clip that comes from another format,
    it is made of the clip as it was read; for one that was made in memory, of the clip itself,
    with its motion if ``animated``.

    Raises
    ------
    InputError
        if its file was written anew since and is without the character now, or joints of a clip
        that was made in memory stand before their parents.
    """
    source = clip.source
    if isinstance(source, Character):
        return _still_there(source)
    if isinstance(source, ClosedCharacter):
        return source.opened()
    if isinstance(source, ClipAsRead):
        return character_of(source.clip, animated=source.animated)
    return character_of(_checked(clip), animated=animated)


def _still_there(character: Character) -> Character:
    parts = [p for p in (character.skeleton, character.animation) if p is not None]
    if not all(part.IsValid() for part in parts):
        raise InputError(
            f"{character.path}: the file was written anew since the clip was read. Read it again."
        )
    return character


def _checked(clip: Clip) -> Clip:
    skeleton = clip.skeleton
    early = np.flatnonzero(skeleton.parents > np.arange(len(skeleton)))
    if len(early):
        joint = skeleton.joints[int(early[0])]
        raise InputError(
            f"{clip.name}: the joint {joint} stands before its parent. List parents first."
        )
    return replace(clip, skeleton=legal_skeleton(skeleton))
