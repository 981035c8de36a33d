"""`handey model suggest` on files: a closed part that can be read back, or one sentence."""

import json

import cv2
import numpy as np
import pytest

from handey_studio import cli
from handey_studio.world.model_files import read_part
from tests.modeling.scenes import PINHOLE, box_pose, boxes_seen

SIZE, SMALL = np.array([0.10, 0.07, 0.16]), np.array([0.06, 0.05, 0.04])


@pytest.fixture
def suggest(tmp_path, capsys):
    """Runs the command on boxes (size, T_world_box); its exit status, its JSON if it wrote one, and what it said."""

    def run(boxes, *more):
        depth = boxes_seen(boxes, np.random.default_rng(1), 0.0008).view.depth
        cv2.imwrite(str(tmp_path / "depth.png"), np.rint(np.nan_to_num(depth) * 1e4).astype(np.uint16))
        camera = {"fx": PINHOLE.fx, "fy": PINHOLE.fy, "cx": PINHOLE.cx, "cy": PINHOLE.cy, "depth_scale": 0.1}
        (tmp_path / "camera.json").write_text(json.dumps(camera))
        out = tmp_path / "out.json"
        words = ["--depth", str(tmp_path / "depth.png"), "--camera", str(tmp_path / "camera.json"), "--json", str(out)]
        status = cli.main(["model", "suggest", *words, *more])
        return status, json.loads(out.read_text()) if out.exists() else None, capsys.readouterr().err

    return run


def test_the_part_of_the_largest_object_is_written(suggest, tmp_path):
    status, report, said = suggest([(SIZE, box_pose(SIZE, -0.3))], "--out", str(tmp_path / "carton.obj"))
    assert status == 0 and not said and report["schema"] == "handey/model-suggest/1"
    (found,) = report["objects"]
    assert np.abs(np.array(found["dimensions_mm"]) - 1e3 * np.sort(SIZE)).max() < 4.0 and abs(found["height_mm"] - 160.0) < 1.5
    assert len(found["faces"]) == len(found["sources"]) == 6 and found["explained"] > 0.95 and not found["reason"]
    part = read_part(tmp_path / "carton.obj")
    assert np.allclose(np.sort(part.solid.vertices, axis=0), np.sort(np.array(found["vertices_m"]), axis=0), atol=1e-6)


def test_all_objects_or_the_one_at_a_pixel(suggest):
    boxes = [(SIZE, box_pose(SIZE, -0.3, -0.1)), (SMALL, box_pose(SMALL, 0.4, 0.12))]
    status, report, _ = suggest(boxes, "--all")
    assert status == 0 and [round(found["height_mm"] / 10) for found in report["objects"]] == [16, 4]
    u, v = report["objects"][1]["at_px"]
    status, report, _ = suggest(boxes, "--at", f"{u},{v}")
    assert status == 0 and [round(found["height_mm"] / 10) for found in report["objects"]] == [4]


def test_nothing_there_is_status_3(suggest):
    status, report, said = suggest([])
    assert status == 3 and report["objects"] == [] and "nothing" in said
    status, report, said = suggest([(SIZE, box_pose(SIZE))], "--at", "3,3")
    assert status == 3 and "no planar face lies at 3, 3 px" in said


@pytest.mark.parametrize(("more", "told"), [(("--at", "left"), "not U,V"), (("--out", "carton.step"), "must be one of .obj")])
def test_bad_input_is_one_sentence(suggest, more, told):
    status, _, said = suggest([(SIZE, box_pose(SIZE))], *more)
    assert status == 2 and told in said and len(said.strip().splitlines()) == 1


@pytest.mark.parametrize("at", ["nan,1", "inf,0"])
def test_a_pixel_that_is_no_number_is_refused_in_a_sentence(tmp_path, capsys, at):
    given = ["model", "suggest", "--depth", "none.png", "--json", str(tmp_path / "out.json"), f"--at={at}"]
    assert cli.main(given) == 2
    assert f'"{at}" is not U,V' in capsys.readouterr().err
