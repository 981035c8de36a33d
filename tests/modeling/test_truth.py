import numpy as np
import pytest

from handey_studio.base import BadInput
from handey_studio.geometry import box, prism
from handey_studio.geometry.transforms import apply, inverse, transform
from handey_studio.modeling.object_readings import ALONE, FAR, ON_SUPPORT, OTHER
from handey_studio.modeling.scans import Scan
from handey_studio.modeling.truth import TruthOptions, surface_spots, truth
from handey_studio.sensing.depth_view import DepthView, Orthographic
from tests.modeling.looks import looking, moved, scan_of

NOISE = 0.0005
L = prism([[0, 0], [0.08, 0], [0.08, 0.03], [0.03, 0.03], [0.03, 0.07], [0, 0.07]], 0.04)
LEFT, RIGHT = looking((-0.25, -0.3, 0.3), (0.03, 0.03, 0.02)), looking((0.35, 0.3, 0.3), (0.03, 0.03, 0.02))
BALL_BESIDE = moved(box((0.03, 0.03, 0.05)), transform(translation=(0.16, -0.05, 0.025)))
SCANS = (scan_of([L, BALL_BESIDE], LEFT, noise=NOISE, name="left"), scan_of([L, BALL_BESIDE], RIGHT, noise=NOISE, name="right", seed=1))
HERE = (np.eye(4), np.eye(4))


def test_a_right_model_is_explained_by_its_noise_and_nothing_denies_it():
    told = truth(L, SCANS, HERE)
    assert (
        told.ok and not told.doubts and told.explained > 0.97 and 0.5 * NOISE < told.rms < 1.1 * NOISE
    )  # noise is along the sight, distances across the faces
    for each in told.scans:
        assert abs(each.distances.mean()) < 0.1 * NOISE and each.seen_through == 0.0 and len(each.points) > 3000
        assert {reason for reason, _ in each.left_out} >= {ON_SUPPORT, OTHER}
    top, bottom = np.argmax(L.normals[:, 2]), np.argmin(L.normals[:, 2])
    assert told.faces_seen[top] > 0.95 and told.faces_seen[bottom] == 0.0
    areas = surface_spots(L, 100)[2]
    assert told.seen == pytest.approx(told.faces_seen @ areas / areas.sum())
    assert 0.75 < told.seen < 1.0 - areas[bottom] / areas.sum() + 1e-9


def test_what_a_scan_saw_of_a_face_is_what_was_in_sight():
    told = truth(L, SCANS[:1], HERE[:1])
    away = [f for f, n in enumerate(L.normals) if n @ (LEFT[:3, 3] - L.vertices[L.faces[f].outer[0]]) < 0]
    assert len(away) >= 3 and (told.faces_seen[away] == 0.0).all()
    front = int(np.argmin(L.normals[:, 1]))
    assert told.faces_seen[front] > 0.9


@pytest.mark.parametrize("off", [0.002, -0.002])
def test_a_model_too_low_or_too_high_shows_by_so_much(off):
    wrong = prism([[0, 0], [0.08, 0], [0.08, 0.03], [0.03, 0.03], [0.03, 0.07], [0, 0.07]], 0.04 - off)
    told = truth(wrong, SCANS, HERE)
    top = int(np.argmax(wrong.normals[:, 2]))
    for each in told.scans:
        on_top = (each.faces == top) & (np.abs(each.distances) > 0.001)
        assert np.median(each.distances[on_top]) == pytest.approx(off, abs=2e-4)  # + in front of the surface
    assert told.explained < 0.8 and told.ok
    doubt = told.doubts[0]
    assert doubt.name == "explained" and doubt.faces == (top,) and ("in front of" if off > 0 else "behind") in doubt.sentence
    assert ("outward" if off > 0 else "inward") in doubt.fix and f"{100 * told.explained:.0f} %" in doubt.sentence


def test_a_model_that_is_too_large_was_seen_through_and_the_depth_is_told():
    large = prism([[0, 0], [0.08, 0], [0.08, 0.07], [0, 0.07]], 0.04)  # fills the L's notch
    told = truth(large, SCANS, HERE)
    right = told.scans[1]
    assert "seen through" in {doubt.name for doubt in told.doubts}
    assert right.seen_through > 0.2 and 0.008 < right.seen_through_m < 0.025
    assert (right.through_points[:, :2] > 0.02).all() and len(right.through_points) > 10
    assert told.scans[0].name == "left"


def test_an_unmodelled_piece_stays_in_and_a_neighbour_does_not():
    short = prism([[0, 0], [0.08, 0], [0.08, 0.03], [0, 0.03]], 0.04)  # without the L's second leg
    told = truth(short, SCANS, HERE)
    assert told.explained < 0.85 and max(each.distances.max() for each in told.scans) > 0.025
    gone = np.concatenate([each.points for each in told.scans])
    assert (gone[:, 0] < 0.13).all()  # the body beside it never counts
    assert told.rms < 0.004


def test_a_mask_tells_which_readings_count():
    mask = np.zeros(SCANS[0].view.depth.shape, dtype=bool)
    points = apply(LEFT, SCANS[0].view.points_sensor())
    mask[points[..., 0] > 0.13] = True
    told = truth(L, SCANS[:1], HERE[:1], masks=(mask,))
    assert told.explained == 0.0 and np.isnan(told.rms) and dict(told.scans[0].left_out)[FAR] > 200


def test_a_second_scan_counts_where_its_pose_puts_it():
    T = transform(np.array([[0.0, -1, 0], [1, 0, 0], [0, 0, 1]]), (0.1, 0.2, 0.0))
    turned = scan_of([moved(L, inverse(T))], LEFT, noise=NOISE)
    told = truth(L, (SCANS[0], turned), (np.eye(4), T))
    assert told.explained > 0.97 and told.rms < 1.1 * NOISE


def test_readings_from_straight_above_and_lone_ones():
    projection, T = Orthographic(0.001, 59.5, 59.5), transform(np.diag([1.0, -1.0, -1.0]), (0.04, 0.03, 1.0))
    scan = scan_of([L], T, projection, NOISE, shape=(120, 120))
    depth = np.array(scan.view.depth)
    depth[5:9:3, 5:100:7] = 0.97  # readings in mid air, where depth jumps
    scan = Scan("above", DepthView(depth, projection, T, NOISE, 0.001))
    told = truth(L, (scan,), (np.eye(4),))
    top = int(np.argmax(L.normals[:, 2]))
    assert told.faces_seen[top] > 0.95 and np.delete(told.faces_seen, top).max() == 0.0
    assert dict(told.scans[0].left_out)[ALONE] == 28 and told.explained > 0.98


def test_without_scans_there_is_nothing_to_say_but_the_checks():
    told = truth(L, (), ())
    assert np.isnan(told.rms) and told.seen == 0.0 and told.ok and len(told.checks) >= 8
    with pytest.raises(BadInput, match="equally many"):
        truth(L, SCANS, HERE[:1])


def test_spots_lie_on_their_faces():
    spots, faces, areas = surface_spots(L, 500)
    assert len(spots) == pytest.approx(500, rel=0.1) and set(faces) == set(range(len(L.faces)))
    assert np.abs((spots * L.normals[faces]).sum(axis=1) - L.offsets[faces]).max() < 1e-12
    assert areas.sum() == pytest.approx(2 * (0.08 * 0.03 + 0.03 * 0.04) + 0.04 * 0.3)


def test_the_options_say_how_near_is_explained():
    tight = truth(L, SCANS, HERE, TruthOptions(sigmas=1.0))
    assert 0.5 < tight.explained < truth(L, SCANS, HERE).explained
