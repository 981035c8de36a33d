"""Where scans come from: the cell, uploads, the library, an example; and opening and closing the model."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

from handey_studio.app.jobs import JobStarted
from handey_studio.app.modelling.look import SELECT, ModelLook, Waiting
from handey_studio.app.planner import Run
from handey_studio.app.session_actions import OpenSession
from handey_studio.app.state import BUSY, State
from handey_studio.base import BadInput
from handey_studio.modeling.draft import Draft, with_scan
from handey_studio.modeling.scans import Scan
from handey_studio.session import Session
from handey_studio.session.model_files import Upload
from handey_studio.session.modelling import scan_cell, turn_over

NAME = "part"
EXAMPLE = "model_a_part"
MAX_UPLOAD_BYTES = 64_000_000


@dataclass(frozen=True)
class OpenModel:
    """The scene shows the model; a new one where none is under way."""

    def apply(self, state: State) -> State:
        return replace(state, playing=False, model=replace(state.model, open=True))


@dataclass(frozen=True)
class CloseModel:
    """Back to the MOVE; the model stays as it is."""

    def apply(self, state: State) -> State:
        return replace(state, model=replace(state.model, open=False, clicks=(), tool=SELECT))


@dataclass(frozen=True)
class NewModel:
    """The model that is under way is put aside; undo brings it back."""

    def apply(self, state: State) -> State:
        state = replace(state, model=replace(fresh(state.model), open=True))
        return state.changed("start a new model", replace(state.session, draft=None))


@dataclass(frozen=True)
class Order:
    """The planner's process is asked for something else than a MOVE."""

    title: str
    work: Run
    done: Callable[[State, Session], State]

    def run(self, bench: Any) -> State:
        return self.given(bench, bench.state)

    def given(self, bench: Any, state: State) -> State:
        """The order given in a state that may not be the bench's yet."""
        if state.job is not None:
            raise BadInput(BUSY)
        state = JobStarted(False, self.title, self.done).apply(state)
        bench.planner.order(state.jobs, state.session, state.library, False, self.work)
        return state


def scanned(state: State, found: Session) -> State:
    """The cell was scanned: its scan joins the model."""
    return with_new_scan(state, found.draft.scans[0]) if found.draft is not None else state


def turned(state: State, found: Session) -> State:
    """The object lies otherwise; what was sensed of the cell before is stale."""
    session = replace(state.session.without_findings(), cell_now=found.cell_now)
    return replace(state, session=session).told("The object was turned over. Scan the cell again to see its other sides.", "good")


SCAN_CELL = Order("Scanning", scan_cell, scanned)
TURN_OVER = Order("Turning the object over", turn_over, turned)


def with_new_scan(state: State, scan: Scan) -> State:
    """The model with one more scan, the first of a new model if there is none."""
    draft = state.session.draft or Draft(NAME)
    number = 1 + max((int(old.name.split()[-1]) for old in draft.scans if old.name.split()[-1].isdigit()), default=0)
    named = replace(scan, name=f"scan {number}")
    state = replace(state, model=replace(state.model, open=True, step=None, clicks=(), tool=SELECT, alternative=0, new_object=0, pairs=()))
    return state.changed(f"add {named.name}", replace(state.session, draft=with_scan(draft, named)))


def fresh(look: ModelLook) -> ModelLook:
    """Looking at a model anew: what was set stays, what was clicked and picked goes."""
    kept = {"settings": look.settings, "material": look.material, "unit": look.unit, "patches": look.patches, "saves": look.saves}
    return ModelLook(open=look.open, part=look.part, **kept)


@dataclass(frozen=True)
class StartExample:
    """The bundled session with an object to model, scanned right away."""

    def run(self, bench: Any) -> State:
        return SCAN_CELL.given(bench, OpenSession(EXAMPLE).run(bench))


@dataclass(frozen=True, eq=False)
class UploadScan:
    """A file of a scan has arrived: a cloud, a depth image or its camera. An image and its camera wait for one another.

    With `trial` the scan does not join the model: the model is looked for in it.
    """

    name: str
    content: bytes
    trial: bool = False

    def apply(self, state: State) -> State:
        check_upload(self.name, self.content)
        waiting, ending = state.model.waiting, self.name.lower().rsplit(".", 1)[-1]
        if ending not in ("png", "json"):
            return _reading(state, Upload(self.name, self.content, b"", state.model.unit, self.trial))
        if waiting is None or waiting.name.lower().endswith(ending):
            other = "camera (JSON)" if ending == "png" else "depth image (PNG)"
            state = replace(state, model=replace(state.model, waiting=Waiting(self.name, self.content), open=True))
            return state.told(f'"{self.name}" has arrived; now upload the {other} that belongs to it.')
        image, camera = (self, waiting) if ending == "png" else (waiting, self)
        return _reading(state, Upload(image.name, image.content, camera.content, state.model.unit, self.trial))


@dataclass(frozen=True, eq=False)
class ScanRead:
    """An upload was read: a scan, or the sentence that says why not."""

    upload: Upload
    said: Any

    def apply(self, state: State) -> State:
        state = replace(state, model=replace(state.model, reading=None))
        if not isinstance(self.said, Scan):
            return state.told(self.said or f'"{self.upload.name}" could not be read.', "bad")
        if self.upload.trial:
            return replace(state, model=replace(state.model, trial=self.said, open=True))
        return with_new_scan(state, self.said)


@dataclass(frozen=True)
class SetUnit:
    """The unit of clouds that are uploaded."""

    unit: str

    def apply(self, state: State) -> State:
        return replace(state, model=replace(state.model, unit=self.unit))


def check_upload(name: str, content: bytes) -> None:
    """Raises BadInput when an upload is too large or of a kind that is not read."""
    if len(content) > MAX_UPLOAD_BYTES:
        raise BadInput(f'"{name}" has {len(content)} bytes, the limit for a scan is {MAX_UPLOAD_BYTES}.')
    if not name.lower().endswith((".png", ".json", ".npy", ".ply", ".pcd")):
        raise BadInput(f'"{name}" is not a scan; it must be a 16-bit PNG with its camera (JSON), NPY, PLY or PCD.')


def _reading(state: State, upload: Upload) -> State:
    return replace(state, model=replace(state.model, waiting=None, reading=upload, open=True))
