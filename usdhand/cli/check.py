"""usdhand check."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from usdhand.cli.common import (
    fail,
    files_argument,
    find_files,
    json_option,
    quiet_option,
    say,
    skel_option,
    with_progress,
)


@click.command("check")
@files_argument()
@skel_option
@json_option
@quiet_option
@click.option("--strict", is_flag=True, help="Fail on warnings too.")
def command(
    files: tuple[str, ...], skel: str | None, as_json: bool, quiet: bool, strict: bool
) -> None:
    """Check files with UsdValidation and rules of our own.

    Finds what validators miss and tools stumble on: joint names that are no legal prim names,
    missing bind, rest or scales, time codes that would be rescaled. Exit 1 if there is an error.

    \b
    Example:
      usdhand check samples/gestures
    """
    from usdhand.errors import UsdHandError
    from usdhand.formats.suffixes import USD_SUFFIXES
    from usdhand.formats.usd.check import check_file
    from usdhand.report.document import document, dumps
    from usdhand.report.results import check_result

    paths = find_files(files, USD_SUFFIXES)
    results: list[dict[str, Any]] = []
    code = 0
    for path in with_progress(paths, "checking"):
        try:
            result = check_result(check_file(path, skel))
        except UsdHandError as error:
            fail(error)
            results.append({"path": str(path), "ok": False, "error": str(error)})
            code = max(code, error.exit_code)
            continue
        failed = not result["ok"] or (strict and result["findings"])
        code = max(code, int(bool(failed)))
        results.append({"path": str(path), **result})
        if not as_json:
            _print(path, result, quiet)
    if as_json:
        settings = {"skel": skel, "strict": strict}
        click.echo(dumps(document("check", paths, settings, {"files": results})))
    click.get_current_context().exit(code)


def _print(path: Path, result: dict[str, Any], quiet: bool) -> None:
    findings = result["findings"]
    errors = sum(f["severity"] == "error" for f in findings)
    say(f"{path}: {errors} errors, {len(findings) - errors} warnings", quiet and not errors)
    for f in findings:
        where = f" ({f['where']})" if f["where"] else ""
        say(f"  {f['severity']}: {f['message']}{where} [{f['code']}]", quiet and errors == 0)
