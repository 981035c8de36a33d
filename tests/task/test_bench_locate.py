"""The judges know right from wrong, the table counts rightly, peers are asked through their own process."""

import json
import sys
import time
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest

from handey_studio.base import BadInput, Silent
from handey_studio.cell.bodies import SolidBody, fixed_bodies
from handey_studio.cell.camera import DepthCamera, look_exactly
from handey_studio.cell.scenes.pile_scenes import SceneOptions, TruePose, random_scene
from handey_studio.cell.scenes.scene_files import save_scene
from handey_studio.cell.workcell import Workcell
from handey_studio.cli import main
from handey_studio.geometry import box
from handey_studio.geometry.transforms import from_xyz_rpy, inverse, rotation_about, transform
from handey_studio.localization import Hypothesis, LocatedPose, LocateResult
from handey_studio.sensing.depth_view import DepthView, Pinhole
from handey_studio.task.bench.locate import answers, bench_locate, command, peers, plot, run_bench
from handey_studio.task.bench.locate.answers import Answer, Pose
from handey_studio.task.bench.locate.label_judge import LabelJudge, Labelled
from handey_studio.task.bench.locate.labelled_scenes import LabelledScene, load_labelled, scene_folders
from handey_studio.task.bench.locate.peer_worker import around, first_of_voxels, share_on
from handey_studio.task.bench.locate.summary import summarise, table
from handey_studio.task.bench.locate.truth_judge import TruthJudge
from handey_studio.world import Library, Part, write_obj
from handey_studio.world.library import bundled

T_WORLD_SENSOR = transform(np.diag([1.0, -1.0, -1.0]), (0.0, 0.0, 0.7))
HERE, THERE = from_xyz_rpy((0.05, 0.0, 0.02), (0.1, 0.2, 0.3)), from_xyz_rpy((-0.1, 0.05, 0.02), (0.0, 0.0, 1.0))


@pytest.fixture(scope="module")
def library() -> Library:
    return Library(Path(bundled()))


@pytest.fixture
def judge(library):
    parts = {name: library.part(name) for name in ("brick", "l_block", "wedge")}
    truth = (TruePose("brick", HERE, 0.9, 900), TruePose("brick", THERE, 0.3, 300), TruePose("l_block", HERE, 0.6, 500))
    return TruthJudge(truth, T_WORLD_SENSOR, parts)


def moved(T_world_part, mm=0.0, degrees=0.0, axis=(1.0, 2.0, 0.5)):
    """As a sensor would tell a pose that is off by so much."""
    off = transform(rotation_about(axis, np.deg2rad(degrees)))
    T = T_world_part @ off
    T[:3, 3] += 1e-3 * mm * np.array([0.6, 0.0, 0.8])
    return inverse(T_WORLD_SENSOR) @ T


@pytest.mark.parametrize(
    ("mm", "degrees", "right", "strict"),
    [(0, 0, True, True), (4, 1, True, False), (2, 4, True, False), (6, 0, False, False), (0, 6, False, False)],
)
def test_a_pose_is_right_within_the_limits(judge, mm, degrees, right, strict):
    (verdict,) = judge.verdicts("l_block", [moved(HERE, mm, degrees)])
    assert (verdict.right, verdict.strict, verdict.matches) == (right, strict, 0 if right else None)
    assert verdict.off_mm == pytest.approx(mm, abs=1e-6) and verdict.off_deg == pytest.approx(degrees, abs=1e-6)


def test_poses_that_look_the_same_are_right_and_others_are_not(judge):
    brick, l_block = judge.parts["brick"], judge.parts["l_block"]
    assert len(brick.symmetries) == 4 and len(l_block.symmetries) == 1
    for S in brick.symmetries:
        assert judge.verdicts("brick", [moved(HERE @ S, 1.0)])[0].strict
    half_turn = transform(np.diag([-1.0, -1.0, 1.0]))
    assert not judge.verdicts("l_block", [moved(HERE @ half_turn)])[0].right


def test_an_instance_is_found_once_and_absent_parts_have_none(judge):
    verdicts = judge.verdicts("brick", [moved(HERE, 1.0), moved(HERE, 0.5), moved(THERE, 2.0)])
    assert [verdict.matches for verdict in verdicts] == [0, None, 1]
    assert [verdict.right for verdict in verdicts] == [True, False, True]
    assert [instance.visible_fraction for instance in judge.instances("brick")] == [0.9, 0.3]
    assert judge.instances("wedge") == () and not judge.verdicts("wedge", [moved(HERE)])[0].right


