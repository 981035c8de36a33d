"""A model becomes a part, and what the screen needs to know of it."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from handey_studio.base import BadInput
from handey_studio.geometry import Polyhedron, box
from handey_studio.geometry.transforms import apply, from_xyz_rpy
from handey_studio.modeling.operations import Extrude, Mirror, MoveFace, SetAngle
from handey_studio.modeling.references import FaceAt
from handey_studio.session.model_look import hatching
from handey_studio.session.modelling import part_of, with_part
from handey_studio.session.step_numbers import number_of, with_number
from handey_studio.session.strokes import opposite_face, plane_normal
from handey_studio.world.part import Provenance
from tests.session.samples import fresh_session

FACE = FaceAt(np.zeros(3), np.array([0.0, 0.0, 1.0]))


@given(st.floats(-3.1, 3.1), st.floats(-2.0, 2.0), st.floats(-2.0, 2.0))
def test_a_part_has_its_frame_below_its_middle_wherever_it_was_modelled(yaw, x, y):
    placed = Polyhedron(apply(from_xyz_rpy((x, y, 0.02), (0.0, 0.0, yaw)), box((0.10, 0.06, 0.04)).vertices), box((0.10, 0.06, 0.04)).faces)
    part = part_of(placed, "bar", 700.0, 0.5, Provenance())
    assert np.allclose(part.solid.vertices.min(axis=0), (-0.05, -0.03, 0.0), atol=1e-8)
    assert np.allclose(part.solid.vertices.max(axis=0), (0.05, 0.03, 0.04), atol=1e-8)


def test_a_part_joins_the_session_once_and_takes_the_place_of_an_older_model(tmp_path):
    session = fresh_session(tmp_path)
    part = part_of(box((0.1, 0.06, 0.04)), "bar", 700.0, 0.5, Provenance())
    larger = part_of(box((0.1, 0.06, 0.05)), "bar", 700.0, 0.5, Provenance())
    known = with_part(with_part(session, part), larger)
    assert known.workcell.parts == ("l_block", "brick", "bar") and known.part("bar") == larger and len(known.parts) == 3
    assert with_part(known, larger) is known


def test_hatching_stays_inside_its_face_and_covers_it():
    solid = box((0.10, 0.06, 0.04))
    top = int(np.argmax(solid.normals[:, 2]))
    lines = hatching(solid, (top,), 0.004)
    assert (
        np.allclose(lines[..., 2], 0.02) and (np.abs(lines[..., 0]) <= 0.05 + 1e-9).all() and (np.abs(lines[..., 1]) <= 0.03 + 1e-9).all()
    )
    covered = np.linalg.norm(lines[:, 1] - lines[:, 0], axis=1).sum() * 0.004
    assert covered == pytest.approx(0.10 * 0.06, rel=0.05)


def test_the_opposite_face_is_the_nearest_behind():
    solid = box((0.10, 0.06, 0.04))
    other = opposite_face(solid, FaceAt(np.array([0.0, 0.0, 0.02]), np.array([0.0, 0.0, 1.0])))
    assert np.allclose(other.normal, (0.0, 0.0, -1.0)) and other.point[2] == pytest.approx(-0.02)


def test_three_clicks_on_a_line_are_no_plane():
    with pytest.raises(BadInput, match="on a line"):
        plane_normal(np.array([[0.0, 0, 0], [0.01, 0, 0], [0.02, 0, 0]]), np.array([0.0, 0.0, 1.0]))
    up = plane_normal(np.array([[0.0, 0, 0], [0.01, 0, 0], [0.0, 0.01, 0]]), np.array([0.0, 0.0, -1.0]))
    assert np.allclose(up, (0.0, 0.0, -1.0)), "towards the eye"


def test_the_number_of_a_step_is_changed_where_it_has_one():
    assert number_of(MoveFace(FACE, 0.01)) == (0.01, "m") and with_number(MoveFace(FACE, 0.01), 0.02).distance == 0.02
    assert number_of(SetAngle(FACE, FACE, 1.0)) == (1.0, "rad") and number_of(Extrude("a")) is None
    with pytest.raises(BadInput, match="no number"):
        with_number(Mirror(np.zeros(3), np.array([1.0, 0.0, 0.0])), 1.0)
