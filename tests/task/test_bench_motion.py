"""`handey bench motion`: the same geometry for everyone, an honest judge, and the table."""

import json
import sys

import numpy as np
import pytest
import yaml

from handey_studio import cli
from handey_studio.base import BadInput
from handey_studio.geometry import box
from handey_studio.geometry.transforms import from_xyz_rpy, transform
from handey_studio.task.bench.motion import peers
from handey_studio.task.bench.motion.answers import Answer, judged, least_clearance, sampled
from handey_studio.task.bench.motion.peer_worker import Bodies
from handey_studio.task.bench.motion.problems import Problem, length, problem_files, read_problems
from handey_studio.task.bench.motion.random_reaches import DEEP_M, random_reaches
from handey_studio.task.bench.motion.summary import summarise, table
from handey_studio.task.bench.motion.urdf import export
from handey_studio.world import Block, ConvexBody, Held, Part, World, arm_of, load_robot
from handey_studio.world.collision import collision_model
from tests.test_cli_path import GOAL, PILLAR, START, body, request_of, scene_of

ROBOT = load_robot("robots/ur5")

TOY = """
import json, sys
for line in sys.stdin:
    asked = json.loads(line)
    told = {"hello": {"peers": ["straight", "silent"]}, "scene": {}}.get(asked["do"])
    if told is None:
        told = {"path": [asked["start"], asked["goal"]] if asked["peer"] == "straight" else [], "seconds": 0.5}
    print(json.dumps(told), flush=True)
"""


@pytest.fixture
def folder(tmp_path):
    place = tmp_path / "problems" / "pillars"
    place.mkdir(parents=True)
    (place / "01.scene.yaml").write_text(yaml.safe_dump(scene_of(PILLAR)))
    (place / "01.request.yaml").write_text(yaml.safe_dump(request_of(START, GOAL)))
    (place / "03.scene.yaml").write_text(yaml.safe_dump(scene_of(PILLAR)))
    (place / "03.request.yaml").write_text(yaml.safe_dump(request_of(START, [0.0, *GOAL[1:]])))
    (place / "02.scene.yaml").write_text(yaml.safe_dump(scene_of(body("sphere", [0.05], (0.3, 0.3, 2.0)))))
    (place / "02.request.yaml").write_text(yaml.safe_dump(request_of(START, START)))
    return tmp_path / "problems"


def test_problems_come_in_families(folder):
    (folder / "stray.scene.yaml").write_text("world: {}")
    first, second, _ = read_problems(problem_files(folder), folder, ROBOT)
    assert (first.family, first.name, second.name) == ("pillars", "01", "02")
    assert list(first.world.robot.hand.boxes(0.0)) == ["hand"]
    with pytest.raises(BadInput, match="no folder"):
        problem_files(folder / "none")
    (folder / "empty").mkdir()
    with pytest.raises(BadInput, match="has no problems"):
        problem_files(folder / "empty")


def test_random_reaches_are_deep_free_at_their_ends_and_come_again():
    robots = load_robot("robots/ur5")
    for problem, again in zip(random_reaches(robots, range(2)), random_reaches(robots, range(2)), strict=True):
        assert problem == again
        model = collision_model(problem.world)
        for q in (problem.start, problem.goal):
            assert model.in_contact(q, problem.opening, problem.held) is None
        assert arm_of(robots).hand_pose(problem.goal)[2, 3] < DEEP_M + 0.01
        assert problem.held is not None and (problem.family == "bin") == any(
            block.name.startswith("wall") for block in problem.world.blocks
        )


def test_everyone_sees_the_same_bodies(tmp_path):
    cone = np.array([[0.5, 0.3, 0.2], [0.3, 0.4, 0.2], [0.3, 0.2, 0.2], [0.4, 0.3, 0.5]])
    blocks = (Block("slab", np.array([0.3, 0.2, 0.1]), from_xyz_rpy((0.4, -0.3, 0.4), (0.3, 0.5, 0.7))), ConvexBody("cone", cone))
    held = Held("bar", Part("bar", box((0.03, 0.04, 0.2))), from_xyz_rpy((0, 0, 0.05), (0.1, 0.2, 0.3)))
    problem = Problem("f", "1", World(ROBOT, blocks=blocks), np.array(START), np.array(GOAL), 0.03, held)
    exported, model = export(problem, tmp_path), collision_model(problem.world)
    theirs, told, free = Bodies(str(exported.file), exported.pairs), 0, 0
    for q in np.random.default_rng(5).uniform(-2.5, 2.5, (300, 6)):
        clearance = model.clearance(q, 0.03, held)
        if clearance.distance > 1e-5 or clearance.distance < -1e-5:
            assert theirs.free(q) == (clearance.distance > 0), clearance
            told, free = told + 1, free + (clearance.distance > 0)
    assert told > 290 and 20 < free < 280


