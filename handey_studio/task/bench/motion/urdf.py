"""A problem as a URDF, for planners that know no other way: the same convex pieces, and which of its links may not meet."""

from pathlib import Path
from typing import NamedTuple
from xml.sax.saxutils import quoteattr

import numpy as np
from numpy.typing import NDArray

from handey_studio.geometry import hull_triangles
from handey_studio.geometry.transforms import to_xyz_rpy, transform
from handey_studio.task.bench.motion.problems import Problem
from handey_studio.world import arm_of
from handey_studio.world.collision import collision_model
from handey_studio.world.collision_bodies import solids_of

HAND = "hand"


class Exported(NamedTuple):
    """A URDF file, and the pairs of its links that are held against each other."""

    file: Path
    pairs: list[tuple[str, str]]


def export(problem: Problem, folder: Path) -> Exported:
    """Writes a problem's robot, hand, held part and scene into a folder."""
    arm, model = arm_of(problem.world.robot), collision_model(problem.world)
    bodies = model.bodies(problem.held)
    links = {body.name for body in arm.bodies}
    groups = [f"link{bodies.shapes.link[b]}" if name in links else HAND for b, name in enumerate(bodies.names)]
    pieces: dict[str, list[str]] = {group: [] for group in [f"link{i}" for i in range(arm.n + 1)] + [HAND]}
    for b, group in enumerate(groups):
        corners = bodies.shapes.corners[bodies.shapes.first[b] : bodies.shapes.first[b + 1]] + bodies.shapes.slide[b] * problem.opening
        pieces[group].append(_collision(corners, folder / f"{group}-{b}.obj"))
    solids = solids_of(problem.world)
    fixed = {f"fixed{k}": [_collision(corners, folder / f"fixed{k}.obj")] for k, (_, corners) in enumerate(solids)}
    text = ['<robot name="problem">', '<link name="world"/>', *_chain(problem)]
    text += [f"<link name={quoteattr(name)}>{''.join(shapes)}</link>" for name, shapes in (pieces | fixed).items()]
    text += [_joint(f"to_{name}", "world", name, np.eye(4)) for name in fixed] + ["</robot>"]
    file = folder / "problem.urdf"
    file.write_text("\n".join(text))
    pairs = sorted({(groups[a], groups[b]) for a, b in bodies.shapes.pairs})
    pairs += [(group, name) for group in pieces if group != "link0" for name in fixed]
    return Exported(file, pairs)


def _chain(problem: Problem) -> list[str]:
    """The joints from the world to the hand."""
    robot, arm = problem.world.robot, arm_of(problem.world.robot)
    joints = [_joint("base", "world", "link0", robot.T_world_base)]
    for i, name in enumerate(robot.joint_names):
        limits = f'<limit lower="{robot.lower[i]}" upper="{robot.upper[i]}" velocity="{robot.velocity[i]}" effort="100"/>'
        axis = f'<axis xyz="{_words(arm.axes[i])}"/>'
        joints.append(_joint(name, f"link{i}", f"link{i + 1}", arm.T_links[i], "revolute", axis + limits))
    return [*joints, _joint("grip", f"link{arm.n}", HAND, np.eye(4))]


def _joint(name: str, parent: str, child: str, T: NDArray, kind: str = "fixed", more: str = "") -> str:
    ends = f'<parent link="{parent}"/><child link="{child}"/>'
    return f"<joint name={quoteattr(name)} type={quoteattr(kind)}>{_origin(T)}{ends}{more}</joint>"


def _origin(T: NDArray) -> str:
    xyz, rpy = to_xyz_rpy(T)
    return f'<origin xyz="{_words(xyz)}" rpy="{_words(rpy)}"/>'


def _words(numbers: NDArray) -> str:
    return " ".join(f"{number:.17g}" for number in numbers)


def _collision(corners: NDArray, file: Path) -> str:
    """A convex body: a box where it is one, else a mesh in a file."""
    cuboid = _as_box(corners)
    if cuboid is not None:
        size, T = cuboid
        return f'<collision>{_origin(T)}<geometry><box size="{_words(size)}"/></geometry></collision>'
    rows = [f"v {_words(corner)}" for corner in corners] + ["f {} {} {}".format(*triangle + 1) for triangle in hull_triangles(corners)]
    file.write_text("\n".join(rows) + "\n")
    return f"<collision><geometry><mesh filename={quoteattr(str(file))}/></geometry></collision>"


def _as_box(corners: NDArray) -> tuple[NDArray, NDArray] | None:
    """Size (3,) [m] and pose (4, 4) of a cuboid whose corners run with z fastest and x slowest; None for other bodies."""
    if len(corners) != 8:
        return None
    sides = corners[[4, 2, 1]] - corners[0]
    size = np.linalg.norm(sides, axis=1)
    R = (sides / size[:, None]).T
    spread = np.array([[x, y, z] for x in (-0.5, 0.5) for y in (-0.5, 0.5) for z in (-0.5, 0.5)]) * size
    T = transform(R, corners.mean(axis=0))
    same = np.abs(spread @ R.T + T[:3, 3] - corners).max() < 1e-9
    return (size, T) if same and np.linalg.det(R) > 0 and np.abs(R.T @ R - np.eye(3)).max() < 1e-9 else None
