"""The look of all plots, and plots as files. The only place that imports matplotlib."""

from __future__ import annotations

import importlib.util
import io
import re
import warnings
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any, ParamSpec, TypeVar

import numpy as np

from usdhand.errors import UsageError
from usdhand.formats.atomic import written_beside
from usdhand.formats.output import check_folder, check_output, make_folder
from usdhand.motion.rotations import Array

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

P = ParamSpec("P")
R = TypeVar("R")

# Okabe and Ito's colours, which people of all kinds of colour vision tell apart.
BLACK, GREY, LIGHT = "#222222", "#8c8c8c", "#d9d9d9"
BLUE, SKY, ORANGE, YELLOW = "#0072b2", "#56b4e9", "#d55e00", "#e69f00"

STYLE: dict[str, Any] = {
    "font.family": "DejaVu Sans",  # comes with matplotlib
    "font.size": 9.0,
    "axes.titlesize": 9.0,
    "axes.titlelocation": "left",
    "axes.labelsize": 9.0,
    "axes.edgecolor": GREY,
    "axes.labelcolor": BLACK,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.axisbelow": True,
    "figure.titlesize": 11.0,
    "figure.titleweight": "bold",
    "figure.facecolor": "white",
    "xtick.color": GREY,
    "ytick.color": GREY,
    "xtick.labelcolor": BLACK,
    "ytick.labelcolor": BLACK,
    "xtick.labelsize": 8.0,
    "ytick.labelsize": 8.0,
    "legend.frameon": False,
    "legend.fontsize": 8.0,
    "lines.linewidth": 1.3,
    "text.color": BLACK,
    "text.parse_math": False,  # names of clips are no formulas
}
SUFFIXES = (".svg", ".png")
MOST_POINTS = 800  # of a curve: more than a plot is wide show nothing more
PNG_DPI, SVG_DPI = 110, 90  # the latter of what is pixels within an SVG
NO_METADATA = {"Date": None, "Creator": None, "Format": None, "Type": None}  # same in, same out


def require() -> None:
    """See that plots can be made.

    Raises
    ------
    UsageError
        if matplotlib is not installed.
    """
    if importlib.util.find_spec("matplotlib") is None:
        raise UsageError("Plots are drawn with matplotlib: pip install 'usdhand[plots]'")


@contextmanager
def look() -> Iterator[None]:
    """What is drawn within has the style of all plots, whatever matplotlib's own settings say."""
    require()
    from matplotlib import style

    with style.context(["default", STYLE]), warnings.catch_warnings():
        # The picture shows it: names in scripts that the font lacks are boxes.
        warnings.filterwarnings("ignore", r"Glyph \d+")
        yield


def styled(draw: Callable[P, R]) -> Callable[P, R]:
    """Make a function draw in the style of all plots."""
    from functools import wraps

    @wraps(draw)
    def drawn(*args: P.args, **kwargs: P.kwargs) -> R:
        with look():
            return draw(*args, **kwargs)

    return drawn


def new_figure(
    title: str, size: tuple[float, float], rows: int = 1, columns: int = 1, **grid: Any
) -> tuple[Figure, list[Axes]]:
    """Return an empty figure of ``size`` inches and its axes, row by row."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=size, layout="constrained")
    figure.suptitle(title, x=0.01, ha="left")
    axes = figure.subplots(rows, columns, squeeze=False, **grid)
    return figure, list(axes.ravel())


def small_multiples(
    title: str, count: int, panel: tuple[float, float], most_columns: int
) -> tuple[Figure, list[Axes]]:
    """Return a figure of ``count`` panels of that many inches each, in rows that are about full."""
    rows = -(-count // most_columns)
    columns = -(-count // rows)
    size = max(panel[0] * columns, 6.5), 0.6 + panel[1] * rows
    figure, axes = new_figure(title, size, rows, columns)
    for empty in axes[count:]:
        empty.remove()
    return figure, axes[:count]


def sampled(count: int, most: int = MOST_POINTS) -> Array:
    """Indices of at most ``most`` of ``count`` points, evenly spread, the ends among them."""
    return np.unique(np.linspace(0, count - 1, min(count, most)).round().astype(np.intp))


def check_plots(folder: Path, names: Iterable[str], force: bool) -> None:
    """Refuse plots before any work is done.

    Parameters
    ----------
    names : of all plots that may come out

    Raises
    ------
    OutputError
        if the folder cannot be made, or has such a plot and ``force`` is not given.
    UsageError
        if matplotlib is not installed.
    """
    require()
    check_folder(folder)
    for path in _files(folder, names) if folder.is_dir() else ():
        check_output(path, (), force, SUFFIXES)


def write_plots(folder: Path, figures: Mapping[str, Figure], force: bool) -> list[Path]:
    """Write every figure as SVG and PNG, all of them or none.

    Raises
    ------
    OutputError
        as `check_plots`, or if writing fails.
    """
    check_plots(folder, figures, force)
    contents = [_drawn(name, figure, s) for name, figure in figures.items() for s in SUFFIXES]
    make_folder(folder)
    paths = _files(folder, figures)
    with ExitStack() as whole:
        for path, content in zip(paths, contents, strict=True):
            whole.enter_context(written_beside(path)).write_bytes(content)
    return paths


def _files(folder: Path, names: Iterable[str]) -> list[Path]:
    return [folder / f"{name}{suffix}" for name in names for suffix in SUFFIXES]


def _drawn(name: str, figure: Figure, suffix: str) -> bytes:
    """A figure as the content of a file, the same whenever it is drawn."""
    import matplotlib
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.backends.backend_svg import FigureCanvasSVG

    # Not by savefig, which draws everything twice.
    with look(), matplotlib.rc_context({"svg.hashsalt": name}):
        engine = figure.get_layout_engine()
        if engine is not None:  # once is enough
            engine.execute(figure)
            figure.set_layout_engine("none")
        buffer = io.BytesIO()
        if suffix == ".svg":
            figure.dpi = SVG_DPI
            FigureCanvasSVG(figure).print_svg(buffer, metadata=NO_METADATA)
            return own_ids(buffer.getvalue().decode("utf-8"), name).encode("utf-8")
        figure.dpi = PNG_DPI
        FigureCanvasAgg(figure).print_png(buffer, metadata={"Software": None})
        return buffer.getvalue()


def own_ids(svg: str, name: str) -> str:
    """Return an SVG whose ids begin with its name, so that several can stand on one page."""
    return re.sub(r'(\bid="|href="#|url\(#)', rf"\g<1>{name}-", svg)


def shortened(names: Sequence[str], most: int) -> dict[str, str]:
    """Names of at most ``most`` characters: without their common beginning and long middles."""
    ends = zip(min(names), max(names), strict=False)
    common = next((i for i, (a, b) in enumerate(ends) if a != b), 0)

    def short(name: str) -> str:
        if len(name) <= most:
            return name
        rest = name[common:]
        if len(rest) <= most:
            return rest
        return f"{rest[: most // 2]}\N{HORIZONTAL ELLIPSIS}{rest[len(rest) - (most - 1) // 2 :]}"

    return {name: short(name) for name in names}


def spread(items: Sequence[Any], most: int) -> list[Any]:
    """At most ``most`` items, evenly spread, the first and the last among them."""
    return [items[i] for i in sampled(len(items), most)] if items else []
