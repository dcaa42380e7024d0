"""Every code of a problem is a literal in the source and has one row in docs/reports.md."""

from __future__ import annotations

import ast
import re
from collections import Counter
from collections.abc import Iterator
from pathlib import Path

from conftest import REPOSITORY

from usdhand.errors import UsdHandError

PAGE = (REPOSITORY / "docs" / "reports.md").read_text(encoding="utf-8")
ROWS = re.findall(r"^\| `([\w-]+)` \|", PAGE.split("\n## Problem codes\n")[1], re.M)
CODE = r"[a-z]+(-[a-z]+)*"
# Codes that come from elsewhere: USD's validators, errors, whoever calls `Journal.warn`.
OPEN = {"str(error.GetIdentifier())", "error.code", "code"}


def first_arguments(source: str) -> Iterator[ast.expr]:
    """What stands for the code wherever a problem is made or a warning given."""
    for node in ast.walk(ast.parse(source)):
        if not isinstance(node, ast.Call):
            continue
        name = node.func.attr if isinstance(node.func, ast.Attribute) else ""
        if isinstance(node.func, ast.Name):
            name = node.func.id
        if name in ("Problem", "warn"):
            named = [k.value for k in node.keywords if k.arg == "code"]
            yield (node.args or named)[0]


def source_codes() -> tuple[set[str], set[str]]:
    """Literal codes of the package, and all others as they stand in the source."""
    literal, others = set(), set()
    for path in sorted((REPOSITORY / "usdhand").rglob("*.py")):
        for code in first_arguments(path.read_text(encoding="utf-8")):
            if isinstance(code, ast.Constant):
                literal.add(str(code.value))
            else:
                others.add(f"{path.relative_to(REPOSITORY).as_posix()}: {ast.unparse(code)}")
    return literal, others


def error_classes(base: type[UsdHandError] = UsdHandError) -> Iterator[type[UsdHandError]]:
    yield base
    for own in base.__subclasses__():
        yield from error_classes(own)


def test_codes_are_literal() -> None:
    literal, others = source_codes()
    assert {other.split(": ")[1] for other in others} <= OPEN, others
    assert {Path(other.split(": ")[0]).name for other in others} == {"check.py", "outcome.py"}
    assert [code for code in literal if not re.fullmatch(CODE, code)] == []


def test_every_code_is_on_the_page_once_and_no_other() -> None:
    errors = [error for error in error_classes() if error.__module__.startswith("usdhand.")]
    codes = source_codes()[0] | {error.code for error in errors}
    assert len(source_codes()[0]) > 80
    assert sorted(codes - set(ROWS)) == [], "codes without a row in docs/reports.md"
    assert sorted(set(ROWS) - codes) == [], "rows of docs/reports.md without a code"
    assert [code for code, count in Counter(ROWS).items() if count > 1] == []


def test_errors_have_codes_of_their_own_and_the_exit_codes_of_the_page() -> None:
    errors = [error for error in error_classes() if error.__module__.startswith("usdhand.")]
    assert len({error.code for error in errors}) == len(errors)
    rows = dict(re.findall(r"^\| `([\w-]+)` \|[^|]+\| (\d+) \|$", PAGE, re.M))
    assert rows == {error.code: str(error.exit_code) for error in errors}


def test_a_computed_code_is_seen() -> None:
    found = [
        ast.unparse(code)
        for code in first_arguments(
            "Problem('a-b', m)\nx.warn(f'a-{b}', m)\nproblems.Problem(code='c', message=m)"
        )
    ]
    assert found == ["'a-b'", "f'a-{b}'", "'c'"]
