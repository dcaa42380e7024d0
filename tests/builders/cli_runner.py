"""Calling verbs in process, for all tests of the command line."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from click.testing import CliRunner, Result
from pxr import Usd

from usdhand.cli.main import main


def run(*arguments: object, code: int = 0) -> Result:
    """Call a verb, and see that it ends with this exit code and never with a traceback."""
    result = CliRunner().invoke(main, [str(a) for a in arguments])
    if result.exception is not None and not isinstance(result.exception, SystemExit):
        raise result.exception
    assert result.exit_code == code, result.output
    if code:
        assert "Traceback" not in result.output
    return result


def edit(source: Path, target: Path, change: Callable[[Usd.Stage], object]) -> Path:
    """A flattened copy of a file with something changed."""
    layer = Usd.Stage.Open(str(source)).Flatten()
    change(Usd.Stage.Open(layer))
    layer.Export(str(target))
    return target
