"""Selecting: what is clicked of the model, or the object of a scan that is to be modelled; and aligning a scan by pairs of points."""

from dataclasses import replace

from handey_studio.app.modelling.derived import draft_of, found_patches, scan_poses, wants_suggestion
from handey_studio.app.modelling.tool_clicks import with_click, with_tool
from handey_studio.app.state import State
from handey_studio.base import BadInput
from handey_studio.geometry.transforms import apply, inverse
from handey_studio.modeling.picking.snap import MODEL, Snap
from handey_studio.session.model_look import unaligned
from handey_studio.session.strokes import pixel_of

LEAST_CLICKS = 6  # three pairs


def selected(state: State, snap: Snap | None, add: bool) -> State:
    """What was clicked is selected; of a scan that is still to be modelled, its object is."""
    draft = draft_of(state)
    new = unaligned(draft) if draft is not None else None
    if snap is not None and draft is not None and new is not None and snap.owner >= 0 and draft.scans[snap.owner] is new:
        return _new_object(state, snap)
    if snap is not None and snap.owner != MODEL and draft is not None and wants_suggestion(draft):
        at = pixel_of(draft.scans[snap.owner], scan_poses(state)[snap.owner], snap.point)
        return replace(state, model=replace(state.model, object_at=(snap.owner, *at), picked=()))
    picked = () if snap is None else ((*state.model.picked[-1:], snap) if add else (snap,))
    return replace(state, model=replace(state.model, picked=picked))


def _new_object(state: State, snap: Snap) -> State:
    """Of the scan that is not aligned yet, the object that was clicked is the one that is modelled."""
    patches = found_patches(state)[snap.owner]
    if patches is None or not 0 <= snap.number < len(patches.patches):
        return state
    return replace(state, model=replace(state.model, new_object=patches.patches[snap.number].object, pairs=(), alternative=0))


def points_clicked(state: State, snap: Snap) -> State:
    """By turns a point of the aligned scans (or the model) and the same one on the new scan."""
    draft = draft_of(state)
    new = unaligned(draft) if draft is not None else None
    if draft is None or new is None:
        return state
    on_new = snap.owner >= 0 and draft.scans[snap.owner] is new
    if on_new != (len(state.model.clicks) % 2 == 1):
        raise BadInput("click by turns: first the point on the aligned scans, then the same point on the new one.")
    return with_click(state, snap)


def aligned_by_points(state: State) -> State:
    """The pairs are given to the alignment, which refines the pose that they tell."""
    draft, clicks = draft_of(state), state.model.clicks
    new = unaligned(draft) if draft is not None else None
    if draft is None or new is None:
        raise BadInput("every scan is aligned already; add a scan first.")
    if len(clicks) < LEAST_CLICKS:
        raise BadInput(f"there are {len(clicks) // 2} pairs of points; click at least 3.")
    to_new = inverse(scan_poses(state)[draft.scans.index(new)])
    points = [snap.point for snap in clicks]
    pairs = tuple((a, apply(to_new, b)) for a, b in zip(points[::2], points[1::2], strict=False))
    return with_tool(replace(state, model=replace(state.model, pairs=pairs, alternative=0)))