# A labelled scene: two boxes on a table, one before the other, as an exact sensor reads them.

CARTON, TIN = Part("carton", box((0.16, 0.09, 0.05))), Part("tin", box((0.06, 0.06, 0.10)))
CARTON_AT, TIN_AT = from_xyz_rpy((0.0, 0.0, 0.025), (0, 0, 0.4)), from_xyz_rpy((0.10, -0.05, 0.05), (0, 0, 0.2))


@pytest.fixture(scope="module")
def labelled():
    bodies = [*fixed_bodies(Workcell()), SolidBody("carton", CARTON.solid, CARTON_AT), SolidBody("tin", TIN.solid, TIN_AT)]
    camera = DepthCamera(Pinhole(525.0, 525.0, 159.5, 119.5), (240, 320), T_WORLD_SENSOR)
    return camera, look_exactly(camera, bodies)


@pytest.fixture
def label_judge(labelled):
    camera, seen = labelled
    view = DepthView(seen.depth, camera.projection)
    return LabelJudge(view, (Labelled("carton", seen.body == 1), Labelled("tin", seen.body == 2)), {"carton": CARTON, "tin": TIN})


def test_a_label_accepts_its_part_where_it_is(label_judge):
    for name, T, part in (("carton", CARTON_AT, CARTON), ("tin", TIN_AT, TIN)):
        for S in part.symmetries:
            (verdict,) = label_judge.verdicts(name, [inverse(T_WORLD_SENSOR) @ T @ S])
            assert verdict.right and verdict.measures["iou"] > 0.99 and verdict.measures["median_mm"] < 1e-3
    assert label_judge.verdicts("carton", [moved(CARTON_AT, 1.5, 0.5)])[0].right


@pytest.mark.parametrize(
    ("shift", "fails"),
    [((0.025, 0.0, 0.0), "iou"), ((0.0, 0.0, 0.012), "median_mm"), ((0.0, 0.0, 0.05), "seen_through"), ((0.0, 0.018, 0.0), "outline_mm")],
)
def test_a_label_refuses_its_part_elsewhere_and_tells_why(label_judge, shift, fails):
    limits = {"iou": 0.75, "outline_mm": 6.0, "median_mm": 6.0, "p90_mm": 10.0, "seen_through": 0.12}
    (verdict,) = label_judge.verdicts("carton", [inverse(T_WORLD_SENSOR) @ transform(None, shift) @ CARTON_AT])
    value = verdict.measures[fails]
    assert not verdict.right and verdict.matches is None
    assert value < limits[fails] if fails == "iou" else value > limits[fails]


def test_another_part_and_a_part_out_of_view_are_refused(label_judge):
    assert not label_judge.verdicts("tin", [inverse(T_WORLD_SENSOR) @ CARTON_AT])[0].right
    (verdict,) = label_judge.verdicts("carton", [moved(transform(None, (3.0, 0.0, 0.0)))])
    assert not verdict.right and all(np.isfinite(value) for value in verdict.measures.values())


@pytest.fixture
def real_folder(labelled, tmp_path):
    """The layout of labelled real scenes on disk, with a part that is absent."""
    camera, seen = labelled
    scene = tmp_path / "set" / "scene1"
    scene.mkdir(parents=True)
    (tmp_path / "parts").mkdir()
    for part in (CARTON, TIN, Part("ghost", box((0.05, 0.1, 0.2)))):
        write_obj(tmp_path / "parts" / f"{part.name}.obj", part.solid)
    lens = camera.projection
    cv2.imwrite(str(scene / "depth.png"), np.round(seen.depth * 1e4).astype(np.uint16))
    cv2.imwrite(str(scene / "labels.png"), (seen.body + 1).astype(np.uint8))
    (scene / "camera.json").write_text(json.dumps({"fx": lens.fx, "fy": lens.fy, "cx": lens.cx, "cy": lens.cy, "depth_scale": 0.1}))
    objects = [{"label": 2, "part": "carton"}, {"label": 3, "part": "tin"}]
    (scene / "objects.json").write_text(json.dumps({"objects": objects, "absent": ["ghost"]}))
    return tmp_path / "set"


