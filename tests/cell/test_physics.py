"""Bodies fall until they rest, and rest where physics says."""

from itertools import combinations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from handey_studio.cell.bodies import SolidBody, fixed_bodies, solid_body
from handey_studio.cell.physics.settling import SettleOptions, settle
from handey_studio.cell.workcell import TrueBody, Workcell
from handey_studio.geometry import box
from handey_studio.geometry.transforms import from_xyz_rpy, pose_difference, transform
from handey_studio.world.world import Block
from tests.cell.overlaps import body_overlap

TABLE = fixed_bodies(Workcell())


def falling(seed: int, library) -> list[SolidBody]:
    """All parts of the library and some blocks, one above the other."""
    rng = np.random.default_rng(seed)
    bodies = list(TABLE)
    for k, part in enumerate([*sorted(library.part_files()), None, None, None]):
        T = transform(Rotation.random(rng=rng).as_matrix(), (*rng.normal(0.4, 0.04, 2), 0.1 + 0.08 * k))
        size = None if part else rng.uniform(0.02, 0.06, 3)
        bodies.append(solid_body(TrueBody(f"body{k}", T, part, size), library.part))
    return bodies


@pytest.mark.parametrize("seed", range(4))
def test_a_settled_pile_rests_and_nothing_sinks_into_anything(seed, library):
    settled = settle(falling(seed, library))
    assert settled.resting
    for a, b in combinations(settled.bodies, 2):
        assert body_overlap(a, b) < 5e-4, (a.name, b.name)
    again = settle(settled.bodies)
    moved = [pose_difference(a.T_world_body, b.T_world_body) for a, b in zip(settled.bodies, again.bodies, strict=True)]
    assert max(distance for distance, _ in moved) < 1e-3 and max(angle for _, angle in moved) < 0.02


def test_the_same_fall_ends_the_same(library):
    first, second = (settle(falling(7, library)) for _ in range(2))
    assert first.steps == second.steps
    assert all(np.array_equal(a.T_world_body, b.T_world_body) for a, b in zip(first.bodies, second.bodies, strict=True))


def test_a_block_lands_flat_on_the_table_and_on_known_blocks():
    pedestal = Block("pedestal", np.array([0.1, 0.1, 0.05]), transform(None, (0.6, 0, 0.025)))
    bodies = [
        *fixed_bodies(Workcell(blocks=(pedestal,), table_z=0.02)),
        SolidBody("a", box((0.04, 0.05, 0.03)), from_xyz_rpy((0.3, 0.2, 0.06), (0.05, -0.03, 0.4))),
        SolidBody("b", box((0.04, 0.05, 0.03)), transform(None, (0.6, 0.0, 0.09))),
    ]
    rested = {body.name: body for body in settle(bodies).bodies}
    assert rested["a"].T_world_body[2, 3] == pytest.approx(0.02 + 0.015, abs=1e-4)
    assert rested["b"].T_world_body[2, 3] == pytest.approx(0.05 + 0.015, abs=1e-4)
    assert np.array_equal(rested["pedestal"].T_world_body, pedestal.T_world_block)


def test_a_peg_falls_into_a_notch_and_not_onto_its_hull(library):
    upright = from_xyz_rpy((0.4, 0, 0), (np.pi / 2, 0, 0))
    ell = solid_body(TrueBody("ell", upright, "l_block"), library.part)
    peg = SolidBody("peg", box((0.025, 0.025, 0.025)), transform(None, (0.4 + 0.045, -0.02, 0.065)))
    rested = settle([*TABLE, ell, peg]).bodies
    assert rested[-1].T_world_body[2, 3] == pytest.approx(0.0295 + 0.0125, abs=1e-3)


def test_a_fall_that_is_cut_short_says_so(library):
    settled = settle(falling(0, library), SettleOptions(max_steps=20))
    assert not settled.resting and settled.steps == 20


def test_nothing_free_is_already_at_rest():
    assert settle(TABLE).resting and settle(TABLE).steps == 0
