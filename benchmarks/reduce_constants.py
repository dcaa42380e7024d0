"""How the constants of reduce's best channels were chosen: errors by constant, as Markdown tables.

    python benchmarks/reduce_constants.py [--data FOLDER]

Two bodies of motion, the folder's takes and the samples' gestures. Of both, every third take by
name is kept aside: `benchmarks/reduce_takes.py` reports on those, this program never reads them.
Of the others, one rig is fitted to two thirds of a body and tried on its last third ("within"),
and one to a whole body and tried on the other ("across"). Errors are RMS degrees of what relations
miss, limits apart; geometric means over numbers of free channels, then over the four cases.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from types import ModuleType

import numpy as np
from reduce_takes import SAMPLES, files, table

from usdhand import find_hands, read_clip
from usdhand.reduce import choose, relate
from usdhand.reduce.evidence import Takes, gather
from usdhand.reduce.moments import Moments
from usdhand.reduce.relate import Shape, residual_moments, told_by
from usdhand.reduce.settings import Criteria
from usdhand.reduce.turns import whole_turns

COUNTS = (6, 10, 15, 20, 25)
Case = tuple[Takes, Moments]


def tuning_part(folder: Path) -> list[Path]:
    """Two takes of three, by name."""
    return [p for i, p in enumerate(files(folder)) if i % 3 != 2]


def evidence(paths: Sequence[Path]) -> Takes:
    """Takes as a fit needs them."""
    clips = (read_clip(path) for path in paths)
    hands = ((clip, find_hands(clip)) for clip in clips)
    return gather((clip, own, own.encode(clip)) for clip, own in hands)


def case(fitted: Sequence[Path], shown: Sequence[Path]) -> Case:
    """Takes to fit, and the moments of others on their turns."""
    fit, other = evidence(fitted), evidence(shown).moments
    return fit, other.turned(whole_turns(fit.names, other.mean - fit.moments.mean))


def missed(fit: Takes, shown: Moments, free: Sequence[int], shape: Shape) -> float:
    """RMS degrees on what is shown."""
    told = told_by(fit.related * fit.moments.covariance, free, shape)
    return float(np.sqrt(np.diag(residual_moments(told, fit.moments, shown)).mean()))


def chosen(fit: Takes, count: int) -> tuple[int, ...]:
    """The best channels."""
    search = choose.subsets(fit, Criteria())
    return search.channels(search.best(count))


def by_choice(one: Case, count: int) -> float:
    """Error with everything chosen as `reduce` does."""
    fit, shown = one
    free = chosen(fit, count)
    shape = relate.best_shape(fit.folds, free, fit.measure("deg"), None, fit.related)
    return missed(fit, shown, free, shape)


@contextmanager
def constant(module: ModuleType, name: str, value: float) -> Iterator[None]:
    """A constant of a module with another value."""
    before = getattr(module, name)
    setattr(module, name, value)
    try:
        yield
    finally:
        setattr(module, name, before)


def row(cases: Sequence[Case], error: Callable[[Case, int], float]) -> list[float]:
    """Geometric means over the counts, by case, and of all."""
    logs = np.array([[np.log(error(one, count)) for count in COUNTS] for one in cases])
    return [*np.exp(logs.mean(axis=1)).tolist(), float(np.exp(logs.mean()))]


def main() -> None:
    """Print a table for each constant."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--data", type=Path, required=True)
    bodies = {"takes": tuning_part(parser.parse_args().data), "gestures": tuning_part(SAMPLES)}
    cases: dict[str, Case] = {}
    for name, paths in bodies.items():
        known = [p for i, p in enumerate(paths) if i % 3 != 2]
        cases[f"{name}, within"] = case(known, [p for i, p in enumerate(paths) if i % 3 == 2])
        [other] = (o for o in bodies if o != name)
        cases[f"{name}, across"] = case(paths, bodies[other])
    every = list(cases.values())
    heads = (*cases, "mean")
    print(f"{len(bodies['takes'])} takes and {len(bodies['gestures'])} gestures.\n")
    for module, name, values in (
        (relate, "LEAST_SHARE", (0.0, 0.25, 0.5, 1.0)),
        (relate, "ALIKE", (1.0, 1.02**2, 1.05**2)),
        (relate, "WORTHWHILE", (0.0, 0.003, 0.01, 0.03)),
    ):
        rows = []
        for value in values:
            with constant(module, name, value):
                rows.append([f"{value:.3g}", *row(every, by_choice)])
        table((f"`{name}`", *heads), rows)
    free = {(id(one), count): chosen(one[0], count) for one in every for count in COUNTS}

    def by_ridge(ridge: float) -> list[float]:
        shape = Shape(None, ridge)
        return row(every, lambda one, count: missed(*one, free[id(one), count], shape))

    rows = [[f"{ridge:.3g}", *by_ridge(ridge)] for ridge in (1e-4, 1e-3, 1e-2, 0.03, 0.1, 0.3)]
    table(("`RIDGE` of the curve", *heads), rows)


if __name__ == "__main__":
    main()
