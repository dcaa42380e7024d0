"""What `inspect` reports of a file."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from usdhand.anatomy import Hands
from usdhand.anatomy.channels import is_flexion
from usdhand.anatomy.hand import CharacterMap, HandMap
from usdhand.motion import Clip
from usdhand.problems import counted
from usdhand.reduce.rig import ReducedRig
from usdhand.report.document import rounded
from usdhand.report.reduce import relation_lines, relations_data
from usdhand.report.text import problems_data, table


def inspect_result(clip: Clip, hands: Hands | None, animated: bool = True) -> dict[str, Any]:
    """Everything `inspect` shows of one file; ``hands`` is None where there are none."""
    origin = clip.origin
    result: dict[str, Any] = {
        "skeleton": origin.skeleton_path,
        "animation": origin.animation_path or None,
        "joints": len(clip.skeleton),
        "frames": len(clip) if animated else 0,
        "fps": rounded(clip.fps),
        "start_s": rounded(clip.start),
        "end_s": rounded(clip.start + clip.duration),
        "time_codes_per_second": origin.time_codes_per_second,
        "cm_per_unit": rounded(origin.cm_per_unit),
        "up_axis": origin.up_axis,
        "problems": problems_data(clip.problems),
    }
    if hands is not None:
        result |= map_data(clip, hands.character)
        if pronation := hands.pronation:
            result["thumbs"] = {
                "pronation_deg": pronation.degrees,
                "decided_by": pronation.witness,
            }
        if animated:
            result["channels"] = _channel_ranges(clip, hands)
            result["off_axis_share"] = _off_axis_shares(clip, hands)
        result["notes"] = list(hands.notes)
        result["problems"] += problems_data(hands.problems)
    return result


def map_data(clip: Clip, character: CharacterMap) -> dict[str, Any]:
    """The joints that were found, by path."""
    joints = clip.skeleton.joints

    def name(index: int | None) -> str | None:
        return None if index is None else joints[index]

    def hand(found: HandMap) -> dict[str, Any]:
        return {
            "wrist": name(found.wrist),
            "elbow": name(found.elbow),
            "shoulder": name(found.shoulder),
            "clavicle": name(found.clavicle),
            "joints": {k: joints[v] for k, v in found.joints.items()},
            "metacarpals": {k: joints[v] for k, v in found.metacarpals.items()},
            "tips": {k: joints[v] for k, v in found.tips.items()},
            "missing": list(found.missing),
        }

    return {
        "convention": character.convention,
        "hands": {side: hand(found) for side, found in character.hands.items()},
        "hips": name(character.hips),
        "chest": name(character.chest),
        "neck": name(character.neck),
        "head": name(character.head),
        "notes": list(character.notes),
        "evidence": list(character.evidence),
    }


def rig_result(rig: ReducedRig) -> dict[str, Any]:
    """What follows what in a rig, and how well it was told."""
    return {
        "free_channels": len(rig.free),
        "total_channels": len(rig.names),
        "fit": rig.fit,
        "measure": rig.measure or None,
        "fitted_to": list(rig.sources),
        "relations": relations_data(rig),
        "held_channels": {name: rounded(value) for name, value in rig.held.items()},
    }


def summary(result: Mapping[str, Any], verbose: bool) -> str:
    """All files, one below the other."""
    return "\n".join(_text(file, verbose) for file in result["files"] if "error" not in file)


def _channel_ranges(clip: Clip, hands: Hands) -> list[dict[str, Any]]:
    channels = hands.encode(clip)
    modelled = set(hands.model_names)
    return [
        {
            "name": name,
            "modelled": name in modelled,
            "flexion": is_flexion(name),
            "min_deg": rounded(curve.min()),
            "max_deg": rounded(curve.max()),
            "mean_deg": rounded(curve.mean()),
        }
        for name, curve in zip(channels.names, channels.values.T, strict=True)
    ]


def _off_axis_shares(clip: Clip, hands: Hands) -> dict[str, float]:
    """Share of the variance of hinge joints that is not flexion, where they move."""
    channels = hands.encode(clip)
    variance = dict(zip(channels.names, channels.values.var(axis=0), strict=True))
    shares = {}
    for name in channels.names:
        joint = name[:-1]
        if not (is_flexion(name) and joint.endswith("IP")):  # the hinges: PIP, DIP, thumb IP
            continue
        total = sum(variance[joint + letter] for letter in "xyz")
        if total > 1.0:
            shares[joint] = rounded(1.0 - variance[name] / total)
    return shares


def _text(result: Mapping[str, Any], verbose: bool) -> str:
    rig = _rig_lines(result["rig"]) if "rig" in result else []
    if "joints" not in result:  # a rig without a character
        return "\n".join([f"{result['path']}", *rig])
    skeleton = f"skeleton {result['skeleton']}, " if result["skeleton"] else ""
    lines = [
        f"{result['path']}",
        f"  {skeleton}{counted(result['joints'], 'joint')}, "
        f"{result['cm_per_unit']:g} cm per unit, {result['up_axis']} up",
    ]
    if result["animation"]:
        lines.append(
            f"  motion {result['animation']}, {counted(result['frames'], 'frame')} at "
            f"{result['fps']:g} fps, {result['start_s']:.3f} to {result['end_s']:.3f} s"
        )
    elif "animations" in result:
        names = ", ".join(f"'{name}'" for name in result["animations"])
        lines.append(f"  {len(result['animations'])} animations: {names}")
    else:
        lines.append("  no motion")
    if "hand_error" in result:
        lines.append(f"  no hands: {result['hand_error']}")
    else:
        lines += _hand_lines(result, verbose)
    lines += [
        f"  {p['severity']}: {p['message']}" + (f" ({p['where']})" if p["where"] else "")
        for p in result["problems"]
    ]
    return "\n".join(lines + rig)


def _rig_lines(rig: Mapping[str, Any]) -> list[str]:
    relations = rig["relations"]
    kinds = [r["kind"] for r in relations]
    sources = rig["fitted_to"]
    clips = (
        counted(len(sources), "clip") if len(sources) > 1 else "".join(sources) or "no named clip"
    )
    head = (
        f"  hand rig: {rig['free_channels']} of {rig['total_channels']} channels free, "
        f"{kinds.count('linear')} follow, {kinds.count('constant')} constant; "
        f"{rig['fit']} fit to {clips}"
    )
    return [head, *(f"    {line}" for line in relation_lines(relations))]


def _hand_lines(result: Mapping[str, Any], verbose: bool) -> list[str]:
    lines = [f"  hands by convention '{result['convention']}'"]
    for side, hand in result["hands"].items():
        missing = f", without {', '.join(hand['missing'])}" if hand["missing"] else ""
        lines.append(
            f"    {side}: {counted(len(hand['joints']), 'joint')}{missing}, "
            f"wrist {_leaf(hand['wrist'])}, elbow {_leaf(hand['elbow'])}, "
            f"shoulder {_leaf(hand['shoulder'])}"
        )
    body = ", ".join(f"{k} {_leaf(result[k])}" for k in ("hips", "chest", "neck", "head"))
    lines.append(f"    body: {body}")
    if thumbs := result.get("thumbs"):
        lines.append(
            f"    thumbs: pronation {thumbs['pronation_deg']:g} deg, by {thumbs['decided_by']}"
        )
    channels = result.get("channels", [])
    shown = [c for c in channels if verbose or c["flexion"]]
    if shown:
        head = ["channel" if verbose else "flexion", "min deg", "max deg", "mean deg"]
        numbers = [
            [c["name"], *(f"{c[k]:.1f}" for k in ("min_deg", "max_deg", "mean_deg"))] for c in shown
        ]
        lines += ["    " + line for line in table([head, *numbers], right=(1, 2, 3)).splitlines()]
    if verbose:
        lines += [f"    evidence: {said}" for said in result["evidence"]]
        for side, hand in result["hands"].items():
            lines += [f"    {side} {name}: {path}" for name, path in hand["joints"].items()]
    return lines


def _leaf(joint: str | None) -> str:
    return "not found" if joint is None else joint.rsplit("/", 1)[-1]
