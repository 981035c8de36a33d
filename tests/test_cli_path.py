"""`handey path`: MoveIt's scenes and requests, answered with a path, a reason, or one sentence about what is wrong with the file."""

import json
from dataclasses import replace
from itertools import pairwise

import fcl
import numpy as np
import pytest
import yaml

from handey_studio import cli
from handey_studio.geometry.transforms import from_xyz_rpy
from handey_studio.world import arm_of, load_robot
from handey_studio.world.collision import collision_model
from handey_studio.world.envelope import enveloped
from handey_studio.world.moveit import read_request, read_scene

ROBOT = load_robot("robots/ur5")
START, GOAL = [-1.2, -1.2, 1.2, -1.6, -1.57, 0.0], [1.2, -1.2, 1.2, -1.6, -1.57, 0.0]
UP = [0.0, 0.0, 0.0, 1.0]
PILLAR = {"id": "pillar", "primitives": [{"type": "box", "dimensions": [0.1, 0.1, 0.6]}],
          "primitive_poses": [{"position": [0.5, 0.0, 0.3], "orientation": UP}]}  # fmt: skip


def body(kind: str, sizes: list, position=(0.5, 0.0, 0.3), orientation=UP) -> dict:
    return {
        "id": kind,
        "primitives": [{"type": kind, "dimensions": sizes}],
        "primitive_poses": [{"position": list(position), "orientation": list(orientation)}],
    }


def scene_of(*bodies: dict) -> dict:
    return {"name": "x", "robot_model_name": "ur5", "world": {"collision_objects": list(bodies), "octomap": {}}}


def request_of(start, goal, names=ROBOT.joint_names) -> dict:
    joints = [{"joint_name": name, "position": value, "weight": 1} for name, value in zip(names, goal, strict=False)]
    state = {"name": [*names, "robotiq_85_left_knuckle_joint"], "position": [*start, 0.0]}
    return {"start_state": {"joint_state": state}, "goal_constraints": [{"joint_constraints": joints}]}


@pytest.fixture
def ask(tmp_path, capsys):
    """Runs `handey path` on a scene and a request, each a mapping or the text of a file; status, JSON if written, and what it said."""

    def run(scene, request):
        for name, content in (("scene", scene), ("request", request)):
            text = content if isinstance(content, bytes) else yaml.safe_dump(content).encode()
            (tmp_path / f"{name}.yaml").write_bytes(text)
        out = tmp_path / "out.json"
        out.unlink(missing_ok=True)
        files = ["--scene", str(tmp_path / "scene.yaml"), "--request", str(tmp_path / "request.yaml")]
        status = cli.main(["path", "--robot", "ur5", *files, "--json", str(out)])
        said = capsys.readouterr().err
        assert len(said.strip().splitlines()) == (0 if status == 0 else 1)
        return status, json.loads(out.read_text()) if out.exists() else None, said

    return run


def fcl_meets(scene: dict, q: np.ndarray) -> bool:
    """Whether the exact meshes, or the hand's box, meet a scene of boxes, cylinders and spheres: FCL's own shapes."""
    arm = arm_of(ROBOT)
    poses = arm.link_poses(q)
    flange = poses[-1] @ arm.T_last_flange
    moving = [(fcl.Box(0.1, 0.03, 0.12), flange @ from_xyz_rpy((0, 0, 0.06)))]
    for link in arm.bodies[1:]:
        mesh = fcl.BVHModel()
        mesh.beginModel(len(link.vertices), len(link.triangles))
        mesh.addSubModel(np.array(link.vertices), np.array(link.triangles))
        mesh.endModel()
        moving.append((mesh, poses[link.link]))
    for given in scene["world"]["collision_objects"]:
        sizes, pose = given["primitives"][0]["dimensions"], given["primitive_poses"][0]
        shape = {"box": fcl.Box, "cylinder": lambda h, r: fcl.Cylinder(r, h), "sphere": fcl.Sphere}[given["primitives"][0]["type"]](*sizes)
        x, y, z, w = pose["orientation"]
        fixed = fcl.CollisionObject(shape, fcl.Transform(np.array([w, x, y, z]), np.array(pose["position"])))
        for one, T in moving:
            thing = fcl.CollisionObject(one, fcl.Transform(T[:3, :3], T[:3, 3]))
            if fcl.collide(thing, fixed, fcl.CollisionRequest(), fcl.CollisionResult()):
                return True
    return False


