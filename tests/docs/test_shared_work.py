"""Work that is shared is done once, and no failure is hidden by it."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest
from builders.shared_work import SharedWork, Shell

ADD = "from pathlib import Path; Path('{}').write_text({})"


@pytest.fixture
def here(tmp_path: Path) -> Shell:
    return Shell(SharedWork(tmp_path / "shared"), {})


def text(shell: Shell, name: str) -> str:
    return (shell.made[name] / name).read_text()


def test_a_folder_is_made_once_for_all(tmp_path: Path) -> None:
    work, calls = SharedWork(tmp_path / "shared"), []

    def make(folder: Path) -> None:
        calls.append(folder)
        (folder / "a.txt").write_text("a")

    with ThreadPoolExecutor(4) as pool:
        places = set(pool.map(lambda _: work.folder("a", make), range(8)))
    [place] = places
    assert len(calls) == 1
    assert (place / "a.txt").read_text() == "a"


def test_what_fails_fails_for_everyone(tmp_path: Path) -> None:
    work = SharedWork(tmp_path / "shared")

    def broken(folder: Path) -> None:
        (folder / "half.txt").touch()
        raise ValueError("broken")

    for _ in range(2):
        with pytest.raises(ValueError, match="broken"):
            work.folder("a", broken)
    assert list(work.folder("a", lambda _: None).iterdir()) == []


def test_a_line_is_run_once_on_the_same_files(here: Shell) -> None:
    number = ADD.format("n.txt", "str(hash(object()))")
    one, again = here.after(number), here.after(number)
    assert one.made == again.made
    copied = ADD.format("copy.txt", "Path('n.txt').read_text()")
    first = one.after(copied)
    assert text(first, "copy.txt") == text(one, "n.txt")
    assert first.made["n.txt"] == one.made["n.txt"]
    other = here.after(ADD.format("n.txt", "'other'")).after(copied)
    assert text(other, "copy.txt") == "other"


def test_a_line_sees_what_it_names_and_what_that_was_made_from(here: Shell) -> None:
    shell = here.after(ADD.format("a.txt", "'a'"))
    shell = shell.after(ADD.format("b.txt", "Path('a.txt').read_text() + 'b'"))
    shell = shell.after(ADD.format("c.txt", "'c'"))
    here_is = "' '.join(sorted(p.name for p in Path('b.txt').parent.glob('*.txt')))"
    assert text(shell.after(ADD.format("seen", here_is)), "seen") == "a.txt b.txt"


def test_files_written_over_are_new(here: Shell) -> None:
    shell = here.after(ADD.format("a.txt", "'a'"))
    changed = shell.after(ADD.format("a.txt", "Path('a.txt').read_text() + '!'"))
    assert text(changed, "a.txt") == "a!"
    assert text(shell, "a.txt") == "a"


def test_commands_that_fail_fail_as_for_a_reader(here: Shell) -> None:
    line = "usdhand convert samples/gestures/ok_01.usdc -o ok.bvh"
    shell = here.after(line)
    for _ in range(2):
        with pytest.raises(AssertionError, match="exists; use --force"):
            shell.after(line)
