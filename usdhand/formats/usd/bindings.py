"""Which animation a skeleton plays, what else plays it, and how that is changed in a layer."""

from __future__ import annotations

from collections.abc import Iterator

from pxr import Sdf, Usd, UsdGeom, UsdSkel

from usdhand.formats.usd.stage import Character, bound_animation, find_skeletons
from usdhand.problems import Problem, listed


def binding_prim(skeleton: Usd.Prim) -> Usd.Prim:
    """Return the prim whose ``skel:animationSource`` is in force: overriding elsewhere loses.

    Where SkelBindingAPI is not applied, UsdSkel does not see the relationship.
    """
    prim = skeleton
    while prim and not prim.IsPseudoRoot():
        if _targets(prim) is not None and prim.HasAPI(UsdSkel.BindingAPI):
            return prim
        prim = prim.GetParent()
    return skeleton


def unapplied_bindings(skeleton: Usd.Prim) -> Iterator[Problem]:
    """Bindings that have no effect, since the prim that has them lacks SkelBindingAPI."""
    prim, owner = skeleton, binding_prim(skeleton)
    played = bound_animation(skeleton)
    plays = f"{skeleton.GetPath()} plays {played.GetPath() if played else 'nothing'}"
    while prim and not prim.IsPseudoRoot():
        targets = _targets(prim)
        if targets and not prim.HasAPI(UsdSkel.BindingAPI):
            message = (
                f"skel:animationSource to {targets[0]} has no effect, since SkelBindingAPI is not "
                f"applied to this prim: {plays}"
            )
            yield Problem("unapplied-binding", message, str(prim.GetPath()))
        if prim == owner and played:
            return
        prim = prim.GetParent()


def why_nothing_is_bound(skeleton: Usd.Prim) -> str:
    """Say in a sentence why a skeleton plays no animation, and what to do."""
    path, owner = skeleton.GetPath(), binding_prim(skeleton)
    for problem in unapplied_bindings(skeleton):
        return f"{problem.where}: {problem.message}. Apply SkelBindingAPI to {problem.where}."
    targets = _targets(owner)
    if not targets:
        return f"no animation is bound to {path}. Bind a SkelAnimation with skel:animationSource."
    bound = skeleton.GetStage().GetPrimAtPath(targets[0])
    fault = "is not a SkelAnimation" if bound else "does not exist"
    return (
        f"no animation is bound to {path}: {targets[0]}, which {owner.GetPath()} names, {fault}. "
        "Bind a SkelAnimation with skel:animationSource."
    )


def bind_animation(
    layer: Sdf.Layer, character: Character, animation: Sdf.Path
) -> tuple[Problem, ...]:
    """Make a character play an animation: override the binding that is in force.

    What plays the character's animation too goes with it, if its joints are the same.

    Returns what else was bound, and what keeps the old animation.
    """
    stage, own, source = character.stage, character.skeleton, character.animation
    skeletons = find_skeletons(stage)
    others = [s for s in skeletons if source and s != own and bound_animation(s) == source]
    same = [s for s in others if _same_joints(s, own) and _within_reach(s, own)]
    bound = {own, *same}
    owners = {binding_prim(skeleton) for skeleton in bound}
    for owner in sorted(owners, key=lambda prim: prim.GetPath()):
        heirs = {s for s in skeletons if binding_prim(s) == owner}
        # A binding that other skeletons inherit stays theirs.
        for prim in [owner] if heirs <= bound else sorted(heirs & bound, key=Usd.Prim.GetPath):
            _bind(layer, prim, animation)
    followers, strangers = _meshes(character, bound, owners)
    for prim in followers:
        _bind(layer, prim, animation)
    left = [s for s in others if s not in same]
    return tuple(_words(character, [*same, *followers], [*left, *strangers]))