def test_a_path_through_a_body_is_caught_and_measured():
    pillar = World(ROBOT, blocks=(Block("pillar", np.array([0.1, 0.1, 0.6]), transform(None, (0.5, 0.0, 0.3))),))
    problem = Problem("f", "1", pillar, np.array(START), np.array(GOAL), 0.02)
    through = judged(problem, Answer(np.array([START, GOAL]), 1.0))
    assert through["found"] and through["clearance_m"] == 0.0 and any("pillar" in hit["bodies"] for hit in through["collisions"])
    assert through["length_rad"] == pytest.approx(2.4)
    none = judged(problem, Answer(np.empty((0, 6)), 2.0, "why"))
    assert not none["found"] and none["reason"] == "why" and none["seconds"] == 2.0


def test_least_clearance_is_the_least_of_all_places():
    problem = Problem("f", "1", World(ROBOT), np.array(START), np.array(GOAL), 0.02)
    path = np.array([START, [0.0, -0.9, 1.4, -1.6, -1.57, 0.0], GOAL])
    model = collision_model(problem.world)
    assert least_clearance(problem, path) == pytest.approx(min(model.clearance(q, 0.02).distance for q in sampled(path, 0.02)))
    steps = np.abs(np.diff(sampled(path, 0.02), axis=0)).max(axis=1)
    assert steps.max() <= 0.02 + 1e-12 and length(np.array(sampled(path, 0.02))) == pytest.approx(length(path))


def test_the_command_beside_a_toy_peer(folder, tmp_path, monkeypatch, capsys):
    (tmp_path / "toy.py").write_text(TOY)
    monkeypatch.setattr(peers, "WORKER", tmp_path / "toy.py")
    out = tmp_path / "table.json"
    assert cli.main(["bench", "motion", str(folder), "--peer-python", sys.executable, "--json", str(out)]) == 0
    told = capsys.readouterr().out
    assert "COLLIDES" in told and "Handey" in told and "2 of 2" in told
    summary = json.loads(out.read_text())["summary"]
    assert summary["Handey"]["all"]["no_free_ends"] == 1
    assert summary["Handey"]["all"]["solved"] == 2 and summary["Handey"]["all"]["colliding"] == 0
    assert summary["straight"]["all"]["colliding"] == 2 and summary["silent"]["all"]["solved"] == 0


def test_what_cannot_be_measured_is_told_before_any_work(folder, capsys):
    assert cli.main(["bench", "motion"]) == 2 and "--random" in capsys.readouterr().err
    assert cli.main(["bench", "motion", str(folder), "--peer-python", "/nowhere/python"]) == 2
    assert cli.main(["bench", "motion", str(folder), "--plot", "table.txt"]) == 2


def test_summary_of_rows():
    def row(method, name, seconds, length_rad=None, collisions=()):
        found = {"length_rad": length_rad, "clearance_m": 0.01, "collisions": list(collisions)} if length_rad is not None else {}
        return {"method": method, "family": "f", "name": name, "seed": 0, "ends_free": name != "3", "seconds": seconds,
                "found": length_rad is not None} | found  # fmt: skip

    rows = [row("a", "1", 1.0, 4.0), row("a", "2", 3.0, 8.0), row("b", "1", 2.0, 5.0, [{}]), row("b", "2", 9.0), row("a", "3", 0.1)]
    numbers = summarise(rows)
    assert (numbers["a"]["all"]["solved"], numbers["b"]["all"]["solved"], numbers["b"]["all"]["colliding"]) == (2, 1, 1)
    assert numbers["a"]["all"]["length_rad"]["median"] == 6.0 and numbers["a"]["all"]["length_together_rad"]["median"] == 4.0
    assert (numbers["a"]["all"]["asked"], numbers["a"]["all"]["no_free_ends"]) == (2, 1)
    assert len(table(numbers)) == 4 and "1 more begin" in table(numbers)[-1] and table({}) == ["no problem was measured"]


def test_plot(tmp_path):
    pytest.importorskip("matplotlib")
    from handey_studio.task.bench.motion.plot import plot

    found = {"method": "a", "seconds": 1.0, "ends_free": True, "found": True, "length_rad": 2.0, "collisions": []}
    plot([found, found | {"method": "b", "found": False}, found | {"ends_free": False}], tmp_path / "table.svg")
    assert (tmp_path / "table.svg").stat().st_size > 5000
