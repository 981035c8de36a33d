"""The tools that need a plane, to cut or to mirror by, and the one that measures."""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from handey_studio.app.modelling.steps import operated
from handey_studio.app.modelling.tool_clicks import MEASURE, check_apart, with_click
from handey_studio.app.state import State
from handey_studio.base import BadInput
from handey_studio.modeling.operations import CutByPlane, Mirror
from handey_studio.modeling.picking.measuring import Measurement, measure
from handey_studio.modeling.picking.snap import Snap
from handey_studio.modeling.taking import reference_of
from handey_studio.session.strokes import plane_normal, plane_of


def plane_clicked(state: State, snap: Snap) -> State:
    """A face gives its plane with one click; corners, edges and readings with three."""
    before = state.model.clicks
    if snap.kind == "plane" and not before:
        return with_click(state, snap)
    state = with_click(replace(state, model=replace(state.model, clicks=before if 0 < len(before) < 3 else ())), snap)
    if len(state.model.clicks) < 3:
        check_apart(state.model.clicks)
    else:
        plane_normal(np.array([click.point for click in state.model.clicks]), state.model.eye)
    return state


def tool_plane(state: State) -> tuple[NDArray, NDArray] | None:
    """Point (3,) [m] and normal (3,) of the plane that cuts or mirrors, with its offset; None while it is not clicked yet."""
    clicks, settings = state.model.clicks, state.model.settings
    if len(clicks) == 1 and clicks[0].kind == "plane":
        point, normal = plane_of(clicks[0])
    elif len(clicks) == 3:
        points = np.array([click.point for click in clicks])
        point, normal = points[0], plane_normal(points, state.model.eye)
    else:
        return None
    return point + settings.offset * normal, -normal if settings.flip else normal


def cut(state: State) -> State:
    return operated(state, CutByPlane(*_plane_needed(state)))


def mirrored(state: State) -> State:
    return operated(state, Mirror(*_plane_needed(state), state.model.settings.keep_original))


def _plane_needed(state: State) -> tuple[NDArray, NDArray]:
    plane = tool_plane(state)
    if plane is None:
        raise BadInput("click a face whose plane is meant, or three points of a plane, first.")
    return plane


def measure_clicked(state: State, snap: Snap) -> State:
    clicks = state.model.clicks
    return replace(state, model=replace(state.model, clicks=(snap,) if len(clicks) != 1 else (*clicks, snap)))


def measurement(state: State) -> Measurement | None:
    """What the measuring tool tells of its two clicks."""
    if state.model.tool != MEASURE or len(state.model.clicks) != 2:
        return None
    return measure(*(reference_of(snap) for snap in state.model.clicks))
