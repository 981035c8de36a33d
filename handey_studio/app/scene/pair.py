"""The pair in hand: Figure 3 of the paper, drawn where it stands (Handey 1987 §3)."""

import numpy as np
import viser
from numpy.typing import NDArray

from handey_studio.app import palette
from handey_studio.app.scene.units import scaled
from handey_studio.app.state import State
from handey_studio.localization.edge_pair import EdgePair
from handey_studio.localization.explain import Explanation

ROOT = "/pair"
DATA, MODEL = palette.BLUE, palette.SKY
LIFT_M = np.array([0.0, 0.0, 0.0016])
ARC_SHARE = 0.13  # of the part's diameter, the radius at which α is drawn
TEXT_SHARE = 0.028  # of it, the height of letters: they grow as one comes near, and keep apart


class PairScene:
    """Two data edges with their common perpendicular, α as an arc, a1 and a2 along the edges; beside them the two model edges."""

    def __init__(self, server: viser.ViserServer) -> None:
        self._scene = server.scene

    def render(self, old: State | None, new: State) -> None:
        if old is not None and _looks(old) == _looks(new):
            return
        self._scene.remove_by_name(ROOT)
        said = new.explanation
        if said is None or "pair of edges" in new.session.view.hidden_layers:
            return
        self._scene.add_frame(ROOT, show_axes=False)
        if said.model_pair is not None:
            self._lines("model_edges", said.model_pair.ends, MODEL, 6.0)
        part = new.session.part(new.hypothesis.part) if new.hypothesis else None
        if said.data_pair is not None and part is not None:
            self._figure(said, said.data_pair, part.solid.diameter)

    def _figure(self, said: Explanation, pair: EdgePair, diameter: float) -> None:
        radius = ARC_SHARE * diameter
        arc = pair.arc(radius)
        self._lines("data_edges", pair.ends, DATA, 9.0)
        self._lines("perpendicular", pair.feet[None], palette.INK, 3.0)
        if not pair.parallel:
            self._lines("arc", np.stack([arc[:-1], arc[1:]], axis=1), palette.INK, 3.0)
            self._lines("along", np.stack([pair.feet, pair.nearest], axis=1), palette.INK, 3.0)
        texts, places = parameter_texts(said), pair.anchors(radius)
        for name, place in places.items():
            self._scene.add_label(
                f"{ROOT}/{name}",
                texts[name],
                position=scaled(place + 2 * LIFT_M),
                font_size_mode="scene",
                font_scene_height=float(scaled(TEXT_SHARE * diameter)),
                anchor="center-center",
            )

    def _lines(self, name: str, ends: NDArray, colour: palette.RGB, thickness: float) -> None:
        self._scene.add_line_segments(f"{ROOT}/{name}", scaled(ends + LIFT_M), colors=colour, thickness=thickness, thickness_units="screen")


def parameter_texts(said: Explanation) -> dict[str, str]:
    """What stands beside the strokes: each parameter of the data edges, of α in brackets that of the model edges, for which the others
    lack the room; the panel has them all."""
    return {name: f"{name} {data}" + (f" (model {model})" if model and name == "α" else "") for name, data, model in parameters(said)}


def parameters(said: Explanation) -> list[tuple[str, str, str]]:
    """Name, data and model of the four parameters as people read them; the model's are empty when its edges are not known.

    The sign of d tells a pair from its mirror image: the model's is taken as positive.
    """
    data, model = said.data_pair, said.model_pair
    if data is None:
        return []
    sign = -1.0 if (model if model is not None else data).d < 0.0 else 1.0
    rows = [("α", data.alpha, model and model.alpha, "rad"), ("d", sign * data.d, model and sign * model.d, "m")]
    if not data.parallel:
        rows += [(f"a{k + 1}", float(data.a[k]), model and float(model.a[k]), "m") for k in range(2)]
    return [(name, shown(value, unit), "" if other is None else shown(other, unit)) for name, value, other, unit in rows]


def shown(value: float, unit: str) -> str:
    """A number with one decimal: nobody reads hundredths beside a stroke."""
    return f"{np.rad2deg(value):.1f}°" if unit == "rad" else f"{1e3 * value + 0.0:.1f} mm"


def _looks(state: State) -> tuple:
    return id(state.explanation), "pair of edges" in state.session.view.hidden_layers