class Told:
    """A method that answers what it is told."""

    name = "told"

    def __init__(self, answers):
        self.answers = answers

    def see(self, scene):
        self.scene = scene.name

    def locate(self, parts):
        return tuple(Answer(tuple(Pose(T, 1.0) for T in self.answers.get((self.scene, part.name), ())), 0.25) for part in parts)


def test_real_scenes_are_read_and_judged(real_folder, library):
    right = {("scene1", "carton"): [inverse(T_WORLD_SENSOR) @ CARTON_AT], ("scene1", "ghost"): [inverse(T_WORLD_SENSOR) @ TIN_AT]}
    (scene,) = load_labelled(scene_folders(real_folder), library)
    assert [part.name for part in scene.parts] == ["carton", "tin", "ghost"] and not scene.knows_world
    numbers = bench_locate([scene], [Told(right)], tell=lambda line: None)["summary"]["told"]
    assert (numbers["first_right"], numbers["present"], numbers["absent_found"], numbers["absent"]) == (1, 2, 1, 1)
    assert numbers["precision"] == 0.5 and numbers["off_mm"] is None


def test_the_table_counts_instances_questions_and_poses(judge, library):
    view = DepthView(np.full((4, 4), 0.7), Pinhole(500.0, 500.0, 1.5, 1.5), T_WORLD_SENSOR)
    scene = LabelledScene("a", view, True, tuple(judge.parts.values()), judge)
    said = {
        ("a", "brick"): [moved(HERE, 1.0, 0.5), moved(HERE, 40.0)],
        ("a", "l_block"): [moved(HERE, 4.0, 1.0)],
        ("a", "wedge"): [moved(THERE)],
    }
    lines = []
    report = bench_locate([scene], [Told(said)], lines.append)
    numbers = report["summary"]["told"]
    assert numbers["recall_plain"] == {"count": 2, "found": 2, "share": 1.0}
    assert numbers["recall_plain_strict"]["found"] == 1
    assert numbers["recall_half_hidden"] == {"count": 1, "found": 0, "share": 0.0}
    assert (numbers["first_right"], numbers["present"], numbers["absent_found"], numbers["absent"]) == (2, 2, 1, 1)
    assert numbers["poses"] == 4 and numbers["precision"] == 0.5 and numbers["false_share"] == 0.5
    assert numbers["off_mm"]["median"] == pytest.approx(2.5) and numbers["seconds"]["median"] == 0.25
    counts = [(cell["instances"]["count"], cell["first"]["count"]) for cell in numbers["bins"]]
    assert counts == [(0, 0)] * 3 + [(1, 0)] + [(0, 0)] * 2 + [(1, 1)] + [(0, 0)] * 2 + [(1, 1)]
    assert "told 2 of 2 right, 2 false" in lines[0] and any("100 % of 2" in line for line in lines)
    assert json.loads(json.dumps(report, allow_nan=False))["schema"] == "handey/bench/locate/1"


def test_whole_parts_fall_into_the_last_bin_and_an_empty_table_is_told():
    row = {"method": "m", "seconds": 1.0, "poses": [], "instances": [{"visible_fraction": 1.0, "found": True, "found_strict": True}]}
    summary = summarise([row])
    assert summary["m"]["bins"][9]["instances"]["found"] == 1 and summary["m"]["precision"] is None
    assert any("–" in line for line in table(summary))
    assert bench_locate([], [Told({})], tell=lambda line: None)["summary"] == {}


def test_parts_of_simulated_scenes_are_found_from_their_files(library, tmp_path):
    """The whole way with Handey Studio itself on a small open scene, twice: the same answers."""
    save_scene(random_scene(4, library, SceneOptions(bodies=3, clutter=(0, 0), spread=(0.12, 0.14))), tmp_path / "0004")
    first, second = (run_bench(library, lambda line: None, Silent(), scenes=tmp_path) for _ in range(2))
    numbers = first["summary"]["handey"]
    assert numbers["questions"] == 6 and numbers["recall_plain"]["count"] == 3
    assert numbers["recall_plain"]["found"] >= 2 and numbers["off_mm"]["median"] < 1.5
    poses = [[[pose["T_sensor_part"] for pose in row["poses"]] for row in report["rows"]] for report in (first, second)]
    assert poses[0] == poses[1]


