"""What holds for all modules of the package."""

from __future__ import annotations

import ast
from collections import defaultdict
from pathlib import Path

import pytest
from conftest import REPOSITORY

PACKAGE = REPOSITORY / "usdhand"
MODULES = sorted(PACKAGE.rglob("*.py"))
MOST_LINES = 400


def named(path: Path) -> str:
    return path.relative_to(PACKAGE).as_posix()


def test_a_class_has_a_name_of_its_own() -> None:
    """One name, one meaning: whoever reads ``Rig`` need not ask which."""
    where: dict[str, list[str]] = defaultdict(list)
    for module in MODULES:
        for node in ast.walk(ast.parse(module.read_text(encoding="utf-8"))):
            if isinstance(node, ast.ClassDef):
                where[node.name.lstrip("_")].append(named(module))
    assert len(where) > 100
    assert {name: modules for name, modules in where.items() if len(modules) > 1} == {}


@pytest.mark.parametrize("module", MODULES, ids=named)
def test_a_module_fits_in_the_head(module: Path) -> None:
    assert len(module.read_text(encoding="utf-8").splitlines()) <= MOST_LINES


def test_no_function_calls_itself() -> None:
    """What is read may be nested or held for as long as it likes: a stack has an end.

    The exceptions walk what the program itself made, which is as deep as the types say.
    """
    allowed = {
        "display.py: short",
        "report/document.py: _plain",
        "requests/base.py: _as_declared",
        "requests/codec.py: _plain",
    }
    found = set()
    for module in MODULES:
        tree = ast.parse(module.read_text(encoding="utf-8"))
        methods = {
            id(function)
            for node in ast.walk(tree)
            if isinstance(node, ast.ClassDef)
            for function in node.body
        }
        for function in ast.walk(tree):
            if isinstance(function, ast.FunctionDef) and calls_itself(
                function, method=id(function) in methods
            ):
                found.add(f"{named(module)}: {function.name}")
    assert found == allowed


def calls_itself(function: ast.FunctionDef, method: bool) -> bool:
    for node in ast.walk(function):
        if not isinstance(node, ast.Call):
            continue
        called = node.func
        if not method and isinstance(called, ast.Name) and called.id == function.name:
            return True
        on_itself = isinstance(called, ast.Attribute) and isinstance(called.value, ast.Name)
        if method and on_itself and called.attr == function.name and called.value.id == "self":
            return True
    return False