def test_a_path_around_a_pillar(ask):
    scene = scene_of(PILLAR, body("cylinder", [0.5, 0.06], (0.35, 0.45, 0.2)), body("sphere", [0.1], (0.3, -0.3, 0.75)))
    status, told, _ = ask(scene, request_of(START, GOAL))
    assert status == 0 and told["schema"] == "handey/path/1" and told["status"] == "found"
    assert told["joint_names"] == list(ROBOT.joint_names) and told["certificate"]["proved"]
    times, q = np.array(told["time_s"]), np.array(told["q_rad"])
    np.testing.assert_allclose(q[[0, -1]], [START, GOAL], atol=1e-9)
    assert (np.diff(times) > 0).all() and (np.abs(np.diff(q, axis=0)) <= ROBOT.velocity * np.diff(times)[:, None] + 1e-6).all()
    assert fcl_meets(scene, np.array([0.0, *START[1:]])), "the straight way is barred, or this test shows nothing"
    for a, b in pairwise(q):
        for share in np.linspace(0, 1, 2 + int(np.abs(b - a).max() / 0.02)):
            assert not fcl_meets(scene, a + share * (b - a))


def test_an_end_in_collision_is_told_with_the_pair_and_the_depth(ask):
    reach = arm_of(ROBOT).hand_pose(np.array(GOAL))[:3, 3].tolist()
    status, told, said = ask(scene_of(body("sphere", [0.05], reach)), request_of(START, GOAL))
    assert status == 3 and told["status"] == "none" and told["q_rad"] == []
    assert "the goal is in collision: hand and sphere overlap by" in told["reason"] and told["reason"] in said
    (entry,) = told["ledger"]
    assert entry["bodies"] == ["hand", "sphere"] and -0.2 < entry["value"] < -0.01


def test_an_end_beyond_a_limit(ask):
    status, told, _ = ask(scene_of(), request_of(START, [*GOAL[:2], 3.5, *GOAL[3:]]))
    assert status == 3 and "beyond the limit of elbow_joint" in told["reason"]


WRONG_SCENES = {
    "not yaml": b"world: [1, 2\n  - }",
    "not text": bytes(range(256)),
    "a list": b"- 1\n- 2\n",
    "empty": b"",
    "no world": {"scene": {}},
    "no objects": {"world": {}},
    "objects are a text": {"world": {"collision_objects": "none"}},
    "an object is a number": {"world": {"collision_objects": [3]}},
    "a mesh": {"world": {"collision_objects": [{"id": "cup", "meshes": [{"vertices": []}]}]}},
    "a cone": scene_of(body("cone", [0.1, 0.1])),
    "too few sizes": scene_of(body("box", [0.1, 0.1])),
    "no size": scene_of(body("box", [0.1, 0.0, 0.1])),
    "a size that is no number": scene_of(body("box", [0.1, float("nan"), 0.1])),
    "a size without end": scene_of(body("sphere", [float("inf")])),
    "a size as a truth value": scene_of(body("sphere", [True])),
    "far too big": scene_of(body("sphere", [1e5])),
    "far away": scene_of(body("sphere", [0.1], (1e9, 0, 0))),
    "no rotation": scene_of(body("box", [0.1, 0.1, 0.1], (0, 0, 1), (0, 0, 0, 0))),
    "more bodies than poses": scene_of({"id": "a", "primitives": [{"type": "sphere", "dimensions": [0.1]}], "primitive_poses": []}),
    "deep": b"[" * 5000 + b"]" * 5000,
    "references": b"a: &a [x, x]\nb: &b [*a, *a]\nworld: {collision_objects: [*b, *b]}",
    "too long": b"#" + b"x" * 5_000_000,
}
WRONG_REQUESTS = {
    "no start": {"goal_constraints": []},
    "no goal": {**request_of(START, GOAL), "goal_constraints": []},
    "a joint is missing": request_of(START[:5], GOAL, ROBOT.joint_names[:5]),
    "no number": request_of(START, [*GOAL[:5], "north"]),
    "nan": request_of([*START[:5], float("nan")], GOAL),
    "names and positions": {**request_of(START, GOAL), "start_state": {"joint_state": {"name": ["a"], "position": []}}},
    "rows that are no mappings": {**request_of(START, GOAL), "goal_constraints": [{"joint_constraints": [1, None]}]},
}


