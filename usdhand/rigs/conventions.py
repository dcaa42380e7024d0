"""How rigs name their joints: the conventions of ``conventions.toml`` and of users' map files."""

from __future__ import annotations

import re
import tomllib
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cache, cached_property
from importlib import resources
from pathlib import Path
from typing import Any, TypeGuard

from usdhand.anatomy.hand import (
    ARM_JOINTS,
    BODY_JOINTS,
    DIGITS,
    FINGERS,
    HAND_JOINTS,
    SIDES,
    Side,
    digit_joints,
)
from usdhand.anatomy.neutral import Neutral
from usdhand.display import displayed
from usdhand.errors import UsageError
from usdhand.inputs import read_text

Table = dict[str, Any]
Names = tuple[str, ...]

# Roles beside the fifteen joints: "IndexMetacarpal", "ThumbTip"; "ThumbCarpal" lies before the CMC.
METACARPALS: dict[str, str] = {d: f"{d}Metacarpal" for d in FINGERS}
TIPS: dict[str, str] = {d: f"{d}Tip" for d in DIGITS}
THUMB_CARPAL = "ThumbCarpal"
HAND_ROLES: tuple[str, ...] = (
    *ARM_JOINTS,
    *HAND_JOINTS,
    *METACARPALS.values(),
    *TIPS.values(),
    THUMB_CARPAL,
)

MOST_BYTES = 1_000_000  # of a map file
MOST_DOTS = 100  # in a line of one
LONGEST = 100  # characters of a value in a message

_SETTINGS = ("about", "like", "side", "digit", "prefix", "pronation")
_SHORTHANDS = ("thumb", "thumb_tip", "thumb_carpal", "finger", "metacarpal", "tip")
_KEYS = {*_SETTINGS, *_SHORTHANDS, *BODY_JOINTS, *HAND_ROLES}


def name_key(name: str) -> str:
    """Spelling-free form of a joint name: letters and digits only, in lower case.

    Exporters turn separators into others or drop them, so ``hand.L``, ``hand_L`` and ``HandL``
    are one name. Maya writes them into FBX as codes: ``handFBXASC046L``.
    """
    if "FBXASC" in name:
        name = re.sub(r"FBXASC\d{3}", "", name)
    return "".join(filter(str.isalnum, name)).lower()


@displayed(
    lambda convention: {
        "name": convention.name,
        "sides": tuple(convention.hands),
        "body": len(convention.body),
        "own": convention.own,
    }
)
@dataclass(frozen=True)
class Convention:
    """The joint names of one kind of rig.

    Attributes
    ----------
    name : the table's name
    hands : side -> role ("wrist", "IndexMCP", "IndexTip") -> alternative names; the only side is
        None where names do not tell the side
    body : "hips", "chest", ... -> alternative names
    prefixes : prefixes that belong to the convention, most wanted first
    own : True for a convention from a user's file
    pronation : how far the thumb is turned about its bone at the bind pose, from one that is flat,
        degrees; None if rigs with such names differ
    """

    name: str
    hands: Mapping[Side | None, Mapping[str, Names]]
    body: Mapping[str, Names]
    prefixes: Names = ()
    own: bool = False
    pronation: float | None = None

    @cached_property
    def hand_keys(self) -> Mapping[Side | None, Mapping[str, Names]]:
        """``hands`` with the names' spelling-free forms."""
        return {side: _keys(roles) for side, roles in self.hands.items()}

    @cached_property
    def sideless_keys(self) -> Mapping[Side | None, Mapping[str, Names]]:
        """``hand_keys`` without the words for the side; empty where names have none."""
        return {
            side: {role: tuple(without_side(n)[1] for n in names) for role, names in roles.items()}
            for side, roles in self.hands.items()
            if side is not None
        }

    @cached_property
    def body_keys(self) -> Mapping[str, Names]:
        """``body`` with the names' spelling-free forms."""
        return _keys(self.body)

    @cached_property
    def prefix_keys(self) -> Names:
        """Spelling-free forms of ``prefixes``."""
        return tuple(name_key(p) for p in self.prefixes)


@displayed(
    lambda found: {
        "conventions": [convention.name for convention in found.conventions],
        "explicit": found.explicit,
    }
)
@dataclass(frozen=True)
class Conventions:
    """All conventions in order of preference, and joints that a user named one by one.

    ``explicit`` holds the tables ``[left]``, ``[right]``, ``[body]`` of map files: role -> joint.
    ``neutral`` is a pose that hands are measured from in place of their bind pose.
    """

    conventions: tuple[Convention, ...]
    explicit: Mapping[str, Mapping[str, str]] = field(default_factory=dict)
    neutral: Neutral | None = None


