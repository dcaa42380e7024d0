"""What `rerun` is to do."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import ClassVar

from usdhand.display import displayed
from usdhand.options import argument, option
from usdhand.requests import shared
from usdhand.requests.base import Request


@displayed()
@dataclass(frozen=True, kw_only=True)
class RerunRequest(Request):
    """Make a result again from its report: the same verb, inputs and settings.

    Relative paths in the report start at the current folder, as they did when it was made.
    An input that has changed since is refused, unless --accept-changes is given.

    \b
    Example:
      usdhand reduce samples/gestures/ok_01.usdc -o ok_rig.usda --report ok_rig.json
      usdhand rerun ok_rig.json -o ok_rig_again.usda
    """

    verb: ClassVar[str] = "rerun"
    verbose: ClassVar[str] = "Print all that the verb prints with -v."
    report_file: Path = argument("A report that a verb wrote with --report.", metavar="REPORT")
    output: Path | None = shared.output(
        "Write here instead of where the report says.", default=None
    )
    accept_changes: bool = option("Use inputs as they are now, also changed ones.", default=False)
    report: Path | None = shared.report()
    plots: Path | None = shared.plots()
    dry_run: bool = shared.dry_run()
    force: bool = shared.force()
