"""README and docs name every verb and option, and what they show works."""

from __future__ import annotations

import ast
import importlib
import re
import subprocess
import sys
from dataclasses import fields, is_dataclass
from pathlib import Path
from typing import Any

import click
import pytest
from builders.shared_work import Shell
from conftest import REPOSITORY

import usdhand
from usdhand.cli.command import command_of
from usdhand.requests.verbs import VERBS

REFERENCE = (REPOSITORY / "docs" / "command-line.md").read_text(encoding="utf-8")
PAGES = [
    *sorted(REPOSITORY.glob("*.md")),
    REPOSITORY / "samples" / "README.md",
    *sorted((REPOSITORY / "docs").rglob("*.md")),
]


def commands() -> list[tuple[str, click.Command]]:
    """Verbs, those with verbs of their own included, as (section of the reference, command)."""
    return [(verb.split()[0], command_of(verb)) for verb in VERBS]


@pytest.mark.parametrize(("verb", "command"), commands())
def test_every_option_is_documented(verb: str, command: click.Command) -> None:
    section = REFERENCE.split(f"## {verb}\n", 1)
    assert len(section) == 2, f"docs/command-line.md has no section '{verb}'"
    text = section[1].split("\n## ", 1)[0]
    assert command.help
    assert "Example" in command.help
    for parameter in command.params:
        if isinstance(parameter, click.Option):
            assert parameter.help, f"{command.name} {parameter.opts}"
            for option in parameter.opts:
                assert f"`{option}" in text or f"`{option}`" in text, f"{command.name} {option}"


def test_the_reference_names_no_option_that_is_not_there() -> None:
    known = {o for _, c in commands() for p in c.params for o in p.opts} | {"--help", "--version"}
    assert set(re.findall(r"`(--[a-z-]+)", REFERENCE)) <= known


def test_environment_variables_that_pages_name_are_there() -> None:
    known = {getattr(p, "envvar", None) for _, c in commands() for p in c.params}
    known |= {"USDHAND_VERB_OPTION", "USDHAND_BLENDER_PYTHON", "USDHAND_CHROMIUM", "USDHAND_SHARED"}
    assert "USDHAND_FILL_PRESET" in known
    for page in PAGES:
        for name in re.findall(r"USDHAND_[A-Z_]*[A-Z]", page.read_text(encoding="utf-8")):
            assert name in known, f"{page.name}: {name}"


def shown_commands(page: Path) -> list[str]:
    """Commands of `sh` blocks, and whole `python` blocks, in the order of the page."""
    text = page.read_text(encoding="utf-8")
    found = []
    for language, block in re.findall(r"```(sh|bash|python)\n(.*?)```", text, re.S):
        if language == "python":
            found.append(block)
            continue
        lines = [line.split(" #")[0].strip() for line in block.splitlines()]
        found += [line for line in lines if line.startswith("usdhand ")]
    return found


@pytest.mark.parametrize("page", [p for p in PAGES if shown_commands(p)], ids=lambda p: p.name)
def test_every_shown_command_runs(page: Path, shell: Shell, subtests: pytest.Subtests) -> None:
    """In the order of the page, with the samples and what the page has made, and nothing else."""
    for line in shown_commands(page):
        with subtests.test(line):
            shell = shell.after(line)


def test_readme_and_reference_show_commands() -> None:
    assert {"README.md", "command-line.md"} <= {p.name for p in PAGES if shown_commands(p)}


def test_links_between_pages_lead_somewhere() -> None:
    for page in PAGES:
        for target in re.findall(r"\]\(([^)#]+)(?:#[^)]*)?\)", page.read_text(encoding="utf-8")):
            if "://" not in target:
                assert (page.parent / target).exists(), f"{page.name}: {target}"


def test_files_that_pages_name_are_there() -> None:
    for page in PAGES:
        text = page.read_text(encoding="utf-8")
        for name in re.findall(
            r"`((?:usdhand|tests|benchmarks|docs|samples|schemas)/[\w/.-]+)`", text
        ):
            assert (REPOSITORY / name).exists(), f"{page.name}: {name}"