@pytest.mark.parametrize(("ask", "calls"), [("together", [("carton", "tin")]), ("each", [("carton",), ("tin",)])])
def test_parts_are_asked_for_together_or_each(labelled, monkeypatch, ask, calls):
    camera, seen = labelled
    asked = []

    def answer(view, parts, options, rng):
        asked.append(tuple(part.name for part in parts))
        T = inverse(T_WORLD_SENSOR) @ CARTON_AT
        pose = LocatedPose("carton", CARTON_AT, T, 0.9, 9, 9, 1.0, 0.0)
        fell = Hypothesis("tin", TIN_AT, 0.1, 0.1, 0.1, (0, 1), "the sensor sees through it")
        return LocateResult((pose,) if "carton" in asked[-1] else (), (), (fell,), ())

    monkeypatch.setattr(answers, "localize", answer)
    method = answers.Handey(ask)
    method.see(LabelledScene("a", DepthView(seen.depth, camera.projection, T_WORLD_SENSOR), True, (CARTON, TIN), judge=None))
    carton, tin = method.locate((CARTON, TIN))
    assert asked == calls
    assert len(carton.poses) == 1 and carton.reason == "" and carton.seconds > 0
    assert tin.poses == () and tin.reason == "the best hypothesis of tin fell because the sensor sees through it."


def test_seeds_are_simulated_once_and_kept(library, tmp_path, monkeypatch):
    small = SceneOptions(bodies=2, size_px=64, clutter=(0, 0))
    made = []

    def make(seed, library, options):
        made.append((seed, options.sensor))
        return random_scene(seed, library, small)

    monkeypatch.setattr("handey_studio.task.bench.locate.labelled_scenes.random_scene", make)
    monkeypatch.setattr(command, "Handey", lambda ask: Told({}))
    report = run_bench(library, lambda line: None, Silent(), seeds=range(3, 5), scenes=tmp_path)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["0003", "0004"] and len(report["rows"]) == 12
    run_bench(library, lambda line: None, Silent(), seeds=range(3, 4), scenes=tmp_path)
    assert made == [(3, "camera"), (4, "camera")]
    run_bench(library, lambda line: None, Silent(), seeds=range(3, 4), scenes=tmp_path, sensor="range_finder")
    assert made[2:] == [(3, "range_finder")] and (tmp_path / "0003-range_finder" / "depth.png").is_file()


# Peers.

TOY = """
import sys
sys.path.insert(0, {folder!r})
import numpy as np
import peer_worker

class Middle:
    def learn(self, points, normals):
        return points.mean(axis=0)
    def locate(self, model, points):
        print("noise on standard output")
        T = np.eye(4)
        T[:3, 3] = points.mean(axis=0) - model
        return T, float(points.shape[0] > 50)

class Knowing(Middle):
    def locate(self, model, points):
        return np.array({T}), 1.0

peer_worker.peers = lambda voxels: {{"middle": Middle(), "knowing": Knowing()}} if {some} else {{}}
peer_worker.main()
"""


@pytest.fixture
def toy(tmp_path, monkeypatch):
    def make(some):
        script = tmp_path / "toy.py"
        script.write_text(TOY.format(folder=str(peers.WORKER.parent), some=some, T=(inverse(T_WORLD_SENSOR) @ CARTON_AT).tolist()))
        monkeypatch.setattr(peers, "WORKER", script)

    return make


def test_a_peer_sees_what_lies_above_the_table(labelled, toy):
    camera, seen = labelled
    toy(True)
    alone = np.where(seen.body == 2, np.nan, seen.depth)  # the carton and the table
    scene = LabelledScene("a", DepthView(alone, camera.projection, T_WORLD_SENSOR), True, (CARTON,), judge=None)
    with peers.LocatePeers() as process:
        assert process.names == ("middle", "knowing")
        peer = peers.Peer(process, "middle")
        peer.see(scene)
        (answer,) = peer.locate([CARTON])
        off = T_WORLD_SENSOR @ answer.poses[0].T_sensor_part[:, 3] - CARTON_AT[:, 3]
        assert np.abs(off[:2]).max() < 0.01 and 0.0 < off[2] < 0.03 and answer.seconds > 0
        (once,) = peers.Peer(process, "knowing", most=3).locate([CARTON])
        assert len(once.poses) == 1  # the points that it explains are gone, and hardly any are left
        peer.see(replace(scene, view=DepthView(np.where(seen.body == 0, seen.depth, np.nan), camera.projection, T_WORLD_SENSOR)))
        (nothing,) = peer.locate([CARTON])
        assert nothing.poses == () and "too few points" in nothing.reason


