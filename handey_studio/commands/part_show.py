"""`handey part show`: what is known of a part, what is wrong with it, and what a hand can grasp of it."""

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from handey_studio.base import measured
from handey_studio.commands.arguments import BAD_INPUT, DONE, check_output, write_json

if TYPE_CHECKING:
    from handey_studio.world import Part

NAME = "part show"
HELP = "a part's size, volume, mass, symmetry, faces, checks, and its grasp classes for a robot's hand"


def add_arguments(show: argparse.ArgumentParser) -> None:
    show.add_argument("part", help="a part by name, or a mesh file in metres")
    show.add_argument("--robot", default="ur5", help="whose hand (default: ur5)")
    show.add_argument("--json", type=Path, help="where the same goes as JSON")


def run(given: argparse.Namespace) -> int:
    from handey_studio.grasping import grasp_groups
    from handey_studio.modeling.checks import solid_checks
    from handey_studio.world import Library

    check_output(given.json)
    library = Library.choose(given.library)
    part, robot = library.part(given.part), library.robot(given.robot)
    groups, _ = grasp_groups(part, robot.hand)
    checks = solid_checks(part.solid, part.density)
    classes = len({group.grasp_class for group in groups})
    print(f"{part.name}: {len(part.solid.faces)} faces, {len(part.solid.edges)} edges, {len(part.solid.vertices)} corners")
    for check in checks:
        print(f"{'ok' if check.ok else 'wrong':6} {check.sentence}{' ' if check.fix else ''}{check.fix}")
    print(f"looks the same in {len(part.symmetries)} {'pose' if len(part.symmetries) == 1 else 'poses'}")
    for line in _told(part):
        print(line)
    print(f"{classes} grasp classes with {len(groups)} approach groups for the hand of {given.robot}")
    if given.json:
        write_json(given.json, _report(part, checks, classes, len(groups)))
    return DONE if all(check.ok for check in checks) else BAD_INPUT


def _told(part: "Part") -> list[str]:
    """Where it came from."""
    told = part.provenance
    lines = [told.source] if told.source else []
    if told.scans:
        lines.append(f"modelled from {', '.join(told.scans)}")
    if told.rms_m is not None:
        lines.append(f"{measured(told.rms_m, 'm')} rms off its readings")
    if told.seen is not None:
        lines.append(f"{100 * told.seen:.0f} % of its surface seen")
    if told.assumed_faces:
        lines.append(f"assumed faces: {', '.join(str(f) for f in told.assumed_faces)}")
    return lines


def _report(part: "Part", checks: tuple, classes: int, groups: int) -> dict:
    volume, centre = part.solid.volume_and_centroid
    low, high = part.solid.vertices.min(axis=0), part.solid.vertices.max(axis=0)
    return {
        "schema": "handey/part/1",
        "part": part.name,
        "low_m": low.tolist(),
        "high_m": high.tolist(),
        "volume_m3": volume,
        "mass_kg": part.mass,
        "centre_of_mass_m": centre.tolist(),
        "faces": len(part.solid.faces),
        "edges": len(part.solid.edges),
        "vertices": len(part.solid.vertices),
        "symmetries": len(part.symmetries),
        "grasp_classes": classes,
        "approach_groups": groups,
        "mates": sorted(part.mates),
        "provenance": part.provenance.source,
        "checks": [{"name": c.name, "ok": c.ok, "sentence": c.sentence, "fix": c.fix, "faces": list(c.faces)} for c in checks],
    }
