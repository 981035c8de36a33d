"""`handey model replay`: a part's history run again, each step with its outcome."""

import argparse
import time
from pathlib import Path
from typing import TYPE_CHECKING, Any

from handey_studio.base import BadInput, measured
from handey_studio.commands.arguments import DONE, FAILED, NOTHING_FOUND, check_output, check_suffix, write_json

if TYPE_CHECKING:
    from handey_studio.geometry import Polyhedron
    from handey_studio.modeling.replay import Built

NAME = "model replay"
HELP = "run the history of a part that was modelled from depth, and tell how each step went"
SCHEMA = "handey/model-replay/1"


def add_arguments(replay: argparse.ArgumentParser) -> None:
    replay.add_argument("draft", type=Path, metavar="DRAFT", help="a .draft file: scans and the operations over them")
    replay.add_argument("--out", type=Path, metavar="PART.obj", help="where the solid goes, in metres, with true polygon faces")
    replay.add_argument("--json", type=Path, metavar="OUT", help="where the steps, the solid and the timing go")


def run(given: argparse.Namespace) -> int:
    """Exit status 0 when every step was done, 1 when one fell, 3 when no solid comes of it."""
    from handey_studio.modeling.draft_files import read_draft
    from handey_studio.modeling.replay import replay
    from handey_studio.world.model_files import write_obj

    check_output(given.out)
    check_output(given.json)
    check_suffix(given.out, ".obj")
    begun = time.perf_counter()
    draft = read_draft(given.draft)
    read = time.perf_counter() - begun
    built = replay(draft)
    timing = {"read": read, "replay": time.perf_counter() - begun - read}
    for step in built.steps:
        print(f"{step.number + 1}. {step.told}" + (f": {step.reason}" if step.reason else ""))
    print(_summary(draft.name, built))
    if given.json:
        write_json(given.json, {"schema": SCHEMA, "name": draft.name} | _report(built) | {"timing_s": timing})
    if built.solid is None:
        return NOTHING_FOUND
    if given.out:
        try:
            write_obj(given.out, built.solid)
        except OSError as error:
            raise BadInput(f'"{given.out}" cannot be written: {error.strerror}.') from None
    return FAILED if any(step.reason for step in built.steps) else DONE


def _summary(name: str, built: "Built") -> str:
    from handey_studio.modeling.suggesting.report import aligned_box

    fallen = sum(step.reason is not None for step in built.steps)
    steps = f"{len(built.steps)} steps, {fallen} not done" if fallen else f"{len(built.steps)} steps, all done"
    if built.solid is None:
        return f"{name}: {steps}; no solid."
    size = " × ".join(measured(float(side), "m").removesuffix(" mm") for side in aligned_box(built.solid))
    volume = built.solid.volume_and_centroid[0] * 1e6
    return f"{name}: {steps}; {len(built.solid.faces)} faces, {size} mm, {volume:.4g} cm³."


def _report(built: "Built") -> dict[str, Any]:
    """The outcome as JSON values: lengths in metres, in the model's frame."""
    poses = built.Ts_model_scan
    return {
        "scans": [{"name": name, "T_model_scan": poses[name].tolist() if name in poses else None} for name in built.scans],
        "steps": [{"number": s.number + 1, "kind": s.kind, "told": s.told, "reason": s.reason} for s in built.steps],
        "solid": None if built.solid is None else _solid(built.solid, built.sources),
    }


def _solid(solid: "Polyhedron", sources: tuple[str, ...]) -> dict[str, Any]:
    volume, centroid = solid.volume_and_centroid
    faces = [
        {"loops": [list(loop) for loop in face.loops], "normal": normal.tolist(), "offset_m": float(offset), "source": source}
        for face, normal, offset, source in zip(solid.faces, solid.normals, solid.offsets, sources, strict=True)
    ]
    return {"vertices_m": solid.vertices.tolist(), "faces": faces, "volume_m3": volume, "centroid_m": centroid.tolist()}
