"""What is worked out of a model away from the loop: planar faces, suggestions, alignments, truth, and what uploaded files hold."""

import threading
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

from numpy.typing import NDArray

from handey_studio.app.background import Background
from handey_studio.app.modelling import derived
from handey_studio.app.modelling.importing import MeshMeasured, MeshRead
from handey_studio.app.modelling.look import Worked
from handey_studio.app.modelling.scanning import ScanRead
from handey_studio.app.modelling.showing import look_at_object
from handey_studio.app.state import State
from handey_studio.base import BadInput
from handey_studio.geometry import Polyhedron
from handey_studio.localization import LocateResult, localize
from handey_studio.modeling.aligning.align import align
from handey_studio.modeling.patches.finding import patches_of
from handey_studio.modeling.patches.patch import Patches
from handey_studio.modeling.picking import sightlines
from handey_studio.modeling.scans import Scan
from handey_studio.modeling.suggesting import warm_up as suggest_warm_up
from handey_studio.modeling.suggesting.suggest import suggest
from handey_studio.modeling.suggesting.suggestion import Alignment, Suggestion
from handey_studio.modeling.truth import truth
from handey_studio.modeling.truth_values import Truth
from handey_studio.session.graspable import graspable
from handey_studio.session.mesh_files import extents_of_upload, part_of_upload
from handey_studio.session.model_files import scan_of_upload
from handey_studio.world import Part

KEPT_PATCHES = 24
MODEL_NAME = "model"


@dataclass(frozen=True, eq=False)
class Segmented:
    """The planar faces of a scan were found; of a first scan, every camera goes to its largest object."""

    worked: Worked

    def run(self, bench: Any) -> State:
        model = bench.state.model
        state = replace(bench.state, model=replace(model, patches=(*model.patches, self.worked)[-KEPT_PATCHES:]))
        draft, found = derived.draft_of(state), self.worked.outcome
        if draft is not None and draft.scans and self.worked.asked[0] is draft.scans[0] and found is not None:
            look_at_object(bench, found)
        return state


@dataclass(frozen=True, eq=False)
class WorkedOut:
    """Something was worked out under a name."""

    name: str
    worked: Worked

    def apply(self, state: State) -> State:
        others = tuple(entry for entry in state.model.worked if entry[0] != self.name)
        return replace(state, model=replace(state.model, worked=(*others, (self.name, self.worked))))


@dataclass(frozen=True)
class Task:
    """One thing that is worked out: what a state wants, the work, and the command that tells the outcome, as in `Background`."""

    wanted: Callable[[State], tuple | None]
    work: Callable[..., Any]
    told: Callable[[tuple, Any], Any]


def modelling_workers(send: Callable[[Any], None]) -> tuple[Background, ...]:
    """One worker for each thing that a model wants worked out; meanwhile what they run is compiled."""
    threading.Thread(target=_warm_up, name="modelling-warm-up", daemon=True).start()
    return tuple(Background(send, task.wanted, task.work, task.told) for task in TASKS)


def _warm_up() -> None:
    sightlines.warm_up()
    suggest_warm_up.warm_up()


def aligned(
    scans: tuple[Scan, ...],
    poses: tuple[tuple[str, NDArray], ...],
    new: Scan,
    number: int,
    new_number: int,
    pairs: tuple[tuple[NDArray, NDArray], ...],
    *patches: Patches,
) -> Alignment:
    """How the new one of the scans may lie; `number` and `new_number` name the object in the first scan and in the new one."""
    known, found = dict(poses), dict(zip([scan.name for scan in scans], patches, strict=True))
    placed = [scan for scan in scans if scan.name in known]
    Ts = [known[scan.name] for scan in placed]
    try:
        return align(placed, Ts, new, [found[scan.name] for scan in placed], found[new.name], (number, new_number), pairs)
    except BadInput as error:
        return Alignment(None, (), 0.0, (), (), str(error).rstrip("."))


def suggested(
    scans: tuple[Scan, ...], poses: tuple[tuple[str, NDArray], ...], at: tuple[int, float, float] | None, *patches: Patches
) -> Suggestion:
    """The model that the scans suggest; `poses` are those of the scans by name."""
    known = dict(poses)
    return suggest(scans, [known[scan.name] for scan in scans], at, patches)


def judged(solid: Polyhedron, scans: tuple[Scan, ...], poses: tuple[tuple[str, NDArray], ...]) -> Truth:
    """How a solid agrees with the scans that are aligned."""
    known = dict(poses)
    aligned = tuple(scan for scan in scans if scan.name in known)
    return truth(solid, aligned, tuple(known[scan.name] for scan in aligned))


def located(scan: Scan, solid: Polyhedron) -> LocateResult:
    """Where the localizer finds a solid in a scan."""
    return localize(scan.view, (Part(MODEL_NAME, solid),))


def _to_measure(state: State) -> tuple | None:
    mesh = state.model.mesh
    return None if mesh is None or mesh.extents or mesh.upload.tells_unit else (mesh.upload,)


def _to_import(state: State) -> tuple | None:
    mesh = state.model.mesh
    return None if mesh is None or mesh.refusal or not mesh.upload.tells_unit else (mesh.upload,)


def _to_read(state: State) -> tuple | None:
    return None if state.model.reading is None else (state.model.reading,)


def _named(name: str, wanted: Callable[[State], tuple | None], work: Callable[..., Any]) -> Task:
    return Task(wanted, work, lambda asked, found: WorkedOut(name, Worked(asked, found)))


TASKS = (
    Task(derived.to_segment, patches_of, lambda asked, found: Segmented(Worked(asked, found))),
    Task(_to_read, scan_of_upload, lambda asked, said: ScanRead(asked[0], said)),
    Task(_to_measure, extents_of_upload, lambda asked, said: MeshMeasured(asked[0], said)),
    Task(_to_import, part_of_upload, lambda asked, said: MeshRead(asked[0], said)),
    _named(derived.ALIGNMENT, derived.to_align, aligned),
    _named(derived.SUGGESTION, derived.to_suggest, suggested),
    _named(derived.TRUTH, derived.to_judge, judged),
    _named(derived.TRIAL, derived.to_try, located),
    _named(derived.GRASPS, derived.to_grasp, graspable),
)
