"""Every error that a public function says it raises is met, and says what is wrong."""

from __future__ import annotations

import inspect
import re
from dataclasses import replace

import pytest
from builders.failing_calls import Case, cases
from builders.in_memory import in_memory, sample

import usdhand
from usdhand.anatomy.channels import Channels

FUNCTIONS = [n for n in usdhand.__all__ if inspect.isfunction(getattr(usdhand, n))]


@pytest.fixture(scope="module")
def all_cases(tmp_path_factory: pytest.TempPathFactory) -> list[Case]:
    return list(cases(tmp_path_factory.mktemp("errors")))


def said(function: str) -> set[str]:
    """Names of the errors that a docstring says are raised."""
    doc = inspect.getdoc(getattr(usdhand, function)) or ""
    section = re.search(r"Raises\n------\n(.*?)(?:\n\n\S[^\n]*\n-+\n|\Z)", doc, re.S)
    return set(re.findall(r"^\w+$", section[1], re.M)) if section else set()


@pytest.mark.parametrize("function", FUNCTIONS)
def test_errors_are_as_the_docstring_says(function: str, all_cases: list[Case]) -> None:
    met = set()
    for case in (case for case in all_cases if case.function == function):
        with pytest.raises(usdhand.UsdHandError, match=case.words) as raised:
            case.call()
        assert isinstance(raised.value, case.error), case
        met.add(case.error.__name__)
    assert met == said(function)


def test_a_rig_without_its_curves() -> None:
    [reduction] = usdhand.reduce_hands([in_memory(sample("gestures/ok_01"))])
    rig, free = reduction.rig, reduction.free
    with pytest.raises(usdhand.UsageError, match="no channel"):
        rig.evaluate(Channels(free.names[1:], free.values[:, 1:]))
    lost = usdhand.Relation("other", "linear", 0.0, ("nobody",), (1.0,))
    with pytest.raises(usdhand.InputError, match="follows 'nobody'"):
        replace(rig, relations=(*rig.relations, lost)).evaluate(free)
