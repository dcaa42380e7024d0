"""Requests in JSON and back, for every verb; what is no request is refused in a sentence."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import Field, fields, is_dataclass, replace
from pathlib import Path
from typing import Any, Literal, get_args, get_origin, get_type_hints

import jsonschema
import pytest
from hypothesis import given
from hypothesis import strategies as st

from usdhand.errors import UsageError, UsdHandError
from usdhand.options import allows_none, alternatives, declared, flat
from usdhand.requests.base import Request
from usdhand.requests.codec import make_request, to_data
from usdhand.requests.fill import FillRequest
from usdhand.requests.json_schema import request_schema
from usdhand.requests.splice import SpliceRequest
from usdhand.requests.verbs import VERBS, request_class
from usdhand.splice.settings import Pin

CLASSES = [request_class(verb) for verb in VERBS]
# Settings that refuse other numbers.
WITHIN = {"fps": (24.0, 60.0), "factor": (1.0, 2.0), "shortest": (0.1, 0.3), "longest": (0.7, 2.0)}


def values(kind: Any) -> st.SearchStrategy[Any]:
    """Any values of a field's type."""
    found = [_values(one) for one in alternatives(kind)] + [st.none()] * allows_none(kind)
    return st.one_of(*found)


def _values(kind: Any) -> st.SearchStrategy[Any]:
    if get_origin(kind) is Literal:
        return st.sampled_from(get_args(kind))
    if get_origin(kind) is tuple:
        inner = get_args(kind)
        if inner[1:] == (...,):
            return st.lists(values(inner[0]), max_size=3).map(tuple)
        return st.tuples(*map(values, inner))
    if get_origin(kind) is Mapping:
        return st.dictionaries(*map(values, get_args(kind)), min_size=1, max_size=3)
    if is_dataclass(kind):
        return st.builds(_built, st.just(kind), members(kind)).filter(lambda made: made is not None)
    simple: dict[Any, st.SearchStrategy[Any]] = {
        bool: st.booleans(),
        int: st.integers(1, 9),
        float: st.floats(0.1, 1.0),
        str: st.text(max_size=8),
        Path: st.text("abc/ ä.", min_size=1, max_size=8).map(Path),
    }
    return simple[kind]


def members(kind: Any) -> st.SearchStrategy[dict[str, Any]]:
    hints = get_type_hints(kind)
    return st.fixed_dictionaries({f.name: _member(f, hints[f.name]) for f in fields(kind)})


def _member(own: Field[Any], kind: Any) -> st.SearchStrategy[Any]:
    """Values of a field within its bounds."""
    if own.name in WITHIN:
        return st.floats(*WITHIN[own.name])
    option = own.metadata.get("option")
    if option is not None and option.at_most is not None:
        return st.integers(option.at_least, option.at_most) | st.none()
    return values(kind)


def _built(kind: Any, own: dict[str, Any]) -> Any:
    try:
        return kind(**own)
    except UsdHandError:  # settings that contradict each other
        return None


@given(st.data())
@pytest.mark.parametrize("owner", CLASSES, ids=lambda c: c.verb)
def test_every_request_comes_back_from_json(owner: type[Request], data: st.DataObject) -> None:
    request = data.draw(_values(owner))
    text = json.dumps(to_data(request))
    assert make_request(json.loads(text)) == request
    jsonschema.validate(json.loads(text), request_schema(owner))


@pytest.mark.parametrize("owner", CLASSES, ids=lambda c: c.verb)
def test_schemas_are_schemas_and_describe_every_option(owner: type[Request]) -> None:
    schema = request_schema(owner)
    jsonschema.Draft202012Validator.check_schema(schema)
    for own, inside in flat(owner):
        place = schema["properties"][inside.name] if inside else schema
        assert place["properties"][own.name]["description"] == own.option.help


@pytest.mark.parametrize("owner", CLASSES, ids=lambda c: c.verb)
def test_every_option_has_its_own_name_and_help(owner: type[Request]) -> None:
    flags = [flag for own, _ in flat(owner) if own.option.role == "option" for flag in own.flags]
    assert len(set(flags)) == len(flags)
    assert not {"--json", "-q", "--quiet", "-v", "--verbose"} & set(flags)
    assert all(own.option.help.endswith((".", "]")) for own, _ in flat(owner))
    known = {f.name for f in fields(owner)}
    assert {own.name for own in declared(owner)} == known, "every field is an option"


def fill(**more: object) -> dict[str, object]:
    return {"verb": "fill", "body": "b.usd", "library": "l.usdc", "output": "o.usda", **more}


def test_what_is_not_said_has_its_default_by_the_preset() -> None:
    request = make_request(fill(preset="paper", settings={"k": 7}))
    assert isinstance(request, FillRequest)
    assert (request.settings.metric, request.settings.k) == ("euler", 7)
    assert request.side == "both"


@pytest.mark.parametrize(
    ("data", "words"),
    [
        ({}, "needs a 'verb'"),
        ({"verb": 3}, "needs a 'verb'"),
        ({"verb": "fil"}, "Did you mean 'fill'"),
        ({"verb": "dance"}, "no verb 'dance'"),
        ({"verb": "fill"}, "needs 'body'"),
        (fill(boddy="x"), "no 'boddy'. Did you mean 'body'"),
        (fill(body=3), "'body' cannot be 3: a path"),
        (fill(flatten=1), "'flatten' cannot be 1: true or false"),
        (fill(side="up"), "'side' cannot be 'up': one of 'left', 'right', 'both'"),
        (fill(maps="a.toml"), "'maps' cannot be 'a.toml': a list"),
        (fill(maps=[1]), r"'maps\[0\]' cannot be 1"),
        (fill(settings=[]), "'settings' is not an object"),
        (fill(settings={"kk": 1}), "has no 'kk'. Did you mean 'k'"),
        (fill(settings={"k": True}), "'settings.k' cannot be True: a whole number"),
        (fill(settings={"k": 0}), "'settings.k' cannot be 0: it must be at least 1"),
        (
            {"verb": "reduce", "clips": [], "output": "o", "settings": {"preset": 9}},
            "at most 4",
        ),
        (fill(settings={"segmentation": {"speed": "x"}}), "'settings.segmentation.speed'"),
    ],
)
def test_what_is_no_request_is_refused(data: dict[str, object], words: str) -> None:
    with pytest.raises(UsageError, match=words):
        make_request(data)


def test_settings_that_need_a_value_say_so() -> None:
    data = {"verb": "splice", "body": "b", "hands": "h", "output": "o"}
    with pytest.raises(UsageError, match=r"'settings.pins\[0\]' needs 'hand'"):
        make_request({**data, "settings": {"pins": [{"body": 1.0}]}})
    request = make_request({**data, "settings": {"pins": [{"body": 1, "hand": 2}]}})
    assert isinstance(request, SpliceRequest)
    assert request.settings.pins == (Pin(1.0, 2.0),)


def test_reports_have_the_settings_by_their_keys() -> None:
    request = make_request(fill(settings={"k": 3}))
    reported = request.reported()
    assert reported["k"] == 3
    assert reported["preset"] == "default"
    assert not {"body", "output", "library", "force", "report"} & set(reported)
    assert replace(request) == request
