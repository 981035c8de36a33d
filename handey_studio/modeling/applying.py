"""What each kind of step does to the state: one function a kind."""

from collections.abc import Callable
from dataclasses import replace

from handey_studio.base import BadInput
from handey_studio.base.errors import unknown_name
from handey_studio.modeling.operations import AlignScan, Delete, Operation, Sketch
from handey_studio.modeling.outline import sound_corners
from handey_studio.modeling.state import PlacedOutline, State


def applied(operation: Operation, state: State) -> State:
    """The state after an operation. Raises BadInput with one sentence when it cannot be done."""
    if type(operation) not in STEPS:
        raise BadInput(f'"{operation.kind}" cannot be replayed yet.')
    return STEPS[type(operation)](operation, state)


def _align_scan(operation: AlignScan, state: State) -> State:
    if operation.scan not in state.scans:
        raise unknown_name("scan", operation.scan, state.scans)
    if operation.scan == state.scans[0]:
        raise BadInput(f'scan "{operation.scan}" is the first one, whose world is the frame of the model; align the others to it.')
    others = tuple(pose for pose in state.poses if pose[0] != operation.scan)
    return replace(state, poses=(*others, (operation.scan, operation.T_model_scan)))


def _sketch(operation: Sketch, state: State) -> State:
    sound_corners(operation.outline)
    others = tuple(sketch for sketch in state.sketches if sketch.name != operation.name)
    return replace(state, sketches=(*others, PlacedOutline(operation.name, operation.T_model_plane, operation.outline)))


def _delete(operation: Delete, state: State) -> State:
    if operation.what == "solid":
        if state.solid is None:
            raise BadInput("there is no solid to delete.")
        return replace(state, solid=None, sources=(), makers=())
    names = [sketch.name for sketch in state.sketches]
    if operation.what not in names:
        raise unknown_name("sketch", operation.what, names)
    return replace(state, sketches=tuple(sketch for sketch in state.sketches if sketch.name != operation.what))


STEPS: dict[type[Operation], Callable[..., State]] = {AlignScan: _align_scan, Sketch: _sketch, Delete: _delete}
