"""How often each verb opens stages: every input once, and the output once to see that it holds."""

from __future__ import annotations

import ast
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

import pytest
from builders.cli_runner import run
from conftest import REPOSITORY
from pxr import Sdf, Usd

SAMPLES = REPOSITORY / "samples"
TALK = SAMPLES / "conversations" / "talk_01_full.usdc"
BODY = SAMPLES / "conversations" / "talk_01_body.usdc"
HANDS = SAMPLES / "hands" / "talk_01_hands_a.usdc"
BEN = SAMPLES / "characters" / "ben.usdc"
GESTURES = sorted((SAMPLES / "gestures").glob("*.usdc"))[::9]
LAYER_OPENINGS = ("FindOrOpen", "FindOrOpenRelativeToLayer", "OpenAsAnonymous")
STAGE_OPENINGS = ("Open", "OpenMasked")
MEMORY, OUTPUT = "in memory", "output"


@pytest.fixture
def opened(monkeypatch: pytest.MonkeyPatch) -> Counter[str]:
    """Names of what is opened; temporary files, which become outputs, are called that."""
    counts: Counter[str] = Counter()

    def counting(open_it: Callable[..., object]) -> Callable[..., object]:
        def counted(what: object, *more: object, **how: object) -> object:
            name = Path(what).name if isinstance(what, str) else MEMORY
            own = name.startswith(".") or name == "out.motion.usdc"
            counts[OUTPUT if own else name] += 1
            return open_it(what, *more, **how)

        return counted

    for kind, names in ((Usd.Stage, STAGE_OPENINGS), (Sdf.Layer, LAYER_OPENINGS)):
        for name in names:
            monkeypatch.setattr(kind, name, staticmethod(counting(getattr(kind, name))))
    return counts


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with a library, a rig and a BVH file."""
    folder = tmp_path_factory.mktemp("made")
    run("library", "build", *GESTURES, "-o", folder / "library.usdc", "-q")
    run("reduce", TALK, "-o", folder / "rig.usda", "-q")
    run("convert", BODY, "-o", folder / "body.bvh", "-q")
    return folder


PAIR = "rig.motion.usdc"  # whose rig is looked at again

# Verb and arguments, {made} being the folder above -> openings of inputs, and in memory: extents
# are those of the composed result. expand looks at the body of the rig and
# of its clip, which may have changed.
ONCE: dict[str, tuple[tuple[object, ...], tuple[Path | str, ...], int]] = {
    "inspect": (("inspect", TALK), (TALK,), 0),
    "check": (("check", TALK), (TALK,), 0),
    "compare": (("compare", TALK, BODY), (TALK, BODY), 0),
    "reduce": (("reduce", TALK, "-o", "{out}.usda"), (TALK,), 1),
    "reduce with a rig": (
        ("reduce", TALK, "--rig", "{made}/rig.usda", "-o", "{out}.usda"), (TALK, "rig.usda"), 1
    ),
    "reduce into one file": (("reduce", TALK, "-o", "{out}.usda", "--flatten"), (TALK,), 2),
    "reduce into a package": (("reduce", TALK, "-o", "{out}.usdz"), (TALK,), 2),
    "expand": (
        ("expand", "{made}/rig.usda", "-o", "{out}.usda"), ("rig.usda", "rig.usda", PAIR, TALK), 1
    ),
    "expand onto": (
        ("expand", "{made}/rig.usda", "--onto", BEN, "-o", "{out}.usda"), ("rig.usda", PAIR, BEN), 1
    ),
    "fill": (
        ("fill", BODY, "--library", "{made}/library.usdc", "-o", "{out}.usda"),
        (BODY, "library.usdc"), 1,
    ),
    "fill bvh": (
        ("fill", "{made}/body.bvh", "--library", "{made}/library.usdc", "-o", "{out}.usda"),
        ("library.usdc",), 2,
    ),
    "splice": (
        ("splice", BODY, HANDS, "--pin", "1:1", "--pin", "181:403", "-o", "{out}.usda"),
        (BODY, HANDS), 1,
    ),
    "convert": (("convert", TALK, "-o", "{out}.usda"), (TALK,), 1),
    "convert edited": (
        ("convert", TALK, "-o", "{out}.usda", "--fps", 24, "--up", "Z", "--scale", 2), (TALK,), 2
    ),
    "convert into a package": (("convert", TALK, "-o", "{out}.usdz"), (TALK,), 1),
    "convert onto": (("convert", TALK, "--onto", BEN, "-o", "{out}.usda"), (TALK, BEN), 2),
    "convert bvh": (("convert", "{made}/body.bvh", "-o", "{out}.usda"), (), 1),
    "convert bvh into a package": (("convert", "{made}/body.bvh", "-o", "{out}.usdz"), (), 1),
    "library info": (("library", "info", "{made}/library.usdc"), ("library.usdc",), 0),
    "evaluate takes": (
        ("evaluate", "{made}/library.usdc", "--takes", TALK), ("library.usdc", TALK), 0
    ),
    "preview": (
        ("preview", TALK, "{made}/rig.usda", "-o", "{out}.html"), (TALK, "rig.usda"), 0
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", ONCE)
def test_every_input_is_opened_once(
    name: str, made: Path, tmp_path: Path, opened: Counter[str]
) -> None:
    arguments, inputs, in_memory = ONCE[name]
    run(*(str(a).format(made=made, out=tmp_path / "out") for a in arguments), "-q")
    expected = Counter(Path(path).name for path in inputs) + Counter({MEMORY: in_memory})
    usd = [p for p in tmp_path.iterdir() if p.suffix.startswith(".usd")]
    assert opened == expected + Counter({OUTPUT: len(usd)})


def here(work: Callable[[object], object], items: Sequence[object], jobs: int) -> Iterator[object]:
    """What workers do, where openings are counted."""
    assert jobs == 1
    yield from ((item, work(item)) for item in items)


def test_many_clips_are_opened_once_each(
    tmp_path: Path, opened: Counter[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("usdhand.verbs.library.each_apart", here)
    clips = Counter(path.name for path in GESTURES)
    run("reduce", *GESTURES, "-o", tmp_path / "rigs", "-q")
    assert opened == clips + Counter({OUTPUT: len(GESTURES), MEMORY: len(GESTURES)})
    opened.clear()
    library = tmp_path / "library.usdc"
    run("library", "build", *GESTURES, "-o", library, "-q")
    assert opened == clips + Counter({OUTPUT: 1})
    opened.clear()
    run("library", "build", *GESTURES, "-o", library, "-q")
    assert opened == {"library.usdc": 1, OUTPUT: 1}
    opened.clear()
    run("evaluate", library, "-q")
    assert opened == clips + Counter({"library.usdc": 1})


def test_one_function_opens_all_stages() -> None:
    names = (*STAGE_OPENINGS, *LAYER_OPENINGS, "CreateInMemory")
    calls: Counter[tuple[str, str]] = Counter()
    for path in sorted((REPOSITORY / "usdhand").rglob("*.py")):
        for node in ast.walk(ast.parse(path.read_text("utf-8"))):
            if isinstance(node, ast.Attribute) and node.attr in names:
                on = ast.unparse(node.value).rpartition(".")[2]
                calls[path.name, node.attr] += on in ("Stage", "Layer")
    assert +calls == {("stage.py", "Open"): 1, ("motion_crate.py", "OpenAsAnonymous"): 1}
