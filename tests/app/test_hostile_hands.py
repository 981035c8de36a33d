"""Whatever is clicked and typed, in whatever order: a sound solid, or one sentence and the model as it was."""

import numpy as np
import pytest
from hypothesis import HealthCheck, Phase, given, settings
from hypothesis import strategies as st

from handey_studio.app.modelling import derived
from handey_studio.app.modelling.accepting import Accept, Escape
from handey_studio.app.modelling.look import BY_HEIGHT, TO_TABLE
from handey_studio.app.modelling.scanning import OpenModel, with_new_scan
from handey_studio.app.modelling.steps import EditStep, MovePicked, MovePickedBy, RemovePicked, RemoveStep, SetPicked, TakeModel
from handey_studio.app.modelling.tool_clicks import BOX, CUT, EXTRUDE, MEASURE, MIRROR, SKETCH
from handey_studio.app.modelling.tools import ChooseTool, ClickScene, SetTool
from handey_studio.app.state import opened
from handey_studio.base import BadInput
from handey_studio.modeling.picking.snap import Ray
from tests.app.test_modelling import EYE, SIZE, Bench, refused, scan_of_carton
from tests.app.test_modelling import bench as bench  # a carton that was scanned
from tests.app.test_modelling import carton as carton  # and taken
from tests.modeling.models import check_built
from tests.session.samples import fresh_session, library

NUMBERS = (0.0, 1e-7, 1e-4, -0.01, 0.02, -0.05, 0.3, 5.0)


def at(x: float, y: float, z: float) -> ClickScene:
    return ClickScene(Ray(EYE, np.array((x, y, z)) - EYE, 0.0006))


def test_degenerate_strokes_on_screen_change_nothing(carton):
    top = float(derived.built(carton.state).solid.vertices[:, 2].max())
    corners = [at(x, y, top) for x, y in ((-0.02, -0.015), (0.02, 0.015), (0.02, -0.015), (-0.02, 0.015))]
    on = at(0.0, 0.0, top)
    assert "would cross the outline" in refused(carton, SetTool("infer", False), ChooseTool(SKETCH), on, *corners)
    assert "on the one before" in refused(carton, ChooseTool(BOX), on, on)
    carton.do(Escape(), Escape(), ChooseTool(SKETCH), on, corners[0], corners[2], corners[1], corners[3], Accept())
    assert carton.state.model.tool == EXTRUDE, "the same corners in order are a sketch"
    assert "no height" in refused(carton, SetTool("far", BY_HEIGHT), SetTool("height", 0.0), Accept())

    apart = [at(x, y, 0.0) for x, y in ((0.06, -0.06), (0.08, -0.06), (0.08, -0.045))]
    sentence = refused(carton, ChooseTool(BOX), SetTool("combine", "join"), SetTool("height", 0.02), *apart)
    assert "do not touch" in sentence and "mm apart" in sentence


class Hand:
    """Clicks near what is there and beside it, numbers that mean something and that do not."""

    def __init__(self, rng: np.random.Generator) -> None:
        self._rng = rng

    def click(self) -> ClickScene:
        spot = self._rng.uniform(-0.6, 0.6, 3) * SIZE + (0.0, 0.0, SIZE[2] / 2)
        spot = spot if self._rng.random() < 0.7 else np.round(spot / 0.02) * 0.02
        return ClickScene(Ray(EYE, spot - EYE, 0.0006), add=bool(self._rng.random() < 0.3))

    def command(self):
        number, pick = float(self._rng.choice(NUMBERS)), self._rng.integers(12)
        if pick < 5:
            return self.click()
        return (
            ChooseTool(str(self._rng.choice((BOX, SKETCH, EXTRUDE, CUT, MIRROR, MEASURE)))),
            SetTool("height", number),
            SetTool("far", str(self._rng.choice((TO_TABLE, BY_HEIGHT)))),
            SetTool("combine", str(self._rng.choice(("join", "cut", "common")))),
            self._rng.choice((Accept(), Accept(), Escape())),
            self._rng.choice((MovePicked(number), SetPicked(number, "distance"), SetPicked(number, "angle"), SetPicked(number, "length"))),
            self._drastic(number) if self._rng.random() < 0.3 else MovePickedBy(number * self._rng.choice(np.eye(3))),
        )[pick - 5]

    def _drastic(self, number: float):
        return self._rng.choice((RemovePicked(), RemoveStep(0), EditStep(int(self._rng.integers(-1, 4)), number)))


class IdleBench(Bench):
    """Nothing is worked out in the background."""

    def _work(self) -> None:
        pass


@pytest.fixture(scope="module")
def taken(tmp_path_factory):
    """The state with a carton's suggested model taken."""
    folder = tmp_path_factory.mktemp("hostile")
    made = Bench(opened(library(folder), fresh_session(folder), None))
    made.state = with_new_scan(made.state, scan_of_carton())
    return made.do(OpenModel(), TakeModel())


@settings(
    max_examples=60, deadline=None, phases=(Phase.explicit, Phase.generate), suppress_health_check=[HealthCheck.function_scoped_fixture]
)
@given(seed=st.integers(0, 10**6))
def test_a_hostile_hand_gets_sentences_and_never_a_broken_solid(taken, seed):
    hand, bench = Hand(np.random.default_rng(seed)), IdleBench(taken)
    for _ in range(14):
        before = bench.state.session.draft
        try:
            bench.do(hand.command())
        except BadInput as error:
            assert bench.state.session.draft is before and str(error).endswith(".")
        shown = derived.built(bench.state)
        if shown is not None and shown.solid is not None and bench.state.session.draft is not before:
            check_built(shown)
