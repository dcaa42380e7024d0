"""README and docs name every verb and option, and what they show works."""

from __future__ import annotations

import re
import shlex
import shutil
from pathlib import Path

import click
import pytest
from click.testing import CliRunner
from conftest import REPOSITORY

from usdhand.cli import main
from usdhand.cli.main import VERBS

REFERENCE = (REPOSITORY / "docs" / "command-line.md").read_text(encoding="utf-8")
PAGES = [REPOSITORY / "README.md", *sorted((REPOSITORY / "docs").glob("*.md"))]


def commands() -> list[click.Command]:
    context = click.Context(main)
    found = [main.get_command(context, verb) for verb in VERBS]
    return [c for c in found if c is not None]


@pytest.mark.parametrize("command", commands(), ids=lambda c: str(c.name))
def test_every_option_is_documented(command: click.Command) -> None:
    section = REFERENCE.split(f"## {command.name}\n", 1)
    assert len(section) == 2, f"docs/command-line.md has no section '{command.name}'"
    text = section[1].split("\n## ", 1)[0]
    assert command.help
    assert "Example" in command.help
    for parameter in command.params:
        if isinstance(parameter, click.Option):
            assert parameter.help, f"{command.name} {parameter.opts}"
            for option in parameter.opts:
                assert f"`{option}" in text or f"`{option}`" in text, f"{command.name} {option}"


def test_the_reference_names_no_option_that_is_not_there() -> None:
    known = {o for c in commands() for p in c.params for o in p.opts} | {"--help", "--version"}
    assert set(re.findall(r"`(--[a-z-]+)", REFERENCE)) <= known


def shown_commands() -> list[str]:
    blocks = [
        block
        for page in PAGES
        for block in re.findall(r"```(?:sh|bash)\n(.*?)```", page.read_text(encoding="utf-8"), re.S)
    ]
    lines = [line.split(" #")[0].strip() for block in blocks for line in block.splitlines()]
    return list(dict.fromkeys(line for line in lines if line.startswith("usdhand ")))


def test_every_shown_command_runs(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, subtests: pytest.Subtests
) -> None:
    shutil.copytree(REPOSITORY / "samples", tmp_path / "samples")
    monkeypatch.chdir(tmp_path)
    shown = shown_commands()
    assert len(shown) >= 8
    for line in shown:
        with subtests.test(line):
            result = CliRunner().invoke(main, shlex.split(line)[1:])
            assert result.exit_code == 0, result.output


def test_links_between_pages_lead_somewhere() -> None:
    for page in PAGES:
        for target in re.findall(r"\]\(([^)#]+)(?:#[^)]*)?\)", page.read_text(encoding="utf-8")):
            if "://" not in target:
                assert (page.parent / target).exists(), f"{page.name}: {target}"
