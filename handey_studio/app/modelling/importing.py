"""A mesh or CAD file becomes the model: its unit is asked for, what helps is offered when it is too rough, and undo takes it back."""

from dataclasses import dataclass, replace
from typing import Any

from handey_studio.app.modelling.look import MeshImport
from handey_studio.app.modelling.scanning import fresh
from handey_studio.app.modelling.showing import look_at
from handey_studio.app.state import State
from handey_studio.base import BadInput
from handey_studio.session.mesh_files import SUFFIXES, MeshUpload, Refusal, draft_of_import, likely_unit, told_of_import
from handey_studio.world.importing import UNITS
from handey_studio.world.model_files import MAX_MODEL_BYTES

MOST_SIMPLIFIED_M = 0.02


@dataclass(frozen=True, eq=False)
class UploadMesh:
    """A mesh or CAD file has arrived."""

    name: str
    content: bytes

    def apply(self, state: State) -> State:
        if len(self.content) > MAX_MODEL_BYTES:
            raise BadInput(f'"{self.name}" has {len(self.content)} bytes, the limit is {MAX_MODEL_BYTES}.')
        upload = MeshUpload(self.name, self.content)
        if upload.suffix not in SUFFIXES:
            raise BadInput(f'"{self.name}" is no mesh or CAD file; it must be one of {", ".join(SUFFIXES)}.')
        return _importing(state, MeshImport(upload))


@dataclass(frozen=True)
class ReadMesh:
    """How the file that has arrived is to be read: in this unit (STEP: its own), its planes within `simplify_m` [m] made one, 0 for
    exactly; `body` tells which of several, 0 for the only one."""

    unit: str
    simplify_m: float = 0.0
    body: int = 0

    def apply(self, state: State) -> State:
        mesh = state.model.mesh
        if mesh is None:
            raise BadInput("there is no mesh to read; upload one first.")
        if self.unit not in UNITS:
            raise BadInput(f'the unit "{self.unit}" is not known; it must be one of {", ".join(UNITS)}.')
        if not 0.0 <= self.simplify_m <= MOST_SIMPLIFIED_M:
            raise BadInput(f"a mesh can be simplified within 0 to {1e3 * MOST_SIMPLIFIED_M:g} mm, not {1e3 * self.simplify_m:g} mm.")
        upload = replace(mesh.upload, unit=self.unit, simplify_m=self.simplify_m, body=self.body)
        return _importing(state, replace(mesh, upload=upload, refusal=""))


@dataclass(frozen=True)
class LeaveMesh:
    """The file is not imported after all."""

    def apply(self, state: State) -> State:
        return _importing(state, None)


@dataclass(frozen=True, eq=False)
class MeshMeasured:
    """It is known how large the mesh is in its own numbers, or why it cannot be read."""

    upload: MeshUpload
    said: Any

    def apply(self, state: State) -> State:
        mesh = state.model.mesh
        if mesh is None or mesh.upload is not self.upload:
            return state
        if not isinstance(self.said, tuple):
            return _importing(state, None).told(_sentence(self.upload, self.said), "bad")
        return _importing(state, replace(mesh, extents=self.said, unit=likely_unit(self.said)))


@dataclass(frozen=True, eq=False)
class MeshRead:
    """The file was read: its part becomes the model, one step that undo takes back; or it is told why it cannot."""

    upload: MeshUpload
    said: Any

    def run(self, bench: Any) -> State:
        state = bench.state
        mesh = state.model.mesh
        if mesh is None or mesh.upload is not self.upload:
            return state
        if self.said is None or isinstance(self.said, Refusal):
            tolerance = self.said.tolerance if self.said is not None else 0.0
            return _importing(state, replace(mesh, refusal=_sentence(self.upload, self.said), tolerance=tolerance))
        state = replace(state, model=replace(fresh(state.model), open=True))
        state = state.changed(f"import {self.upload.name}", replace(state.session, draft=draft_of_import(self.said)))
        look_at(bench, self.said.part.solid.vertices - self.said.part.solid.vertices.mean(axis=0), None)
        return state.told(told_of_import(self.upload, self.said), "good")


def _importing(state: State, mesh: MeshImport | None) -> State:
    return replace(state, model=replace(state.model, mesh=mesh))


def _sentence(upload: MeshUpload, said: Refusal | None) -> str:
    return said.sentence if said is not None else f'"{upload.name}" could not be read; the log tells why.'
