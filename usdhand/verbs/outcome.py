"""What a run comes to: what was written, what it reports, and everything odd on the way."""

from __future__ import annotations

from collections.abc import Callable, Generator, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

from usdhand.display import displayed
from usdhand.errors import UsdHandError
from usdhand.problems import Problem, Severity
from usdhand.progress import each
from usdhand.report.document import document, dumps, hashed
from usdhand.report.text import problem_data
from usdhand.requests.base import Request
from usdhand.verbs.files import inputs_of

if TYPE_CHECKING:
    from matplotlib.figure import Figure

T = TypeVar("T")

# Gets what is done, how many steps are done, and how many there are; False stops the run.
Watch = Callable[[str, int, int], object]

FAILURE = "failure"  # name of the format of reports without a result


class Journal:
    """Problems of a run in the order in which they came; a listener hears of each at once."""

    def __init__(
        self,
        listener: Callable[[Problem], object] | None = None,
        watch: Watch | None = None,
    ) -> None:
        self.problems: list[Problem] = []
        self._listener = listener
        self._watch = watch

    def tell(self, *problems: Problem) -> None:
        """Keep problems, and tell whoever listens."""
        for problem in problems:
            self.keep(problem)
            if self._listener is not None:
                self._listener(problem)

    def keep(self, *problems: Problem) -> None:
        """Keep problems that are told elsewhere, such as in the text of the result."""
        self.problems += problems

    def warn(self, code: str, message: str, file: object = "", where: str = "") -> None:
        """Tell a warning."""
        self.tell(Problem(code, message, where, "warning", str(file)))

    def fail(self, error: UsdHandError, file: object = "") -> None:
        """Tell an error that ends the work on one file, not the run."""
        self.tell(Problem(error.code, str(error), severity="error", file=str(file)))

    def about(self, file: object, problems: Iterable[Problem], *told: Severity) -> None:
        """Tell the problems of a file that are as severe as ``told``, and keep the others."""
        for problem in problems:
            (self.tell if problem.severity in told else self.keep)(
                replace(problem, file=problem.file or str(file))
            )

    def each(self, items: Sequence[T] | Iterable[T], doing: str, total: int = -1) -> Iterator[T]:
        """Yield items, and tell how far it is."""
        count = total if total >= 0 else len(items)  # type: ignore[arg-type]
        try:
            yield from each(items, count, self.progress(doing))
        finally:
            if isinstance(items, Generator):  # processes behind it end now
                items.close()

    def progress(self, doing: str) -> Callable[[int, int], object] | None:
        """What to tell how far ``doing`` is; None where nobody watches."""
        watch = self._watch
        return None if watch is None else lambda done, total: watch(doing, done, total)


@displayed(
    lambda outcome: {
        "verb": outcome.request.verb,
        "written": outcome.written,
        "problems": len(outcome.problems),
        "exit_code": outcome.exit_code,
    }
)
@dataclass(frozen=True, eq=False)
class Outcome:
    """What a request led to.

    Attributes
    ----------
    request : what was asked for
    inputs : files whose content the result depends on
    report : makes the verb's part of the report, plain data; only called where it is wanted
    summary : makes the text for people of that data; the flag asks for all of it
    settings : more of the report's settings than the request says itself
    figures : draws the plots that the request asked for
    written : outputs, reports and plots not among them
    drawn : folder that plots were written to
    problems : everything odd, in the order in which it came
    exit_code : of the command line
    layers : files that USD inputs are composed of
    failed : whether nothing came of it as a whole, so that the report has no result
    """

    request: Request
    inputs: tuple[Path, ...]
    report: Callable[[], dict[str, Any]]
    summary: Callable[[Mapping[str, Any], bool], str]
    settings: Mapping[str, Any] = field(default_factory=dict)
    figures: Callable[[], Mapping[str, Figure]] | None = None
    written: tuple[Path, ...] = ()
    drawn: Path | None = None
    problems: tuple[Problem, ...] = ()
    exit_code: int = 0
    failed: bool = False
    layers: tuple[Path, ...] = ()

    @cached_property
    def result(self) -> dict[str, Any]:
        """The verb's part of the report."""
        return self.report()

    @property
    def document(self) -> dict[str, Any]:
        """The whole report: how it was made, its inputs with their hashes, and the result."""
        settings = self.request.reported() | dict(self.settings)
        own = {
            "exit_code": self.exit_code,
            "written": list(self.written),
            "problems": [{"file": p.file, **problem_data(p)} for p in self.problems],
        }
        name = FAILURE if self.failed else ""
        made = document(self.request, self.inputs, settings, self.result, name)
        layers = {"layers": hashed(self.layers)} if self.layers else {}
        return made | layers | {"outcome": own}

    def to_json(self) -> str:
        """Return the report as text."""
        return dumps(self.document)

    def to_text(self, verbose: bool = False) -> str:
        """Return what a person wants to read."""
        return self.summary(self.result, verbose)


def failed(request: Request, journal: Journal, error: UsdHandError) -> Outcome:
    """What to report of a run that an error ended: its problems, and the error as the last one."""
    inputs, message = inputs_of(request), str(error)
    file = next((str(path) for path in inputs if str(path) in message), "")
    return Outcome(
        request,
        tuple(inputs),
        dict,
        lambda *_: "",
        problems=(*journal.problems, Problem(error.code, message, severity="error", file=file)),
        exit_code=error.exit_code,
        failed=True,
    )
