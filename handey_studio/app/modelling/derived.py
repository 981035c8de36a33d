"""What follows from the state of a model: the solid that is shown, where its scans stand, what the background has worked out."""

from typing import Any

from numpy.typing import NDArray

from handey_studio.app.modelling.look import POINTS, Worked
from handey_studio.app.state import State, same
from handey_studio.localization import LocateResult
from handey_studio.modeling.draft import Draft
from handey_studio.modeling.operations import AlignScan, Operation, TakeSuggestion
from handey_studio.modeling.patches.finding import patch_at
from handey_studio.modeling.patches.patch import Patches
from handey_studio.modeling.picking.snapping import Pickable
from handey_studio.modeling.replay import Built, Step
from handey_studio.modeling.scans import Scan
from handey_studio.modeling.suggesting.suggestion import Alignment, Suggestion
from handey_studio.modeling.truth_values import Truth
from handey_studio.session.graspable import Graspable
from handey_studio.session.model_look import built_of, clickable, shown_poses, unaligned

SUGGESTION, ALIGNMENT, TRUTH, GRASPS, TRIAL = "suggestion", "alignment", "truth", "grasps", "trial"


def draft_of(state: State) -> Draft | None:
    """The model in the making, while it is looked at."""
    return state.session.draft if state.modelling else None


def built(state: State) -> Built | None:
    """The model as it is shown: after all of its steps, or after those up to the one that is looked at."""
    draft = draft_of(state)
    if draft is None:
        return None
    steps = len(draft.operations)
    return built_of(draft, steps if state.model.step is None else min(state.model.step, steps))


def steps(state: State) -> tuple[Step, ...]:
    """How each step of the whole model went, also of those after the one that is looked at."""
    draft = draft_of(state)
    return built_of(draft, len(draft.operations)).steps if draft is not None else ()


def outcome(state: State, name: str, asked: tuple | None) -> Any:
    """What was worked out under that name for these arguments, None while it is not."""
    found = dict(state.model.worked).get(name)
    return found.outcome if found is not None and same(asked, found.asked) else None


def is_worked(state: State, name: str, asked: tuple | None) -> bool:
    """Whether the background is done with these arguments."""
    found = dict(state.model.worked).get(name)
    return found is not None and same(asked, found.asked)


def found_patches(state: State) -> tuple[Patches | None, ...]:
    """The planar faces of each scan, None where they are not found yet."""
    draft = draft_of(state)
    return tuple(_patches_of(state.model.patches, scan) for scan in draft.scans) if draft is not None else ()


def to_segment(state: State) -> tuple | None:
    """The next scan whose planar faces are to be found."""
    draft = draft_of(state)
    done = {id(worked.asked[0]) for worked in state.model.patches}
    scan = next((scan for scan in draft.scans if id(scan) not in done), None) if draft is not None else None
    return None if scan is None else (scan,)


def to_align(state: State) -> tuple | None:
    """The scan that is to be aligned, with the draft and all patches: once these are found."""
    draft = draft_of(state)
    scan = unaligned(draft) if draft is not None else None
    if draft is None or scan is None or to_segment(state) is not None:
        return None
    look, poses = state.model, built_of(draft, len(draft.operations)).poses
    return draft.scans, poses, scan, object_number(state), look.new_object, look.pairs, *found_patches(state)


def object_number(state: State) -> int:
    """Which object of the first scan is modelled, by its number in `Patches.objects`."""
    at, patches = state.model.object_at, found_patches(state)
    if at is None or at[0] != 0 or not patches or patches[0] is None:
        return 0
    patch = patch_at(patches[0], *at[1:])
    return patch.object if patch is not None else 0


def alignment(state: State) -> Alignment | None:
    """How the scan that is not aligned yet may lie."""
    return outcome(state, ALIGNMENT, to_align(state))


def to_suggest(state: State) -> tuple | None:
    """What a model is to be suggested of: all scans once they are aligned, while none was taken from them."""
    draft = draft_of(state)
    if draft is None or not draft.scans or to_segment(state) is not None or unaligned(draft) is not None:
        return None
    if not wants_suggestion(draft):
        return None
    return draft.scans, built_of(draft, len(draft.operations)).poses, state.model.object_at, *found_patches(state)


def wants_suggestion(draft: Draft) -> bool:
    """Whether the scans may tell more than the model holds: nothing was made yet, or a scan came in since a suggestion was taken."""
    last = {kind: _last(draft.operations, kind) for kind in (AlignScan, TakeSuggestion)}
    return built_of(draft, len(draft.operations)).solid is None or 0 <= last[TakeSuggestion] < last[AlignScan]


def suggestion(state: State) -> Suggestion | None:
    """The model that is suggested, None while none is wanted or it is being worked out."""
    return outcome(state, SUGGESTION, to_suggest(state))


def to_judge(state: State) -> tuple | None:
    """The solid that is to be held against its scans."""
    shown, draft = built(state), draft_of(state)
    if shown is None or draft is None or shown.solid is None:
        return None
    return shown.solid, draft.scans, shown.poses


def truth(state: State) -> Truth | None:
    """How the solid agrees with its scans."""
    return outcome(state, TRUTH, to_judge(state))


def to_grasp(state: State) -> tuple | None:
    """The solid whose grasps are to be counted, for the robot's hand."""
    shown = built(state)
    return None if shown is None or shown.solid is None else (shown.solid, state.robot)


def grasps(state: State) -> Graspable | None:
    """What the hand can grasp of the solid, None while that is worked out."""
    return outcome(state, GRASPS, to_grasp(state))


def to_try(state: State) -> tuple | None:
    """The scan in which the solid is to be looked for."""
    shown = built(state)
    return None if state.model.trial is None or shown is None or shown.solid is None else (state.model.trial, shown.solid)


def tried(state: State) -> LocateResult | None:
    """Where the solid was found in that scan."""
    return outcome(state, TRIAL, to_try(state))


def scan_poses(state: State) -> tuple[NDArray, ...]:
    """Where each scan is shown, T_model_scan (4, 4); while points are picked, one that is not aligned yet stands beside the others."""
    draft = draft_of(state)
    proposed = None if state.model.tool == POINTS else alignment(state)
    return shown_poses(draft, proposed, state.model.alternative) if draft is not None else ()


def scene_to_click(state: State) -> Pickable | None:
    """Everything that a click can meet."""
    draft, shown = draft_of(state), built(state)
    if draft is None or shown is None:
        return None
    return clickable(draft.scans, tuple(pose.tobytes() for pose in scan_poses(state)), found_patches(state), shown.solid)


def _patches_of(found: tuple[Worked, ...], scan: Scan) -> Patches | None:
    return next((worked.outcome for worked in found if worked.asked[0] is scan), None)


def _last(operations: tuple[Operation, ...], kind: type) -> int:
    return max((number for number, operation in enumerate(operations) if isinstance(operation, kind)), default=-1)