def test_the_map_from_papers_names_modules_that_are_there() -> None:
    rows = (REPOSITORY / "docs" / "papers.md").read_text(encoding="utf-8").splitlines()
    for row in (r for r in rows if r.startswith("|")):
        names = re.findall(r"`([\w/]+\.py)`", row)
        folders = [Path(n).parent for n in names if "/" in n]
        for name in names:
            places = [Path(name), *(folder / name for folder in folders)]
            assert any((REPOSITORY / place).exists() for place in places), name


def resolved(name: str) -> Any:
    """The module, class, function or field that a dotted name stands for."""
    parts = name.split(".")
    for count in range(len(parts), 0, -1):
        try:
            found: Any = importlib.import_module(".".join(parts[:count]))
        except ModuleNotFoundError:
            continue
        for part in parts[count:]:
            own = {f.name: f for f in fields(found)} if is_dataclass(found) else {}
            found = getattr(found, part) if hasattr(found, part) else own[part]
        return found
    raise ModuleNotFoundError(name)


@pytest.mark.parametrize("page", PAGES, ids=lambda p: p.name)
def test_names_that_pages_use_are_there(page: Path) -> None:
    """Dotted names of the package, in code or in directives of the API page."""
    text = page.read_text(encoding="utf-8")
    names = re.findall(r"(?:`|:: )(usdhand(?:\.[A-Za-z_]\w*)+)\b(?![/:])", text)
    for name in sorted(set(names) - {"usdhand.toml"}):
        try:
            resolved(name)
        except (ModuleNotFoundError, AttributeError, KeyError) as error:
            pytest.fail(f"{page.name} names {name}, which is not there ({error!r})")


def test_a_name_that_is_not_there_is_seen() -> None:
    assert resolved("usdhand.verbs.fill.run").__name__ == "run"
    for wrong in ("usdhand.verbs.nothing", "usdhand.verbs.fill.nothing", "nothing"):
        with pytest.raises((ModuleNotFoundError, AttributeError, KeyError)):
            resolved(wrong)


def test_the_picture_of_the_architecture_is_what_its_script_draws(tmp_path: Path) -> None:
    """The layers in it come from the contracts of import-linter."""
    folder = tmp_path / "docs" / "pictures"
    folder.mkdir(parents=True)
    script = REPOSITORY / "docs" / "pictures" / "make_architecture.py"
    (folder / script.name).write_bytes(script.read_bytes())
    (tmp_path / "pyproject.toml").write_bytes((REPOSITORY / "pyproject.toml").read_bytes())
    subprocess.run([sys.executable, folder / script.name], check=True)
    drawn = (folder / "architecture.svg").read_text(encoding="utf-8")
    assert drawn == script.with_name("architecture.svg").read_text(encoding="utf-8")


def test_the_citation_is_of_this_version() -> None:
    citation = (REPOSITORY / "CITATION.cff").read_text(encoding="utf-8")
    assert f"\nversion: {usdhand.__version__}\n" in citation


SCRIPTS = [
    *sorted((REPOSITORY / "docs" / "pictures").glob("*.py")),
    *sorted((REPOSITORY / "benchmarks").glob("*.py")),
]


@pytest.mark.parametrize("script", SCRIPTS, ids=lambda p: p.name)
def test_scripts_use_names_that_are_there(script: Path) -> None:
    """Scripts that make pictures and figures run seldom: see that their imports still work."""
    tree = ast.parse(script.read_text(encoding="utf-8"))
    names = set()
    for node in ast.walk(tree):
        if isinstance(node, ast.ImportFrom) and (node.module or "").startswith("usdhand"):
            names |= {f"{node.module}.{alias.name}" for alias in node.names}
        elif isinstance(node, ast.Attribute) and ast.unparse(node.value) == "usdhand":
            names.add(f"usdhand.{node.attr}")
    for name in names:
        resolved(name)