def load_conventions(*extra: str | Path | Mapping[str, Mapping[str, Any]]) -> Conventions:
    """Return the packaged conventions with a user's on top of them.

    Parameters
    ----------
    extra : map files, or tables as such a file has them; later ones override earlier ones, and all
        override the package

    Raises
    ------
    UsageError
        if a file cannot be read or a key is wrong; the message names both.
    """
    if not extra:
        return _packaged()
    tables = dict(_packaged_tables())
    own: dict[str, str] = {}  # convention -> its file, the latest file first
    explicit: dict[str, dict[str, str]] = {}
    for given in extra:
        source = "conventions" if isinstance(given, Mapping) else str(given)
        for name, table in (given if isinstance(given, Mapping) else _read(given)).items():
            where = f"{source}: [{name}]"
            if not isinstance(table, Mapping):
                raise UsageError(f"{source}: '{name}' is outside a table; see {_EXAMPLE}")
            if name in (*SIDES, "body"):
                explicit.setdefault(name, {}).update(_explicit(table, name, where))
            else:
                _check(table, where)
                tables[name] = dict(table)
                own = {name: source} | {n: p for n, p in own.items() if n != name}
    user = tuple(_convention(name, tables, file, own=True) for name, file in own.items())
    packaged = tuple(c for c in _packaged().conventions if c.name not in own)
    return Conventions((*user, *packaged), explicit)


_EXAMPLE = "usdhand/rigs/conventions.toml for the format"


@cache
def _packaged_tables() -> dict[str, Table]:
    text = resources.files("usdhand.rigs").joinpath("conventions.toml").read_text("utf-8")
    return tomllib.loads(text)


@cache
def _packaged() -> Conventions:
    tables = _packaged_tables()
    return Conventions(tuple(_convention(name, tables, "conventions.toml") for name in tables))


def _read(path: str | Path) -> Table:
    try:
        return tomllib.loads(_checked_text(read_text(Path(path), MOST_BYTES)))
    except OSError as error:
        raise UsageError(f"{path}: cannot be read: {error.strerror}") from error
    except (tomllib.TOMLDecodeError, UnicodeDecodeError, _TooLongError) as error:
        raise UsageError(f"{path}: is not valid TOML: {error}") from error
    except RecursionError as error:
        raise UsageError(f"{path}: its values are nested too deeply") from error


class _TooLongError(Exception):
    """What no map file has and the parser would need gigabytes for."""


def _checked_text(text: str) -> str:
    """Refuse dotted keys of many parts, whose memory grows with the square of their length."""
    for number, line in enumerate(text.splitlines(), 1):
        if line.count(".") > MOST_DOTS and not line.lstrip().startswith("#"):
            raise _TooLongError(f"more than {MOST_DOTS} dots in line {number}")
    return text


def _explicit(table: Mapping[str, Any], name: str, where: str) -> dict[str, str]:
    allowed = BODY_JOINTS if name == "body" else HAND_ROLES
    for key, value in table.items():
        if key not in allowed:
            raise UsageError(
                f"{where} {_short(key)}: unknown joint; use one of {', '.join(allowed)}"
            )
        if not isinstance(value, str) or not value:
            raise UsageError(f"{where} {key}: must be the name of a joint, not {_short(value)}")
    return dict(table)


def _check(table: Mapping[str, Any], where: str) -> None:
    """Refuse a convention whose keys or values are not of the documented form."""
    for key, value in table.items():
        if key not in _KEYS:
            raise UsageError(
                f"{where} {_short(key)}: unknown key; use one of {', '.join(sorted(_KEYS))}"
            )
        if key in ("about", "like"):
            good, form = isinstance(value, str), "a string"
        elif key in ("side", "digit"):
            count = 2 if key == "side" else 4
            good, form = _is_list(value) and len(value) == count, f"a list of {count} strings"
        elif key == "pronation":
            good, form = _is_pronation(value), "a number of degrees from -135 to 45"
        elif key in ("thumb", "finger"):
            good = _is_sequence(value) and len(value) == 3 and all(map(_is_name, value))
            form = "a list of three names"
        else:
            good, form = _is_name(value), "a name or a list of names"
        if not good:
            raise UsageError(f"{where} {key}: must be {form}, not {_short(value)}")


def _short(value: object) -> str:
    """What a message quotes of a value."""
    text = value if isinstance(value, str) and value.isidentifier() else repr(value)
    return text if len(text) <= LONGEST else f"{text[:LONGEST]}..."


def _is_pronation(value: object) -> bool:
    number = isinstance(value, (int, float)) and not isinstance(value, bool)
    return number and -135.0 <= float(str(value)) <= 45.0


def _is_sequence(value: object) -> TypeGuard[Sequence[object]]:
    return isinstance(value, (list, tuple))


def _is_list(value: object) -> TypeGuard[Sequence[str]]:
    return _is_sequence(value) and all(isinstance(v, str) and v for v in value)


def _is_name(value: object) -> bool:
    return (isinstance(value, str) and value != "") or (_is_list(value) and bool(value))


