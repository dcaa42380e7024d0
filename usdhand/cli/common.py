"""What verbs share: options, finding files, printing."""

from __future__ import annotations

import glob
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

import click

from usdhand.errors import InputError, UsageError
from usdhand.formats.suffixes import READABLE

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from usdhand.errors import UsdHandError
    from usdhand.motion import Clip, Problem

F = TypeVar("F", bound=Callable[..., Any])


class _Folder(click.Path):
    """A folder with a name: an empty one, as of a variable that is not set, is not this folder."""

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        if value == "":
            self.fail("no folder has an empty name; this folder is '.'", param, ctx)
        return super().convert(value, param, ctx)


json_option = click.option("--json", "as_json", is_flag=True, help="Print one JSON document.")
quiet_option = click.option("-q", "--quiet", is_flag=True, help="Print errors only.")
verbose_option = click.option("-v", "--verbose", is_flag=True, help="Print every channel.")
force_option = click.option("--force", is_flag=True, help="Replace an output that exists.")
dry_run_option = click.option(
    "-n", "--dry-run", is_flag=True, help="Do everything but write the output."
)
flatten_option = click.option(
    "--flatten", is_flag=True, help="Write one file instead of a layer over the input."
)
skel_option = click.option(
    "--skel", metavar="PRIM", help="Path or name of the skeleton where there are several."
)
map_option = click.option(
    "--map",
    "maps",
    metavar="FILE",
    multiple=True,
    type=click.Path(path_type=Path),
    help="TOML file with more joint-name conventions; repeatable.",
)
report_option = click.option(
    "--report",
    metavar="FILE",
    type=click.Path(path_type=Path, dir_okay=False),
    help="Write the JSON document to a file as well.",
)
plots_option = click.option(
    "--plots",
    metavar="DIR",
    type=_Folder(path_type=Path, file_okay=False),
    help="Draw plots of the result into a folder, as SVG and PNG.",
)
side_option = click.option(
    "--side",
    type=click.Choice(["left", "right", "both"]),
    default="both",
    show_default=True,
    help="Which hand.",
)


def output_option(help_text: str, required: bool = True) -> Callable[[F], F]:
    """``-o`` for an output file or folder."""
    return click.option(
        "-o",
        "--output",
        metavar="OUTPUT",
        required=required,
        type=click.Path(path_type=Path),
        help=help_text,
    )


def files_argument(name: str = "files") -> Callable[[F], F]:
    """One or more files; folders and wildcards are expanded by us, so that all shells agree."""
    return click.argument(name, nargs=-1, required=True)


def find_files(arguments: Iterable[str], suffixes: Sequence[str] = READABLE) -> list[Path]:
    """Files named, in folders, or matching wildcards; sorted, each once.

    Raises
    ------
    UsageError
        if a wildcard matches nothing or a folder holds no such file.
    """
    try:
        return _found(arguments, suffixes)
    except OSError as error:
        raise InputError(f"{error.filename}: cannot be read ({error.strerror}).") from error


def _found(arguments: Iterable[str], suffixes: Sequence[str]) -> list[Path]:
    found: dict[Path, None] = {}
    for argument in arguments:
        path = Path(argument)
        if path.is_dir():
            inside = sorted(p for p in path.iterdir() if p.suffix.lower() in suffixes)
            if not inside:
                raise UsageError(f"{path} holds no {', '.join(suffixes)} file.")
            found.update(dict.fromkeys(p for p in inside if not p.name.startswith(".")))
        elif not path.exists() and glob.has_magic(argument):
            matches = sorted(Path(p) for p in glob.glob(argument, recursive=True))  # noqa: PTH207
            if not matches:
                raise UsageError(f"No file matches {argument}.")
            found.update(dict.fromkeys(matches))
        else:
            found[path] = None
    return list(found)


def sides(choice: str) -> tuple[Any, ...]:
    """Sides that `--side` stands for."""
    return ("left", "right") if choice == "both" else (choice,)


def say(text: str, quiet: bool) -> None:
    """Print for people."""
    if not quiet:
        click.echo(text.encode("utf-8", "backslashreplace").decode("utf-8"))


def warn(text: str, quiet: bool = False) -> None:
    """Print a warning to stderr."""
    if not quiet:
        click.echo(f"Warning: {text}", err=True)


def fail(error: UsdHandError) -> None:
    """Print an error of one file of several; the command goes on and keeps its exit code."""
    click.echo(f"Error: {error}", err=True)


def warn_of(clip: Clip, quiet: bool) -> None:
    """Print what is odd about a clip that was read."""
    for problem in clip.problems:
        if problem.severity == "warning":
            warn(f"{clip.origin.path}: {problem}", quiet)


def warn_lost(output: object, lost: Iterable[Problem], quiet: bool) -> None:
    """Print what an output could not keep."""
    for problem in lost:
        if problem.severity == "warning":
            warn(f"{output}: {problem}", quiet)
        else:
            say(f"{output}: {problem}", quiet)


def with_progress(items: Sequence[Any], label: str) -> Iterator[Any]:
    """Yield items with a progress bar, if there are many and someone is watching."""
    if len(items) < 3:
        yield from items
        return
    from rich.console import Console

    console = Console(stderr=True)
    if not console.is_terminal:
        yield from items
        return
    from rich.progress import track

    yield from track(items, description=label, console=console, transient=True)


def check_report(path: Path | None, force: bool) -> None:
    """Refuse a report before any work is done."""
    if path is not None:
        from usdhand.formats.output import check_output

        check_output(path, (), force, (".json",))


def write_report(path: Path | None, text: str, force: bool) -> None:
    """Write a JSON report, whole or not at all."""
    if path is None:
        return
    from usdhand.formats.output import written_beside

    check_report(path, force)
    with written_beside(path) as temporary:
        temporary.write_text(text + "\n", encoding="utf-8")


def check_plots(folder: Path | None, names: Iterable[str], force: bool) -> None:
    """Refuse plots before any work is done; ``names`` are all that may come out."""
    if folder is not None:
        from usdhand.report.plots import style

        style.check_plots(folder, names, force)


def write_plots(
    folder: Path | None, draw: Callable[[], Mapping[str, Figure]], force: bool, quiet: bool
) -> None:
    """Draw plots and write all of them or none."""
    if folder is not None:
        from usdhand.report.plots import style

        style.write_plots(folder, draw(), force)
        say(f"plots written to {folder}", quiet)


def table(rows: Sequence[Sequence[str]], right: Iterable[int] = ()) -> str:
    """Columns lined up; ``right`` tells which are flush right. The first row is the head."""
    right = set(right)
    widths = [max(len(row[i]) for row in rows) for i in range(len(rows[0]))]

    def line(row: Sequence[str]) -> str:
        cells = [
            cell.rjust(w) if i in right else cell.ljust(w)
            for i, (cell, w) in enumerate(zip(row, widths, strict=True))
        ]
        return "  ".join(cells).rstrip()

    return "\n".join(line(row) for row in rows)
