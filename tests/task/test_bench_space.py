"""`handey bench space`: scenes with truth, times of every kind, and an oracle that would notice."""

import json
from dataclasses import replace

import numpy as np
import pytest

from handey_studio import cli
from handey_studio.motion import configuration_space
from handey_studio.task.bench.motion import space_cells
from handey_studio.task.bench.motion.space_scenes import space_scene
from handey_studio.world import load_robot
from handey_studio.world.collision import collision_model

ROBOT = load_robot("robots/ur5")


def test_a_scene_is_free_at_both_ends_and_one_part_moves():
    scene = space_scene(ROBOT, 3)
    for q in (scene.start, scene.goal):
        assert collision_model(scene.world).in_contact(q, scene.opening) is None
    before, after = ({part.name: part.T_world_part for part in world.parts} for world in (scene.world, scene.moved))
    assert [name for name in before if (before[name] != after[name]).any()] == ["brick#3"]


def test_every_time_is_told(tmp_path, capsys):
    assert cli.main(["bench", "space", "--seeds", "0:1", "--cells", "20", "--cold", "--json", str(tmp_path / "space.json")]) == 0
    report = json.loads((tmp_path / "space.json").read_text())["robots"][0]
    assert report["robot"] == "ur5" and report["cells"] == {"cells": 20, "looks": space_cells.LOOKS, "colliding": 0}
    assert {"one part moved, 2.5°", "from a new depth map to the space, 5°", "the whole answer"} <= set(report["seconds"])
    assert all(0 < numbers["median"] <= numbers["p95"] for numbers in report["seconds"].values()) and report["cold_start_s"] > 0
    assert "20 free cells" in capsys.readouterr().out


def test_the_oracle_notices_a_space_that_calls_everything_free(monkeypatch):
    def careless(mover, wrists, extent):
        space, box = configuration_space.configuration_space(mover, wrists, extent)
        return replace(space, blocked=np.zeros_like(space.blocked)), box

    monkeypatch.setattr(space_cells, "configuration_space", careless)
    looked, colliding = space_cells._scene(ROBOT, 1, 30)
    assert looked == 30 and colliding > 5


def test_cells_are_a_whole_number(capsys):
    assert cli.main(["bench", "space", "--cells", "many"]) == 2
    assert "whole number" in capsys.readouterr().err


@pytest.mark.parametrize("name", ["panda", "puma560"])
def test_free_cells_of_other_arms(name):
    looked, colliding = space_cells._scene(load_robot(f"robots/{name}"), 1, 40)
    assert looked == 40 and colliding == 0
