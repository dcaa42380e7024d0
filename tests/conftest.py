"""What all tests share."""

from __future__ import annotations

import os
from collections.abc import Iterator
from pathlib import Path

import pytest
from hypothesis import settings

REPOSITORY = Path(__file__).resolve().parent.parent
SHARED = Path(os.environ.get("USDHAND_SHARED", REPOSITORY.parent / "shared"))

# The same examples in every run: a failure can be made again. Machines differ in speed.
settings.register_profile("usdhand", deadline=None, derandomize=True)
settings.load_profile("usdhand")


@pytest.fixture(autouse=True, scope="session")
def _every_report_fits_its_schema() -> Iterator[None]:
    """Whatever report a test makes in this process is judged by the schema that users get."""
    from builders.report_schemas import judged

    with judged():
        yield


def shared_data(*parts: str) -> Path:
    """A file or folder of the project's shared data; skips the test where there is none."""
    path = SHARED.joinpath("data", *parts)
    if not path.exists():
        pytest.skip(f"no real data at {path}: set USDHAND_SHARED to the shared folder")
    return path
