"""A person turns a body over: it lies still on another side, near where it was, and nothing else is known of it than a new scan tells."""

from dataclasses import replace

import numpy as np
import pytest

from handey_studio.base import BadInput, Silent
from handey_studio.cell.turning import turned_over
from handey_studio.cell.workcell import SimulatedSetup, TrueBody, Workcell
from handey_studio.geometry.transforms import from_xyz_rpy
from handey_studio.modeling.scans import Scan
from handey_studio.session import Session, find_session, read_session
from handey_studio.session.modelling import scan_cell, turn_over
from handey_studio.world import Library

LIBRARY = Library.choose()
BAR = TrueBody("bar", from_xyz_rpy((0.45, 0.02, 0.01), (0.0, 0.0, 0.4)), size=np.array([0.10, 0.04, 0.02]))
CUBE = TrueBody("cube", from_xyz_rpy((0.60, -0.12, 0.015)), size=np.array([0.03, 0.03, 0.03]))


def height(body: TrueBody) -> float:
    """How high a cuboid stands [m]."""
    return float(np.abs(body.T_world_body[2, :3]) @ body.size)


def scanned(session: Session) -> Scan:
    """A new scan of a session's cell."""
    draft = scan_cell(session, LIBRARY, False, Silent()).draft
    assert draft is not None
    return draft.scans[0]


def test_the_body_nearest_to_a_place_lies_on_another_side_where_it_was():
    workcell = Workcell(setup=SimulatedSetup((BAR, CUBE)))
    setup = turned_over(workcell, LIBRARY, np.array([0.44, 0.0]))
    bar, cube = setup.bodies
    assert height(bar) == pytest.approx(0.04, abs=1e-3) and bar.T_world_body[2, 3] == pytest.approx(0.02, abs=1e-3)
    assert np.linalg.norm(bar.T_world_body[:2, 3] - BAR.T_world_body[:2, 3]) < 0.02
    assert np.allclose(cube.T_world_body, CUBE.T_world_body, atol=1e-3) and setup.seed != workcell.setup.seed
    again = turned_over(replace(workcell, setup=setup), LIBRARY, np.array([0.44, 0.0]))
    assert height(again.bodies[0]) == pytest.approx(0.02, abs=1e-3)


def test_an_empty_cell_has_nothing_to_turn():
    with pytest.raises(BadInput, match="nothing lies"):
        turned_over(Workcell(), LIBRARY)


def test_the_example_shows_another_side_after_turning():
    session = read_session(find_session(LIBRARY, "model_a_part"))
    before = scanned(session)
    turned = turn_over(session, LIBRARY, False, Silent())
    assert turned.cell_now is not None and turned.scene is None and turned.workcell == session.workcell
    after = scanned(turned)
    heights = [1.0 - float(np.nanpercentile(scan.view.depth, 0.5)) for scan in (before, after)]
    assert heights[0] == pytest.approx(0.040, abs=0.001) and abs(heights[1] - heights[0]) > 0.01


def test_the_object_that_is_modelled_is_turned_though_another_is_nearer_to_the_scans_middle():
    session = read_session(find_session(LIBRARY, "model_a_part"))
    bar = replace(BAR, T_world_body=from_xyz_rpy((0.42, 0.11, 0.01), (0.0, 0.0, 0.4)))
    cube = replace(CUBE, T_world_body=from_xyz_rpy((0.48, 0.0, 0.015)))
    workcell = replace(session.workcell, setup=replace(session.workcell.setup, bodies=(bar, cube)))
    session = scan_cell(replace(session, workcell=workcell), LIBRARY, False, Silent())
    turned = turn_over(session, LIBRARY, False, Silent()).cell_now
    assert turned is not None and height(turned.bodies[0]) == pytest.approx(0.04, abs=1e-3)
    untouched = turn_over(replace(session, draft=None), LIBRARY, False, Silent()).cell_now
    assert untouched is not None and height(untouched.bodies[0]) == pytest.approx(0.02, abs=1e-3)