@pytest.mark.parametrize("name", WRONG_SCENES)
def test_broken_scenes(ask, name):
    status, told, said = ask(WRONG_SCENES[name], request_of(START, GOAL))
    assert status == 2 and told is None and "scene.yaml" in said and len(said) < 600


@pytest.mark.parametrize("name", WRONG_REQUESTS)
def test_broken_requests(ask, name):
    status, told, said = ask(scene_of(PILLAR), WRONG_REQUESTS[name])
    assert status == 2 and told is None and "request.yaml" in said and len(said) < 600


def test_missing_files_and_robots(tmp_path, capsys):
    (tmp_path / "s.yaml").write_text(yaml.safe_dump(scene_of()))
    words = ["path", "--robot", "ur5", "--scene", str(tmp_path / "s.yaml"), "--request", str(tmp_path / "none.yaml")]
    assert cli.main(words) == 2 and "none.yaml" in capsys.readouterr().err
    words[2] = "ur99"
    assert cli.main(words) == 2 and "choose one of" in capsys.readouterr().err


def test_bodies_are_in_the_frame_of_the_base_and_poses_compose(tmp_path):
    turned = replace(ROBOT, T_world_base=from_xyz_rpy((1.0, 2.0, 0.5), (0, 0, np.pi / 2)))
    given = {**PILLAR, "pose": {"position": {"x": 0.0, "y": 0.0, "z": 1.0}, "orientation": {"x": 0, "y": 0, "z": 0, "w": 1}}}
    given["primitives"] = [{"type": 1, "dimensions": ["1e-1", 0.1, 0.6]}]
    (tmp_path / "s.yaml").write_text(yaml.safe_dump(scene_of(given)))
    (block,) = read_scene(tmp_path / "s.yaml", turned).blocks
    np.testing.assert_allclose(block.corners_world.mean(axis=0), (1.0, 2.5, 1.8), atol=1e-12)
    np.testing.assert_allclose(np.ptp(block.corners_world, axis=0), (0.1, 0.1, 0.6), atol=1e-12)


def test_joints_are_taken_by_name(tmp_path):
    names = ROBOT.joint_names[::-1]
    (tmp_path / "q.yaml").write_text(yaml.safe_dump(request_of(START[::-1], GOAL[::-1], names)))
    asked = read_request(tmp_path / "q.yaml", ROBOT)
    np.testing.assert_array_equal(asked.start, START)
    np.testing.assert_array_equal(asked.goal, GOAL)


def test_an_empty_world_has_no_table_and_no_end(tmp_path):
    (tmp_path / "s.yaml").write_text(yaml.safe_dump(scene_of()))
    model = collision_model(read_scene(tmp_path / "s.yaml", enveloped(ROBOT)))
    down = model.clearance(np.array([0.0, 1.2, 0.3, 0.0, 0.0, 0.0]), 0.0)
    assert down.distance > 0 and not {"table", "outside"} & set(down.bodies)


def test_the_envelope_holds_the_hand_at_every_opening_and_is_the_stated_box():
    (low, high) = enveloped(ROBOT).hand.boxes(0.03)["hand"]
    for opening in np.linspace(ROBOT.hand.opening_min, ROBOT.hand.opening_max, 7):
        for lower, upper in ROBOT.hand.boxes(opening).values():
            assert (lower >= low - 1e-12).all() and (upper <= high + 1e-12).all()
    tip = np.array([0.0, 0.0, ROBOT.hand.T_flange_hand[2, 3]])
    np.testing.assert_allclose([low + tip, high + tip], [(-0.05, -0.015, 0), (0.05, 0.015, 0.12)], atol=1e-12)
