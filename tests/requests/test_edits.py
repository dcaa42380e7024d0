"""Files of edits: pins as --pin takes them, and what is wrong is said."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import jsonschema
import pytest
from builders.cli_runner import run
from hypothesis import given
from hypothesis import strategies as st

from usdhand.errors import InputError
from usdhand.requests.edits import read_pins

SCHEMA = "usdhand.edits/1"


def written(folder: Path, pins: Any) -> Path:
    file = folder / "edits.json"
    file.write_text(json.dumps({"schema": SCHEMA, "splice": {"pins": pins}}), "utf-8")
    return file


def schema() -> jsonschema.Draft202012Validator:
    found = json.loads(run("schema", "--of-edits").stdout)
    jsonschema.Draft202012Validator.check_schema(found)
    return jsonschema.Draft202012Validator(found)


def test_pins_are_those_of_the_option(tmp_path: Path) -> None:
    pins = [{"body": 1, "hand": 1.5}, {"body": 181, "hand": 403, "tolerance": 2, "side": "left"}]
    file = written(tmp_path, pins)
    assert read_pins(file) == ("1:1.5:0", "left:181:403:2")
    assert schema().is_valid(json.loads(file.read_text()))
    file.write_text(json.dumps({"schema": SCHEMA, "fill": {}}), "utf-8")
    assert read_pins(file) == ()
    assert schema().is_valid(json.loads(file.read_text()))


@given(body=st.floats(-1e6, 1e6), hand=st.floats(-1e6, 1e6))
def test_numbers_come_as_they_are(
    body: float, hand: float, tmp_path_factory: pytest.TempPathFactory
) -> None:
    [text] = read_pins(written(tmp_path_factory.mktemp("edits"), [{"body": body, "hand": hand}]))
    assert [float(part) for part in text.split(":")] == [body, hand, 0.0]


@pytest.mark.parametrize(
    ("pins", "says"),
    [
        ([{"body": 1}], "pin 1"),
        ([{"body": 1, "hand": 1}, {"body": "2", "hand": 3}], 'pin 2: "2" is no number'),
        ([{"body": 1, "hand": True}], "true is no number"),
        ([{"body": 1, "hand": 1, "tolerance": -1}], "0 or more"),
        ([{"body": 1, "hand": 1, "side": "both"}], "side"),
        ([{"body": 1, "hand": 1, "toleranse": 1}], "unknown key 'toleranse'"),
        ({"body": 1}, "list"),
        ([3], "pin 1"),
    ],
)
def test_what_is_wrong_is_said(tmp_path: Path, pins: Any, says: str) -> None:
    file = written(tmp_path, pins)
    with pytest.raises(InputError, match=says):
        read_pins(file)
    assert not schema().is_valid(json.loads(file.read_text()))


@pytest.mark.parametrize(
    ("text", "says"),
    [("{", "no JSON"), ("[]", "not a file of edits"), ('{"schema": "usdhand.fill/1"}', SCHEMA)],
)
def test_other_files_are_refused(tmp_path: Path, text: str, says: str) -> None:
    file = tmp_path / "edits.json"
    file.write_text(text, "utf-8")
    with pytest.raises(InputError, match=says):
        read_pins(file)
    with pytest.raises(InputError, match="cannot be read"):
        read_pins(tmp_path / "none.json")
