"""The names that `import usdhand` gives: all there, loaded late, and typed for its users."""

from __future__ import annotations

import ast
import inspect
import pkgutil
import re
import rlcompleter
import subprocess
import sys
from pathlib import Path

import pytest
from conftest import REPOSITORY

import usdhand
from usdhand.errors import UsdHandError

NAMES = [name for name in usdhand.__all__ if name != "__version__"]
HEAVY = ("numpy", "pxr", "scipy", "numba", "click", "rich", "matplotlib")

# A user's file, and what a type checker must say of each line that is marked.
USERS_FILE = """
from pathlib import Path
import usdhand
from usdhand import Clip, FillRequest, FillSettings, Metric, Outcome, UsdHandError

clip: Clip = usdhand.read_clip("body.usdc")
library = usdhand.read_library(Path("library.usdc"))
own = Metric("own", {"hips_position": 1.0})
filled: usdhand.Filled = usdhand.fill_fingers(clip, library, FillSettings(metric=own))
[reduction] = usdhand.reduce_hands([clip], usdhand.ReduceSettings(preset=4))
free: tuple[str, ...] = reduction.rig.free
outcome: Outcome = usdhand.run(
    FillRequest(body=Path("a.usdc"), library=Path("b.usdc"), output=Path("c.usda"))
)
made: Clip = Clip.from_arrays(
    ["hips"], [[[0, 0, 0, 1]]], quaternions="xyzw", fps=30, units="m", bind=[[0, 1, 0]]
)

def watch(done: int, total: int) -> bool:
    return done < total

usdhand.splice_hands(clip, made, progress=watch)
usdhand.fill_fingers(clip, libray=3)  # error: call-arg
usdhand.compare(clip, 3)  # error: arg-type
usdhand.fill_finger(clip, library)  # error: attr-defined
length: str = clip.duration  # error: assignment
FillSettings(blend="soft")  # error: arg-type
Metric("own", {"nose": 1.0})  # error: dict-item
Clip.from_arrays(["hips"], [], quaternions="zyx", fps=30, units="m")  # error: arg-type
"""


def test_importing_is_light() -> None:
    script = f"""
import sys, usdhand
assert usdhand.__version__
assert set(usdhand.__all__) <= set(dir(usdhand))
print(*(m for m in {HEAVY} if m in sys.modules))
"""
    found = subprocess.run(
        [sys.executable, "-c", script], capture_output=True, text=True, check=True
    )
    assert found.stdout.split() == []


def test_settings_and_requests_need_no_numpy() -> None:
    light = ["FillSettings", "SpliceSettings", "ReduceSettings", "Metric", "Problem", "InputError"]
    light += [name for name in NAMES if name.endswith("Request")]
    script = f"""
import sys, usdhand
for name in {light}:
    getattr(usdhand, name)
print(*(m for m in {HEAVY} if m in sys.modules))
"""
    found = subprocess.run(
        [sys.executable, "-c", script], capture_output=True, text=True, check=True
    )
    assert found.stdout.split() == []


def test_everything_can_be_imported_by_a_star() -> None:
    script = "from usdhand import *; print(*dir())"
    found = subprocess.run(
        [sys.executable, "-c", script], capture_output=True, text=True, check=True
    )
    assert set(NAMES) <= set(found.stdout.split())


@pytest.mark.parametrize("name", NAMES)
def test_every_name_is_there_and_stays_the_same(name: str) -> None:
    first = getattr(usdhand, name)
    assert getattr(usdhand, name) is first
    if name not in ("Side", "Progress", "Watch"):  # types that are written, not defined
        assert first.__name__ == name
        assert first.__module__.startswith("usdhand.")
        assert inspect.getdoc(first)


def test_a_name_that_is_not_there() -> None:
    with pytest.raises(AttributeError, match="module 'usdhand' has no attribute 'fil_fingers'"):
        usdhand.fil_fingers  # noqa: B018


def test_completion_shows_every_name() -> None:
    shown = rlcompleter.Completer({"usdhand": usdhand}).attr_matches("usdhand.")
    assert {f"usdhand.{name}" for name in NAMES} <= {name.split("(")[0] for name in shown}


def test_type_checkers_and_the_interpreter_see_the_same_names() -> None:
    tree = ast.parse(Path(usdhand.__file__).read_text("utf-8"))
    [block] = [
        node
        for node in tree.body
        if isinstance(node, ast.If) and ast.unparse(node.test) == "TYPE_CHECKING"
    ]
    typed = {
        alias.asname: node.module
        for node in block.body
        if isinstance(node, ast.ImportFrom)
        for alias in node.names
        if alias.asname == alias.name
    }
    assert typed == usdhand._MODULES


def test_no_module_can_take_the_place_of_a_name() -> None:
    """Importing `usdhand.compare`, if there were one, would replace the function of that name."""
    assert {module.name for module in pkgutil.iter_modules(usdhand.__path__)}.isdisjoint(NAMES)


def test_every_error_has_a_name() -> None:
    def below(error: type[UsdHandError]) -> set[str]:
        return {error.__name__}.union(*map(below, error.__subclasses__()))

    assert below(UsdHandError) <= set(NAMES)


def test_every_request_has_a_name() -> None:
    from usdhand.requests.verbs import VERBS, request_class

    assert {request_class(verb).__name__ for verb in VERBS} <= set(NAMES)


def test_every_name_is_on_the_page_of_the_api() -> None:
    page = (REPOSITORY / "docs" / "python.md").read_text(encoding="utf-8")
    shown = re.findall(r"^\.\. auto\w+:: usdhand\.(.*)$", page, re.M)
    assert sorted(shown) == sorted(NAMES)


def test_types_in_signatures_have_names() -> None:
    """Whoever holds a value that a function gives or takes can name its type."""
    missing = {}
    for name in NAMES:
        value = getattr(usdhand, name)
        if not inspect.isfunction(value):
            continue
        words = set(re.findall(r"\b[A-Z]\w+", " ".join(map(str, value.__annotations__.values()))))
        common = {"None", "Path", "Sequence", "Mapping", "Callable", "Any", "Literal"}
        if others := words - set(NAMES) - common:
            missing[name] = others
    assert missing == {}


def test_a_user_s_project_sees_the_real_types(tmp_path: Path) -> None:
    file = tmp_path / "users.py"
    file.write_text(USERS_FILE, encoding="utf-8")
    command = [sys.executable, "-m", "mypy", "--strict", "--cache-dir", str(tmp_path), file.name]
    environment = {"PYTHONPATH": str(REPOSITORY), "PATH": ""}
    done = subprocess.run(
        command, capture_output=True, text=True, cwd=tmp_path, env=environment, check=False
    )
    said = {
        int(line): code
        for line, code in re.findall(r"users\.py:(\d+): error: .*\[([\w-]+)\]", done.stdout)
    }
    wanted = {
        number: found.group(1)
        for number, line in enumerate(USERS_FILE.splitlines(), 1)
        if (found := re.search(r"# error: ([\w-]+)", line))
    }
    assert said == wanted, done.stdout + done.stderr