def test_without_peers_one_sentence_tells_how_to_get_them(toy):
    toy(False)
    with pytest.raises(BadInput, match=r"pip install 'handey-studio\[bench\]'"):
        peers.LocatePeers()
    with pytest.raises(BadInput, match="cannot be run"):
        peers.LocatePeers("/nowhere/python")


def test_a_peer_process_that_ends_is_told(toy, tmp_path):
    toy(True)
    (tmp_path / "toy.py").write_text("import sys; sys.stdin.readline()")
    with pytest.raises(BadInput, match="ended at the request"):
        peers.LocatePeers(sys.executable)


def test_a_worker_that_is_busy_is_not_waited_for(toy, tmp_path):
    toy(True)
    answer = json.dumps({"peers": ["sleeper"]})
    (tmp_path / "toy.py").write_text(f"import sys, time\nsys.stdin.readline()\nprint('{answer}', flush=True)\ntime.sleep(600)")
    process = peers.LocatePeers()
    begun = time.monotonic()
    process.close()
    assert time.monotonic() - begun < 60


def test_surface_points_cover_a_solid_evenly(library):
    solid = library.part("l_block").solid
    points, normals = peers.surface_points(solid, 20000, np.random.default_rng(0))
    heights = points @ solid.normals.T - solid.offsets
    face = np.argmax(normals @ solid.normals.T - 1e3 * (np.abs(heights) > 1e-9), axis=1)
    assert np.allclose(solid.normals[face], normals) and np.abs(heights[np.arange(len(points)), face]).max() < 1e-9
    areas = [solid.face_polygon(f, solid.face_frame(f)).area for f in range(len(solid.faces))]
    assert np.allclose(np.bincount(face, minlength=len(areas)) / 20000, np.array(areas) / sum(areas), atol=0.02)


def test_the_workers_voxels():
    points = np.random.default_rng(1).uniform(-1, 1, (500, 3))
    kept = first_of_voxels(points, 0.5)
    assert len(kept) == len({tuple(cell) for cell in np.floor(points / 0.5)})
    near = [bool((np.abs(np.floor(points / 0.1) - np.floor(point / 0.1)).max(axis=1) <= 1).any()) for point in points + 0.12]
    assert share_on(points + 0.12, around(points, 0.1), 0.1) == np.mean(near) and 0.05 < np.mean(near) < 0.95
    assert share_on(points, around(points, 0.1), 0.1) == 1.0 and share_on(points + 5e6, around(points, 0.1), 0.1) == 0.0


# The shell and the plot.


def test_bad_requests_are_one_sentence(tmp_path, capsys, monkeypatch):
    assert main(["bench", "locate", "--scenes", str(tmp_path / "none")]) == 2
    assert "does not exist" in capsys.readouterr().err
    assert main(["bench", "locate", "--scenes", str(tmp_path)]) == 2
    assert "truth.json" in capsys.readouterr().err
    assert main(["bench", "locate", "--plot", str(tmp_path / "plot.bmp")]) == 2
    assert ".png, .svg, .pdf" in capsys.readouterr().err
    monkeypatch.setattr(plot, "find_spec", lambda name: None)
    assert main(["bench", "locate", "--plot", str(tmp_path / "plot.png")]) == 2
    assert "handey-studio[bench]" in capsys.readouterr().err


def test_a_plot_is_drawn(judge, tmp_path):
    pytest.importorskip("matplotlib", reason="the plot needs the bench extra")
    view = DepthView(np.full((4, 4), 0.7), Pinhole(500.0, 500.0, 1.5, 1.5), T_WORLD_SENSOR)
    scene = LabelledScene("a", view, True, tuple(judge.parts.values()), judge)
    report = bench_locate([scene], [Told({("a", "brick"): [moved(HERE)]})], tell=lambda line: None)
    plot.plot(report["summary"], tmp_path / "plot.png")
    assert cv2.imread(str(tmp_path / "plot.png")).shape[1] > 1000


def test_a_broken_list_of_objects_is_one_sentence(real_folder, library):
    (real_folder / "scene1" / "objects.json").write_text('{"objects": [{"part": "tin"}]}')
    with pytest.raises(BadInput, match="label and part"):
        list(load_labelled(scene_folders(real_folder), library))