def apply_api(prim: Usd.Prim) -> None:
    """Apply SkelBindingAPI to a prim of a stage in memory; what it plays stays what it is."""
    if prim.HasAPI(UsdSkel.BindingAPI):
        return
    played = bound_animation(prim)
    stale = _targets(prim) is not None
    UsdSkel.BindingAPI.Apply(prim)
    if stale:
        targets = [played.GetPath()] if played else []
        prim.GetRelationship("skel:animationSource").SetTargets(targets)


def _targets(prim: Usd.Prim) -> list[Sdf.Path] | None:
    """What a prim itself binds, be it in force or not; None if it says nothing."""
    relationship = prim.GetRelationship("skel:animationSource")
    if not relationship or not relationship.HasAuthoredTargets():
        return None
    return list(relationship.GetTargets())


def _same_joints(skeleton: Usd.Prim, other: Usd.Prim) -> bool:
    """Whether all joints of a skeleton are joints of another one."""
    a, b = (set(UsdSkel.Skeleton(s).GetJointsAttr().Get() or ()) for s in (skeleton, other))
    return a <= b


def _within_reach(prim: Usd.Prim, own: Usd.Prim) -> bool:
    """Whether opinions reach a prim: no instance is above it but those above ``own`` are opened."""
    stage, opened = prim.GetStage(), own.GetPath().GetPrefixes()
    above = prim.GetPath().GetPrefixes()
    return all(path in opened for path in above if stage.GetPrimAtPath(path).IsInstance())


def _meshes(
    character: Character, bound: set[Usd.Prim], done: set[Usd.Prim]
) -> tuple[list[Usd.Prim], list[Usd.Prim]]:
    """Prims with bindings of their own to a character's animation: those that follow it or not.

    They are no skeletons, and there is none below them.
    """
    if character.animation is None:
        return [], []
    followers: list[Usd.Prim] = []
    strangers: list[Usd.Prim] = []
    source = character.animation.GetPath()
    everything = Usd.PrimRange(character.stage.GetPseudoRoot(), Usd.TraverseInstanceProxies())
    for prim in everything:
        if prim in done or prim.IsA(UsdSkel.Skeleton) or not prim.IsA(UsdGeom.Imageable):
            continue
        if not prim.HasAPI(UsdSkel.BindingAPI) or source not in (_targets(prim) or ()):
            continue
        if any(below.IsA(UsdSkel.Skeleton) for below in Usd.PrimRange(prim)):
            continue
        skeleton = UsdSkel.BindingAPI(prim).GetInheritedSkeleton().GetPrim()
        follows = not skeleton or skeleton in bound
        reached = _within_reach(prim, character.skeleton)
        (followers if follows and reached else strangers).append(prim)
    return followers, strangers


def _words(character: Character, same: list[Usd.Prim], left: list[Usd.Prim]) -> Iterator[Problem]:
    where = str(character.skeleton.GetPath())
    if same:
        names = listed([str(prim.GetPath()) for prim in same])
        message = f"what plays the same animation is bound to the new one too: {names}"
        yield Problem("shared-animation", message, where, "note")
    if left:
        names = listed([str(prim.GetPath()) for prim in left])
        message = f"what has other joints, or is in an instance, keeps the old animation: {names}"
        yield Problem("shared-animation", message, where)


def _bind(layer: Sdf.Layer, owner: Usd.Prim, animation: Sdf.Path) -> None:
    prim = Sdf.CreatePrimInLayer(layer, owner.GetPath())
    if not owner.HasAPI(UsdSkel.BindingAPI):
        schemas = Sdf.TokenListOp()
        schemas.prependedItems = ["SkelBindingAPI"]
        prim.SetInfo("apiSchemas", schemas)
    # A layer that is a copy of a stage in memory has one.
    relationship = prim.relationships.get("skel:animationSource") or Sdf.RelationshipSpec(
        prim, "skel:animationSource", custom=False
    )
    relationship.targetPathList.explicitItems = [animation]
