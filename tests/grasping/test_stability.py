"""Whether a grip holds, against a linear programme over all spreads of pressure and friction."""

from dataclasses import replace

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import linprog

from handey_studio.geometry import box, polyhedron_from_polygons, prism
from handey_studio.geometry.transforms import inverse
from handey_studio.grasping import grasp_classes, grasp_groups, gravity_in_hand, grip_margin, hand_in_plane, pad_wrenches
from handey_studio.grasping.stability import GRAVITY_M_S2, _bits
from handey_studio.world import Library, Part

LIBRARY = Library.choose()
HAND = LIBRARY.robot("ur5").hand
PYRAMIDS = Part("roof", prism([[-0.02, 0.0], [0.02, 0.0], [0.005, 0.03]], 0.06), density=2700.0)
PARTS = [*(LIBRARY.part(name) for name in sorted(LIBRARY.part_files())), PYRAMIDS]
DOWN = np.array([[0.0, 0.0, 1.0]])


def held(group, angle=0.0, side=1):
    """T_hand_part as plain numbers."""
    T = inverse(group.grasp_class.T_part_plane @ hand_in_plane(group.point, group.angle + angle, side))
    return tuple(T.ravel().tolist())


def directions(rng, count):
    v = rng.normal(size=(count, 3))
    return v / np.linalg.norm(v, axis=1, keepdims=True)


def balanced(wrenches, width, friction, force, down):
    """Oracle: whether any pressure and friction on the pads' bits and corners balance the weight; friction in polygons around its cones."""
    places = []
    for patch, x in zip(wrenches.patches, (width / 2, -width / 2), strict=True):
        points = np.concatenate([shapely.get_coordinates(patch.convex_hull), _bits(patch, 30)])
        places.append(np.c_[np.full(len(points), x), points])
    centre = np.r_[0.0, shapely.get_coordinates(wrenches.patches[0].centroid)[0]]
    places = np.concatenate(places) - centre
    inward = -np.sign(places[:, 0])
    angles = np.arange(16) * np.pi / 8
    sides = np.c_[np.zeros(16), np.cos(angles), np.sin(angles)] / np.cos(np.pi / 16)
    normal = np.c_[inward, np.zeros((len(places), 2))]
    columns = np.concatenate([normal, np.repeat(sides[None], len(places), axis=0).reshape(-1, 3)])
    levers = np.concatenate([places, np.repeat(places, 16, axis=0)])
    weight = wrenches.weight * down
    balance = np.concatenate([columns.T, np.cross(levers, columns).T * 100.0])
    cones = np.hstack([-friction * np.eye(len(places)), np.kron(np.eye(len(places)), np.ones(16))])
    total = np.r_[np.ones(len(places)), np.zeros(16 * len(places))]
    found = linprog(
        np.zeros(len(total)), A_ub=cones, b_ub=np.zeros(len(places)), A_eq=np.vstack([balance, total]),
        b_eq=np.r_[-weight, -np.cross(wrenches.lever, weight) * 100.0, 2 * force], method="highs",
    )  # fmt: skip
    return found.status == 0


@settings(max_examples=10, deadline=None)
@given(st.integers(0, 2**32 - 1))
def test_a_grip_that_is_said_to_hold_can_be_balanced(seed):
    """At the force that is said to be needed there is a spread of pressure and friction, whatever the kind of grasp and the turn."""
    rng = np.random.default_rng(seed)
    part = replace(PARTS[rng.integers(len(PARTS))], friction=float(rng.uniform(0.2, 1.0)))
    groups, _ = grasp_groups(part, HAND)
    group = groups[rng.integers(len(groups))]
    wrenches = pad_wrenches(group.grasp_class, part, HAND, held(group, rng.uniform(-0.5, 0.5), int(rng.choice([-1, 1]))))
    down = directions(rng, 1)
    if not len(wrenches.slip):
        return
    grip = grip_margin(wrenches, down)
    assert balanced(wrenches, group.grasp_class.width, part.friction, 1.001 * grip.needed_force, down[0])
    assert grip.holds == (grip.needed_force <= HAND.force)


@settings(max_examples=12, deadline=None)
@given(st.integers(0, 2**32 - 1))
def test_margins_are_what_more_the_pads_would_hold(seed):
    """Any force as small as the margin on top of the weight stays within the planes, some force a little greater does not."""
    rng = np.random.default_rng(seed)
    part = PARTS[rng.integers(len(PARTS))]
    groups, _ = grasp_groups(part, HAND)
    group = groups[rng.integers(len(groups))]
    wrenches = pad_wrenches(group.grasp_class, part, HAND, held(group))
    down = directions(rng, 1)
    grip = grip_margin(wrenches, down)
    force = -wrenches.weight * down[0]
    torque = np.cross(wrenches.lever, force)

    def used(more_force, more_torque):
        f, t = force + more_force, torque + more_torque
        slip = wrenches.slip @ np.concatenate([f[..., 1:], t[..., :1]], axis=-1).T
        return slip.max(axis=0) + (wrenches.tip @ np.concatenate([f[..., :1], t[..., 1:]], axis=-1).T).max(axis=0)

    v = directions(rng, 4000)
    for scale, margin, more in ((v, grip.force_margin, (1, 0)), (v, grip.torque_margin, (0, 1))):
        assert used(more[0] * margin * scale, more[1] * margin * scale).max() <= 1 + 1e-9
        assert used(more[0] * 1.1 * margin * scale, more[1] * 1.1 * margin * scale).max() > 1