def _inherit(name: str, tables: Mapping[str, Table], where: str) -> Table:
    """Return a table completed by the one it is like; the table's own keys win."""
    table, seen = dict(tables[name]), [name]
    while (parent := table.pop("like", None)) is not None:
        if parent not in tables or parent in seen:
            raise UsageError(f"{where}: [{name}] like: no other convention named {parent!r}")
        seen.append(parent)
        # A prefix or a description belongs to one convention only.
        inherited = {k: v for k, v in tables[parent].items() if k not in ("prefix", "about")}
        table = inherited | table
        if "like" in inherited:
            table["like"] = inherited["like"]
    return table


def _convention(
    name: str, tables: Mapping[str, Table], where: str, own: bool = False
) -> Convention:
    table = _inherit(name, tables, where)
    spelled = dict(_spelled_out(table))
    if own and not spelled:
        raise UsageError(f"{where}: [{name}] names no joint of a hand; see {_EXAMPLE}")
    if own:
        _check_apart(spelled, f"{where}: [{name}]")
    spellings: list[tuple[Side | None, str]] = [(None, "")]
    if "side" in table:
        spellings = list(zip(SIDES, table["side"], strict=True))
    hands: dict[Side | None, dict[str, Names]] = {}
    for side, spelling in spellings:
        hands[side] = {
            role: tuple(n.replace("{side}", spelling).replace("{s}", spelling[:1]) for n in names)
            for role, names in spelled.items()
        }
    body = {role: _names(table[role]) for role in BODY_JOINTS if role in table}
    prefixes, pronation = _names(table.get("prefix", [])), table.get("pronation")
    return Convention(name, hands, body, prefixes, own, pronation)


def _check_apart(spelled: Mapping[str, Names], where: str) -> None:
    """Refuse a name that is said to be of two joints of a hand."""
    seen: dict[str, str] = {}
    for role, names in spelled.items():
        for name in names:
            if (other := seen.setdefault(name, role)) != role:
                raise UsageError(f"{where}: '{name}' is given for both {other} and {role}")


def _spelled_out(table: Table) -> Iterator[tuple[str, Names]]:
    """Roles of one hand and their names, ``{digit}`` filled in, ``{side}`` not yet."""
    for digit, spelling in zip(DIGITS, ["", *table.get("digit", FINGERS)], strict=True):
        thumb = digit == "Thumb"
        templates = dict(
            zip(
                (digit + joint for joint in digit_joints(digit)),
                table.get("thumb" if thumb else "finger", ()),
                strict=False,
            )
        )
        templates[TIPS[digit]] = table.get("thumb_tip" if thumb else "tip", ())
        inner = THUMB_CARPAL if thumb else METACARPALS[digit]
        templates[inner] = table.get("thumb_carpal" if thumb else "metacarpal", ())
        for role, value in templates.items():
            if names := _names(value):
                yield role, tuple(n.replace("{digit}", spelling) for n in names)
    for role in HAND_ROLES:
        if role in table:
            yield role, _names(table[role])


def _names(value: str | Sequence[str]) -> Names:
    return (value,) if isinstance(value, str) else tuple(value)


def _keys(roles: Mapping[str, Names]) -> dict[str, Names]:
    return {role: tuple(map(name_key, names)) for role, names in roles.items()}


_SIDE_WORDS: dict[str, Side] = {
    **dict.fromkeys(("left", "lft", "lf", "lt", "l", "links", "linke", "linker"), "left"),
    **dict.fromkeys(("gauche", "izquierda", "izquierdo", "sinistra", "sinistro", "左"), "left"),
    **dict.fromkeys(("right", "rgt", "rt", "rg", "r", "rechts", "rechte", "rechter"), "right"),
    **dict.fromkeys(("droite", "droit", "derecha", "derecho", "destra", "destro", "右"), "right"),
}
_WORD = re.compile(r"[左右]|[A-Z]?[a-zà-ÿ]+|[A-Z]+(?![a-z])")


def named_side(joint: str) -> Side | None:
    """Side that a joint path speaks of, the nearest name first; None if it says nothing.

    Whole words only: ``Hand_L`` and ``leftHand`` have a side, ``Belly`` has none.
    """
    for name in reversed(joint.split("/")):
        sides = {_SIDE_WORDS.get(word.lower()) for word in _WORD.findall(name)} - {None}
        if sides:
            return sides.pop() if len(sides) == 1 else None
    return None


def without_side(name: str) -> tuple[Side | None, str]:
    """Split a name into the side it speaks of and the key of what is left without that word."""
    words = [(m.span(), _SIDE_WORDS.get(m.group().lower())) for m in _WORD.finditer(name)]
    sided = [(span, side) for span, side in words if side is not None]
    if len(sided) != 1:
        return None, name_key(name)
    (start, end), side = sided[0]
    return side, name_key(name[:start] + name[end:])
