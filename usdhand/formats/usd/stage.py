"""Opening stages and choosing a character on them."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from pickle import PicklingError

from pxr import Sdf, Tf, Usd, UsdSkel, Work

from usdhand.errors import InputError, UsageError
from usdhand.formats.suffixes import USD_SUFFIXES
from usdhand.formats.usd.damage import first_line, refuses_damage, sentence, usd_diagnostics
from usdhand.formats.usd.motion_crate import motion_of, other_motion
from usdhand.inputs import is_text, why_no_file
from usdhand.problems import CHOICES, Problem, listed
from usdhand.witness import opening


@dataclass(frozen=True, eq=False)
class Character:
    """A skeleton on a stage with the animation bound to it, if any.

    Copies share the stage. Stages do not go from process to process: pickled, it becomes a
    `ClosedCharacter`.
    """

    stage: Usd.Stage
    path: Path
    skeleton: Usd.Prim
    animation: Usd.Prim | None
    problems: tuple[Problem, ...] = ()

    @property
    def root(self) -> Usd.Prim:
        """The SkelRoot above the skeleton, or the skeleton's own parent where there is none."""
        root = UsdSkel.Root.Find(self.skeleton)
        if root:
            return root.GetPrim()
        parent = self.skeleton.GetParent()
        return self.skeleton if parent.IsPseudoRoot() else parent

    def __deepcopy__(self, _: object) -> Character:
        return self

    def __reduce__(self) -> tuple[type[ClosedCharacter], tuple[Path, str]]:
        if self.stage.GetRootLayer().anonymous:
            raise PicklingError(f"{self.path}: a character on a stage in memory cannot be pickled.")
        return ClosedCharacter, (self.path.absolute(), str(self.skeleton.GetPath()))


@dataclass(frozen=True)
class ClosedCharacter:
    """Where a character is to be found again in another process."""

    path: Path
    skeleton: str

    def opened(self) -> Character:
        """Open its stage; raises the errors of `find_character`."""
        return find_character(self.path, self.skeleton)


def compose(root: str | Sdf.Layer, load: Usd.Stage.InitialLoadSet = Usd.Stage.LoadAll) -> Usd.Stage:
    """Compose a file or layer as a stage. All stages come from here, so that they can be counted.

    Raises
    ------
    Tf.ErrorException
        if it cannot be opened.
    """
    if isinstance(root, str):
        opening(root)
    with one_thread():
        return Usd.Stage.Open(root, load)


@contextmanager
def one_thread() -> Iterator[None]:
    """Let USD compose in one thread.

    A prototype is made of the instance that comes first, and targets that lead out of instances
    depend on which it is: several threads would give a stage other targets from time to time.
    """
    limit = Work.GetConcurrencyLimit()
    Work.SetConcurrencyLimit(1)
    try:
        yield
    finally:
        Work.SetConcurrencyLimit(limit)


@refuses_damage
def open_stage(path: Path) -> tuple[Usd.Stage, tuple[Problem, ...]]:
    """Open a stage; what could not be composed comes back as problems.

    Raises
    ------
    InputError
        if there is no such file, or USD cannot read it.
    """
    if not is_text(str(path.absolute())):
        raise InputError(f"{readable(path)}: this name is not valid UTF-8, which USD needs.")
    if why := why_no_file(path):
        raise InputError(f"{path}: {why}.")
    if path.suffix.lower() not in USD_SUFFIXES:
        raise InputError(
            f"{path}: '{path.suffix}' is not a USD file; expected one of {', '.join(USD_SUFFIXES)}."
        )
    stage = None
    with usd_diagnostics() as messages:
        try:
            stage = compose(str(path))
        except Tf.ErrorException as error:
            messages += [sentence(e) for e in error.args]
    if stage is None:
        detail = f" ({first_line(messages[0])})" if messages else ""
        message = "USD cannot read this file; it may be damaged or not USD"
        raise InputError(f"{path}: {message}{detail}.")
    problems = [
        Problem("composition", f"not everything could be composed: {first_line(str(error))}")
        for error in stage.GetCompositionErrors()
    ]
    if not problems:
        problems = [Problem("usd", first_line(message)) for message in messages]
    if crate := other_motion(stage.GetRootLayer()):
        message = f"{crate} is not as it was written with this file: the motion may be another one"
        problems.append(Problem("other-motion", message))
    return stage, tuple(problems)


def readable(path: Path) -> str:
    r"""Return a path for people, its bytes that are no text as ``\xff``."""
    return os.fsencode(path).decode(errors="backslashreplace")


def find_skeletons(stage: Usd.Stage) -> list[Usd.Prim]:
    """All skeletons that are on the stage, those inside instances included."""
    everything = Usd.PrimRange(stage.GetPseudoRoot(), Usd.TraverseInstanceProxies())
    return [prim for prim in everything if prim.IsA(UsdSkel.Skeleton)]


@refuses_damage
def find_character(path: Path, skel: str | None = None) -> Character:
    """Open ``path`` and choose its character.

    Parameters
    ----------
    skel : path or name of the skeleton (or of a prim above it), needed where there are several

    Raises
    ------
    InputError
        if the file cannot be read or holds no skeleton.
    UsageError
        if several skeletons are there and ``skel`` does not choose one.
    """
    stage, problems = open_stage(path)
    return character_on(stage, path, problems, skel)


def character_on(
    stage: Usd.Stage, path: Path, problems: tuple[Problem, ...], skel: str | None = None
) -> Character:
    """The character of a stage that was opened from ``path``; see `find_character`."""
    skeletons = find_skeletons(stage)
    if not skeletons:
        lost = f" Note: {problems[0]}." if problems else ""
        if name := motion_of(path):
            lost = f" It holds the motion of {name}: give that file."
        raise InputError(f"{path}: there is no UsdSkel skeleton on this stage.{lost}")
    prim = choose_skeleton(path, skeletons, skel)
    return Character(stage, path, prim, bound_animation(prim), problems)


def bound_animation(skeleton: Usd.Prim) -> Usd.Prim | None:
    """Return the SkelAnimation that drives a skeleton: bound on it or inherited."""
    with usd_diagnostics():  # a binding that leads nowhere is said by us
        prim = UsdSkel.BindingAPI(skeleton).GetInheritedAnimationSource()
    return prim if prim and prim.IsA(UsdSkel.Animation) else None


def choose_skeleton(path: Path, skeletons: list[Usd.Prim], skel: str | None) -> Usd.Prim:
    """Return the skeleton that ``skel`` means, or the one that is there; see `find_character`."""
    paths = [str(s.GetPath()) for s in skeletons]
    names = listed(paths, CHOICES)
    if skel is None:
        animated = [s for s in skeletons if bound_animation(s)]
        if len(skeletons) == 1:
            return skeletons[0]
        if len(animated) == 1:
            return animated[0]
        raise UsageError(
            f"{path} holds {len(skeletons)} skeletons; choose one with --skel: {names}"
        )
    found = [s for s in skeletons if is_meant(s.GetPath(), skel)]
    if len(found) == 1:
        return found[0]
    reason = "no skeleton" if not found else f"{len(found)} skeletons"
    raise UsageError(f"{path}: --skel {skel} matches {reason}; there are: {names}")


def is_meant(path: Sdf.Path, skel: str) -> bool:
    """Whether ``skel`` is this path, a path above it, or a name in it."""
    if skel.startswith("/") and Sdf.Path.IsValidPathString(skel):
        return bool(path.HasPrefix(Sdf.Path(skel)))
    return skel in str(path).split("/")
