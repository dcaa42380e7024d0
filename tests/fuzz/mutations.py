"""Damage to files: to bytes, to the words of text formats, and to the numbers of binary ones."""

from __future__ import annotations

import random
import re
import struct
from pathlib import Path

LINES = [line.split() for line in Path(__file__).with_name("words.txt").read_text().splitlines()]
WORDS = {kind: [w for k, *ws in LINES if k == kind for w in ws] for kind, *_ in LINES}
TEXTS = {"bvh": "bvh", "usda": "usda", "gltf": "json", "json": "json", "toml": "toml"}
INTEGERS = (0, 1, -1, 2, 127, 128, 255, 256, 65535, 65536, 2**31 - 1, 2**31, 2**32 - 1, 2**62)
NUMBER = re.compile(r"-?\d+(?:\.\d+)?(?:[eE][-+]?\d+)?")


def damaged(data: bytes, suffix: str, rng: random.Random) -> bytes:
    """A copy of a file with a few faults."""
    kind = TEXTS.get(suffix)
    for _ in range(rng.choice([1, 1, 1, 2, 3, 8])):
        if kind is not None and rng.random() < 0.85:
            text = data.decode("utf-8", "replace")
            data = _words(text, WORDS[kind], rng).encode("utf-8", "surrogatepass")
        else:
            data = _bytes(data, rng)
    return data


def _words(text: str, words: list[str], rng: random.Random) -> str:
    """Text with another number or word, or lines that are gone, twice there or elsewhere."""
    kind = rng.randrange(8)
    if kind < 3:
        return _another_number(text, rng)
    if kind == 3:
        at = rng.randrange(len(text) + 1)
        return f"{text[:at]} {rng.choice(words)} {text[at:]}"
    if kind == 4:
        return _another_word(text, words, rng)
    lines = text.split("\n")
    first = rng.randrange(len(lines))
    last = min(len(lines), first + rng.choice([1, 1, 1, 2, 5, 40]))
    block = lines[first:last]
    if kind == 5:
        del lines[first:last]
    elif kind == 6:
        lines[first:first] = block * rng.choice([1, 1, 1, 30])
    else:
        del lines[first:last]
        at = rng.randrange(len(lines) + 1)
        lines[at:at] = block
    return "\n".join(lines)


def _another_number(text: str, rng: random.Random) -> str:
    found = list(NUMBER.finditer(text))
    if not found:
        return text
    match = rng.choice(found)
    return text[: match.start()] + rng.choice(WORDS["number"]) + text[match.end() :]


def _another_word(text: str, words: list[str], rng: random.Random) -> str:
    found = list(re.finditer(r"[\w:\[\]]+", text))
    if not found:
        return text
    match = rng.choice(found)
    own = rng.choice(found)[0] if rng.random() < 0.6 else rng.choice(words)
    return text[: match.start()] + own + text[match.end() :]


def _bytes(data: bytes, rng: random.Random) -> bytes:
    at = rng.randrange(len(data) + 1)
    kind = rng.randrange(9)
    if kind < 3:
        return data[:at] + bytes([rng.randrange(256)]) + data[at + 1 :]
    if kind == 3:
        return (
            data[:at]
            + bytes([data[at] ^ 1 << rng.randrange(8)] if at < len(data) else [])
            + data[at + 1 :]
        )
    if kind < 6:
        width = rng.choice("bhiq")
        value = rng.choice(INTEGERS) & (1 << 8 * struct.calcsize(width)) - 1
        packed = struct.pack("<" + width.upper(), value)
        return data[:at] + packed + data[at + len(packed) :]
    if kind == 6:
        return data[:at] + data[at + rng.choice([1, 2, 8, 64, 2000]) :]
    if kind == 7:
        return data[:at] + data[at : at + rng.choice([1, 8, 100])] + data[at:]
    return data[:at] if rng.random() < 0.3 else data
