"""Options that mean the same in every verb that has them."""

from __future__ import annotations

from pathlib import Path
from typing import Any, Literal

from usdhand.options import option

Sides = Literal["left", "right", "both"]


def output(help: str, **details: Any) -> Any:  # noqa: A002
    """``-o``: the file to write; ``default=None`` where it need not be given."""
    return option(help, "-o", "--output", metavar="OUTPUT", written=True, reported=False, **details)


def force(what: str = "an output") -> Any:
    """``--force``: an output that exists is replaced."""
    return option(f"Replace {what} that exists.", default=False, reported=False)


def dry_run() -> Any:
    """``-n``: everything but writing."""
    return option(
        "Do everything except writing the output.", "-n", "--dry-run", default=False, reported=False
    )


def flatten() -> Any:
    """``--flatten``: one file."""
    return option(
        "Write one file instead of a layer over the input; of a .usda, its motion included.",
        default=False,
    )


def allow_outside() -> Any:
    """``--allow-outside``: what a package may take in."""
    return option("Pack files from outside the input's folder into a .usdz, too.", default=False)


def skel(
    help: str = "Path or name of the skeleton where there are several.",  # noqa: A002
) -> Any:
    """``--skel``: which skeleton."""
    return option(help, default=None, metavar="PRIM")


def maps() -> Any:
    """``--map``: joint names of one's own."""
    return option(
        "TOML file with more joint-name conventions; repeatable.",
        "--map",
        default=(),
        metavar="FILE",
    )


def neutral() -> Any:
    """``--neutral``: what hands are measured from."""
    return option(
        "Clip or character of the same rig whose hands are neutral, where the bind pose is not.",
        default=None,
        metavar="FILE",
    )


def report() -> Any:
    """``--report``: the JSON document in a file."""
    return option(
        "Write the JSON document to a file as well.",
        default=None,
        metavar="FILE",
        written=True,
        reported=False,
    )


def plots() -> Any:
    """``--plots``: pictures of the result."""
    return option(
        "Draw plots of the result into a folder, as SVG and PNG.",
        default=None,
        metavar="DIR",
        written=True,
        reported=False,
        read=folder,
    )


def side() -> Any:
    """``--side``: which hands."""
    return option("Which hand.", default="both")


def folder(text: str) -> Path:
    """Read the name of a folder: an empty one, as of a variable that is not set, is not this one.

    Raises
    ------
    ValueError
        if it is empty.
    """
    if not text:
        raise ValueError("a folder cannot have an empty name; the current folder is '.'")
    return Path(text)


def sides(choice: Sides) -> tuple[Literal["left", "right"], ...]:
    """Sides that a choice stands for."""
    return ("left", "right") if choice == "both" else (choice,)
