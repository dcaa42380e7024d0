"""In which encoding the names of a BVH file stand: the format does not say."""

from __future__ import annotations

import codecs
import re

from usdhand.problems import Problem

_NAMES = re.compile(rb"\b(?:ROOT|JOINT)[ \t]+([^\r\n{]+)", re.IGNORECASE)
_WIDE = (codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)
# What programs write that do not write UTF-8: of Japan, China, Taiwan, Korea and the West.
ENCODINGS = ("cp932", "euc_jp", "gb18030", "big5", "euc_kr", "cp1252")
SHOWN = {"cp932": "Shift-JIS"}
LAST = "latin-1"  # gives every byte a character


def is_wide(data: bytes) -> bool:
    """Whether a file is UTF-16, in which nothing here can be found."""
    return data.startswith(_WIDE)


def encoding_of(data: bytes) -> tuple[str, tuple[Problem, ...]]:
    """Encoding of the names in a hierarchy, and a warning where it had to be guessed."""
    if data.isascii():
        return "utf-8", ()
    names = [m[1].strip() for m in _NAMES.finditer(data)]
    text = b" ".join(name for name in names if not name.isascii())
    try:
        text.decode("utf-8")
    except UnicodeDecodeError:
        pass
    else:
        return "utf-8", ()
    from charset_normalizer import from_bytes  # 20 ms, for few files

    best = from_bytes(text, cp_isolation=list(ENCODINGS)).best()
    found = LAST if best is None else best.encoding
    shown = SHOWN.get(found, found)
    example = text.split()[0].decode(found, "replace")
    message = f"joint names are not UTF-8: read as {shown}, for example '{example}'"
    return found, (Problem("guessed-encoding", message),)
