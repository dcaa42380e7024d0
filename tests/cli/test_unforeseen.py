"""The edge of the program: an error that nobody expected is one line and exit code 1."""

from __future__ import annotations

import click
import pytest
from click.testing import CliRunner

from usdhand.cli.main import VerbGroup, main


def failing(error: Exception) -> click.Command:
    def verb() -> None:
        raise error

    return click.Command("inspect", callback=verb)


@pytest.mark.parametrize(
    "error", [RecursionError("too\ndeep"), MemoryError(), ValueError("\ud800" * 9000)]
)
def test_an_unforeseen_error_is_one_line(error: Exception, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(VerbGroup, "get_command", lambda *_: failing(error))
    result = CliRunner().invoke(main, ["inspect"])
    assert result.exit_code == 1
    assert result.stderr.count("\n") == 1
    assert len(result.stderr) < 400
    assert type(error).__name__ in result.stderr
    assert "Traceback" not in result.output
    shown = CliRunner().invoke(main, ["--debug", "inspect"])
    assert shown.exception is error


def test_usage_errors_stay_usage_errors() -> None:
    assert CliRunner().invoke(main, ["no-such-verb"]).exit_code == 2
