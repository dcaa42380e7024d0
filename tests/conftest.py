"""What all tests share."""

from __future__ import annotations

import os
from collections import Counter
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import pytest
from hypothesis import settings

import usdhand.formats.usd  # noqa: F401  before any test loads USD itself

if TYPE_CHECKING:
    from builders.shared_work import SharedWork, Shell

REPOSITORY = Path(__file__).resolve().parent.parent
SHARED = Path(os.environ.get("USDHAND_SHARED", REPOSITORY.parent / "shared"))
pytest_plugins = ["builders.browser", "builders.made"]
LEFT_OUT = pytest.StashKey[Counter[str]]()

# The same examples in every run: a failure can be made again. Machines differ in speed.
settings.register_profile("usdhand", deadline=None, derandomize=True)
settings.load_profile("usdhand")


@pytest.fixture(autouse=True, scope="session")
def _every_report_fits_its_schema() -> Iterator[None]:
    """Whatever report a test makes in this process is judged by the schema that users get."""
    from builders.report_schemas import judged

    with judged():
        yield


@pytest.fixture(scope="session")
def shared_work(tmp_path_factory: pytest.TempPathFactory) -> SharedWork:
    """Work that all workers share."""
    from builders.shared_work import SharedWork

    own = tmp_path_factory.getbasetemp()
    return SharedWork((own.parent if "PYTEST_XDIST_WORKER" in os.environ else own) / "shared")


@pytest.fixture(scope="session")
def shell(shared_work: SharedWork) -> Shell:
    """Where pages' commands are run: each once a session on the same files."""
    from builders.shared_work import Shell

    return Shell(shared_work, {})


@pytest.fixture(scope="session")
def gestures_library(shell: Shell) -> Path:
    """A library of all samples of gestures, for reading only."""
    line = "usdhand library build samples/gestures -o gestures.usdc"
    return shell.after(line).made["gestures.usdc"] / "gestures.usdc"


def shared_data(*parts: str) -> Path:
    """A file or folder of the project's shared data; skips the test where there is none."""
    path = SHARED.joinpath("data", *parts)
    if not path.exists():
        pytest.skip(f"no real data at {SHARED / 'data'}: set USDHAND_SHARED to the shared folder")
    return path


# -- the closing lines: what was not run, and why ------------------------------------------------


def pytest_configure(config: pytest.Config) -> None:
    config.stash[LEFT_OUT] = Counter()


def pytest_deselected(items: Sequence[pytest.Item]) -> None:
    for item in items:
        kind = "slow" if item.get_closest_marker("slow") else "not asked for"
        item.config.stash[LEFT_OUT][kind] += 1


def pytest_sessionfinish(session: pytest.Session) -> None:
    if (output := getattr(session.config, "workeroutput", None)) is not None:
        output["left_out"] = dict(session.config.stash[LEFT_OUT])


@pytest.hookimpl(optionalhook=True)
def pytest_testnodedown(node: object) -> None:
    """Of pytest-xdist: every worker leaves out the same tests."""
    left_out = getattr(node, "workeroutput", {}).get("left_out", {})
    node.config.stash[LEFT_OUT] |= Counter(left_out)  # type: ignore[attr-defined]


def pytest_terminal_summary(
    terminalreporter: pytest.TerminalReporter, config: pytest.Config
) -> None:
    """Say how many tests were not run for which reason; what is absent, loudly."""
    reasons = Counter(_reasons(terminalreporter.getreports("skipped")))
    if not reasons and not config.stash[LEFT_OUT]:
        return
    terminalreporter.section("not run, and why")
    for reason, count in sorted(reasons.items(), key=lambda item: (-item[1], item[0])):
        absent = reason.startswith("no ")
        line = f"{count:5} skipped: {'ABSENT: ' if absent else ''}{reason}"
        terminalreporter.write_line(line, yellow=True, bold=absent)
    for kind, count in sorted(config.stash[LEFT_OUT].items()):
        terminalreporter.write_line(f"{count:5} left out: {kind}")


def _reasons(reports: Sequence[pytest.TestReport | pytest.CollectReport]) -> Iterator[str]:
    for report in {report.nodeid: report for report in reports}.values():
        why = report.longrepr[2] if isinstance(report.longrepr, tuple) else report.longreprtext
        yield str(why).removeprefix("Skipped: ")