def test_friction_at_the_middle_is_coulombs():
    """A cube held through its middle with the fingers down: all friction, none of it turned, and twice the finger force presses."""
    part = Part("cube", box((0.03, 0.03, 0.03)), density=8000.0)
    group = middle_group(part)
    wrenches = pad_wrenches(group.grasp_class, part, HAND, held(group))
    grip = grip_margin(wrenches, DOWN)
    weight = 8000 * 0.03**3 * GRAVITY_M_S2
    most = 2 * HAND.force * part.friction
    assert np.isclose(wrenches.weight, weight) and grip.holds and grip.limit == "slips"
    askew = 1 / np.hypot(1 / most, 1 / (2 * HAND.force))  # a pull aside that also pushes one finger away
    assert 0.97 * (1 - weight / most) * askew < grip.force_margin <= (1 - weight / most) * askew + 1e-9
    assert np.isclose(grip.needed_force, weight / (2 * part.friction), rtol=0.03)


def middle_group(part):
    """A grasp with the middle of the pads at the part's middle, for a cube of 30 mm."""
    group = grasp_groups(part, HAND)[0][0]
    along = np.array([np.cos(group.angle), np.sin(group.angle)])
    return replace(group, point=group.edge.mean(axis=0) + 0.03 * along, depth=0.03)


def test_heavy_slippery_or_far_off_parts_do_not_hold_and_it_says_why():
    rod = Part("rod", box((0.3, 0.03, 0.03)), density=7800.0)
    group = next(g for g in grasp_groups(rod, HAND)[0] if np.ptp(g.edge, axis=0).max() < 0.05)
    grip = grip_margin(pad_wrenches(group.grasp_class, rod, HAND, held(group)), directions(np.random.default_rng(0), 50))
    assert not grip.holds and grip.torque_margin < 0 and grip.limit in ("turns", "tips over") and grip.needed_force > HAND.force
    cube = Part("cube", box((0.03, 0.03, 0.03)), density=8000.0, friction=0.01)
    grip = grip_margin(pad_wrenches((g := middle_group(cube)).grasp_class, cube, HAND, held(g)), DOWN)
    assert not grip.holds and grip.force_margin < 0 and grip.limit == "slips"
    grippy = replace(HAND, pad_friction=200.0)
    assert grip_margin(pad_wrenches(g.grasp_class, cube, grippy, held(g)), DOWN).holds


def test_pads_beside_the_part_touch_nothing():
    part = LIBRARY.part("brick")
    group = grasp_groups(part, HAND)[0][0]
    away = replace(group, point=group.point + 1.0)
    grip = grip_margin(pad_wrenches(group.grasp_class, part, HAND, held(away)), DOWN)
    assert not grip.holds and grip.limit == "touches nothing"


def test_only_pads_with_an_area_hold_against_turning():
    """The torque about the closing direction alone is friction times the mean distance from the pads' middle; a vertex adds nothing."""
    corners = np.array([[-0.02, -0.02, 0], [0.02, -0.02, 0], [0.02, 0.02, 0], [-0.02, 0.02, 0], [0.004, 0, 0.035]])
    spire = Part("spire", polyhedron_from_polygons(corners, [[3, 2, 1, 0], [0, 1, 4], [1, 2, 4], [2, 3, 4], [3, 0, 4]]))
    seen = set()
    for part in (spire, LIBRARY.part("brick")):
        for group in grasp_groups(part, HAND)[0][::3]:
            wrenches = pad_wrenches(group.grasp_class, part, HAND, held(group))
            means = []
            for patch in wrenches.patches:
                bits = _bits(patch, 2000)
                means.append(np.linalg.norm(bits - bits.mean(axis=0), axis=1).mean())
            most = part.friction * HAND.force * sum(means)
            assert 0.93 * most < 1.0 / np.abs(wrenches.slip[:, 2]).max() < 1.02 * most
            assert min(means) < 1e-12 or group.grasp_class.kind != "face and vertex"
            seen.add(group.grasp_class.kind)
    assert seen == {"faces", "face and edge", "face and vertex"}


@pytest.mark.parametrize("side", [1, -1])
def test_either_way_round_holds_alike(side):
    """Swapping the fingers turns gravity with the hand: the margins stay."""
    for part in (LIBRARY.part("wedge"), PYRAMIDS):
        for group in grasp_groups(part, HAND)[0][::9]:
            one = grip_margin(pad_wrenches(group.grasp_class, part, HAND, held(group)), np.array([[0.6, 0.0, 0.8]]))
            other = grip_margin(pad_wrenches(group.grasp_class, part, HAND, held(group, side=side)), np.array([[0.6 * side, 0.0, 0.8]]))
            assert np.isclose(one.force_margin, other.force_margin, rtol=0.03)
            assert np.isclose(one.torque_margin, other.torque_margin, rtol=0.05)


def test_gravity_is_seen_from_the_hand():
    T = np.eye(4)
    T[:3, :3] = np.array([[0, 0, 1], [1, 0, 0], [0, 1, 0]])  # the hand's y points up
    assert np.allclose(gravity_in_hand(T[None]), [[0, -1, 0]])


def test_every_class_of_the_bundled_parts_has_wrenches_about_its_pads():
    for part in PARTS:
        for found in grasp_classes(part, HAND)[0]:
            groups = [g for g in grasp_groups(part, HAND)[0] if g.grasp_class == found]
            for group in groups[:2]:
                wrenches = pad_wrenches(found, part, HAND, held(group))
                assert len(wrenches.slip) > 50 and len(wrenches.tip) >= 4
                assert all(np.allclose(p.centroid.coords, wrenches.patches[0].centroid.coords, atol=1e-6) for p in wrenches.patches)
