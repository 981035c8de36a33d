"""Whatever a hand does, in whatever order: a sound solid, or one sentence and nothing changed."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from handey_studio.base import BadInput
from handey_studio.geometry import Polyhedron
from handey_studio.modeling.history import edited, removed, with_operation
from handey_studio.modeling.operations import (
    Box,
    CutByPlane,
    Delete,
    Extrude,
    Mirror,
    MoveCorner,
    MoveEdge,
    MoveFace,
    Operation,
    SetAngle,
    SetDistance,
    SetLength,
    Sketch,
)
from handey_studio.modeling.outline import Outline
from handey_studio.modeling.references import CornerAt, EdgeAt, FaceAt
from handey_studio.modeling.replay import replay
from handey_studio.modeling.sketch_plane import sketch_plane
from tests.modeling.models import UP, box_draft, check_built, l_draft

LENGTHS = (0.0, 1e-7, 1e-5, 1e-4, 0.001, 0.01, 0.02, 0.03, 0.04, 0.05, 0.0123)


class Hand:
    """A hand that clicks on what is there, near it, and on nothing; on a grid and off it."""

    def __init__(self, rng: np.random.Generator, solid: Polyhedron | None) -> None:
        self.rng, self.solid = rng, solid

    def point(self) -> np.ndarray:
        if self.solid is None or self.rng.random() < 0.2:
            return 0.01 * self.rng.integers(-2, 13, 3)
        corner = self.solid.vertices[self.rng.integers(len(self.solid.vertices))]
        face = self.solid.faces[self.rng.integers(len(self.solid.faces))]
        return self.solid.vertices[list(face.outer)].mean(axis=0) if self.rng.random() < 0.5 else corner + 0.001 * self.rng.normal(size=3)

    def way(self) -> np.ndarray:
        kind = self.rng.random()
        if self.solid is not None and kind < 0.3:
            return self.solid.normals[self.rng.integers(len(self.solid.faces))]
        return self.rng.normal(size=3) if kind < 0.5 else np.eye(3)[self.rng.integers(3)] * self.rng.choice([-1, 1])

    def length(self) -> float:
        return float(self.rng.choice(LENGTHS) * self.rng.choice([-1, 1]))

    def face(self) -> FaceAt:
        return FaceAt(self.point(), self.way())

    def edge(self) -> EdgeAt:
        return EdgeAt(self.point(), self.way())

    def combine(self) -> str:
        return str(self.rng.choice(["join", "join", "cut", "common"]))

    def box(self) -> Box:
        (x, y), (width, depth), z = self.rng.integers(0, 8, 2), self.rng.integers(-5, 8, 2), self.rng.integers(1, 10)
        clicks = 0.01 * np.array([[x, y, z], [x + width, y, z], [x + width, y + depth, z]], dtype=float)
        noise = self.rng.choice([0.0, 1e-6, 1e-3]) * self.rng.normal(size=(3, 3))
        return Box(clicks + noise, UP, None if self.rng.random() < 0.6 else self.length(), self.combine())

    def sketch(self) -> Sketch:
        corners = 0.01 * self.rng.integers(0, 6, (int(self.rng.integers(3, 6)), 2))
        if self.rng.random() < 0.6:
            corners = np.array([[0, 0], [0.05, 0], [0.05, 0.03], [0, 0.03]]) + 0.01 * self.rng.integers(0, 5, 2)
        return Sketch("step", sketch_plane(self.point(), self.way()), Outline(corners))

    def extrude(self) -> Extrude:
        kind = self.rng.random()
        return Extrude("step", self.length() if kind < 0.5 else None, self.face() if kind > 0.75 else None, self.combine())

    def operation(self) -> Operation:
        steps = (
            self.box,
            self.sketch,
            self.extrude,
            self.extrude,
            lambda: CutByPlane(self.point(), self.way()),
            lambda: MoveFace(self.face(), self.length()),
            lambda: MoveEdge(self.edge(), self.length() * self.way()),
            lambda: MoveCorner(CornerAt(self.point()), self.length() * self.way()),
            lambda: SetDistance(self.face(), self.face(), abs(self.length())),
            lambda: SetLength(self.edge(), abs(self.length())),
            lambda: SetAngle(self.face(), self.face(), float(self.rng.choice([0.5, 1.2, np.pi / 2, 3.0, np.pi / 2 + 1e-4]))),
            lambda: Mirror(self.point(), self.way(), bool(self.rng.random() < 0.8)),
            lambda: Delete("solid" if self.rng.random() < 0.2 else "step"),
        )
        return steps[self.rng.integers(len(steps))]()


@settings(max_examples=10)
@given(st.integers(0, 1_000_000))
def test_any_steps_leave_a_sound_solid_or_change_nothing(seed):
    rng = np.random.default_rng(seed)
    draft = l_draft() if rng.random() < 0.7 else box_draft()
    for _ in range(6):
        before = replay(draft)
        hand = Hand(rng, before.solid)
        try:
            draft = with_operation(draft, hand.operation())
        except BadInput as error:
            assert str(error).endswith(".") and "\n" not in str(error)
            assert replay(draft) == before
        else:
            after = replay(draft)
            check_built(after)
            assert [step.reason for step in after.steps] == [None] * len(draft.operations)
    if len(draft.operations) > 2:
        index = int(rng.integers(len(draft.operations) - 1))
        check_built(replay(removed(draft, index)))
        assert replay(edited(draft, index, draft.operations[index])) == replay(draft), "the same step again changes nothing"
