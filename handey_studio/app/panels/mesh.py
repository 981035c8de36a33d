"""What is asked of a mesh file that was uploaded: the unit of its numbers, and what would help where it is too rough."""

from typing import Any

import viser

from handey_studio.app import palette
from handey_studio.app.modelling.importing import LeaveMesh, ReadMesh
from handey_studio.app.modelling.look import MeshImport
from handey_studio.app.panels.move import choose
from handey_studio.app.state import State
from handey_studio.app.wire import Send, on_click, set_to
from handey_studio.world.importing import UNITS

ORDER = ("mm", "cm", "m", "in")


class MeshPanel:
    """Shown while a file waits: the unit with the size that it would give, a tolerance, and which of several bodies."""

    def __init__(self, gui: viser.GuiApi, send: Send) -> None:
        with gui.add_folder("Mesh", visible=False) as self._folder:
            self._unit: Any = gui.add_dropdown("Its unit", ORDER)
            self._simplify: Any = gui.add_number(
                "Simplify (mm)", 0.0, min=0.0, max=20.0, step=0.1, hint="Planes so near are made one; 0: exactly as it is"
            )
            self._body: Any = gui.add_number(
                "Body", 0, min=0, max=99, step=1, hint="Which of several, the largest is 1; 0: there is only one"
            )
            self._import = gui.add_button("Import it", icon=viser.Icon.FILE_IMPORT, color=palette.BLUE)
            self._leave = gui.add_button("Leave it", icon=viser.Icon.X, color="gray", hint="Esc")
        on_click(self._import, send, lambda _: self._asked())
        on_click(self._leave, send, lambda _: LeaveMesh())

    def _asked(self) -> ReadMesh:
        return ReadMesh(str(self._unit.value).split(":")[0], 1e-3 * float(self._simplify.value), int(self._body.value))

    def render(self, old: State | None, new: State) -> None:
        mesh = new.model.mesh
        if old is not None and old.model.mesh is mesh:
            return
        waits = mesh is not None and (bool(mesh.refusal) or (bool(mesh.extents) and not mesh.upload.tells_unit))
        set_to(self._folder, visible=waits)
        if mesh is None or not waits:
            return
        labels = unit_labels(mesh)
        chosen = mesh.upload.unit or mesh.unit
        choose(self._unit, labels, next(label for label in labels if label.split(":")[0] == chosen), False)
        set_to(self._unit, visible=bool(mesh.extents))
        set_to(self._simplify, value=round(1e3 * (mesh.tolerance or mesh.upload.simplify_m), 3))
        set_to(self._body, value=mesh.upload.body, visible=bool(mesh.refusal))


def unit_labels(mesh: MeshImport) -> tuple[str, ...]:
    """The units with the size in mm that each would give."""
    if not mesh.extents:
        return ORDER
    return tuple(f"{unit}: {' × '.join(f'{1e3 * UNITS[unit] * side:.4g}' for side in mesh.extents)} mm" for unit in ORDER)
