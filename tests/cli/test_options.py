"""What the command line makes of declared options."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from builders.cli_runner import run
from click.testing import CliRunner
from conftest import REPOSITORY

from usdhand.cli.main import main
from usdhand.requests.verbs import VERBS

OK = REPOSITORY / "samples" / "gestures" / "ok_01.usdc"


def test_options_are_environment_variables(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    arguments = ("reduce", OK, "-n", "-o", tmp_path / "r.usda", "--json")
    monkeypatch.setenv("USDHAND_REDUCE_TARGET_DOFS", "7")
    assert json.loads(run(*arguments).stdout)["free_channels"] == 7
    assert json.loads(run(*arguments, "--target-dofs", 8).stdout)["free_channels"] == 8
    monkeypatch.setenv("USDHAND_REDUCE_TARGET_DOFS", "many")
    assert "--target-dofs" in run(*arguments, code=2).output


def test_what_is_not_given_is_as_the_preset_says(tmp_path: Path) -> None:
    library = tmp_path / "l.usdc"
    run("library", "build", REPOSITORY / "samples" / "gestures", "-o", library)
    body = REPOSITORY / "samples" / "conversations" / "talk_01_body.usdc"
    arguments = ("fill", body, "--library", library, "-n", "-o", tmp_path / "f.usda", "--json")
    settings = json.loads(run(*arguments, "--preset", "paper", "--k", 5).stdout)["settings"]
    assert (settings["metric"], settings["k"], settings["pool"]) == ("euler", 5, 0)
    settings = json.loads(run(*arguments, "--preset", "paper", "--metric", "arm").stdout)[
        "settings"
    ]
    assert (settings["metric"], settings["pool"]) == ("arm", 0)


@pytest.mark.parametrize("verb", VERBS)
def test_quiet_json_and_help_are_there(verb: str) -> None:
    text = run(*verb.split(), "--help").output
    assert "--json" in text
    assert "-q, --quiet" in text


def test_an_unknown_verb_or_option_is_a_usage_error() -> None:
    assert "No such command 'reduc'" in run("reduc", code=2).output
    text = run("reduce", OK, "--target-dof", 3, code=2).output
    assert "Did you mean" in text
    assert "--target-dofs" in text


def test_an_interruption_is_no_traceback(monkeypatch: pytest.MonkeyPatch) -> None:
    def interrupted(*_: object, **__: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr("usdhand.verbs.run.run_verb", interrupted)
    result = CliRunner().invoke(main, ["inspect", str(OK)])
    assert result.exit_code == 130
    assert "Interrupted" in result.output
