"""Random scenes by seed for measuring localization: parts of the library dropped among bodies that no model describes, as a sensor sees
them, and the truth beside it."""

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from handey_studio.base import BadInput, Value, frozen_array
from handey_studio.base.errors import unknown_name
from handey_studio.cell.bodies import SolidBody, fixed_bodies
from handey_studio.cell.camera import DepthCamera, Seen, SensorFaults, look_exactly, pixels_alone, with_faults
from handey_studio.cell.physics.settling import SettleOptions, settle
from handey_studio.cell.stripes import photograph
from handey_studio.cell.workcell import Workcell
from handey_studio.geometry import Polyhedron, box, prism
from handey_studio.geometry.transforms import transform
from handey_studio.sensing.depth_view import DepthView, Pinhole
from handey_studio.sensing.stripes.range_finder import RangeFinder
from handey_studio.world.library import Library

CAMERA, RANGE_FINDER = SENSORS = ("camera", "range_finder")
ATTEMPTS = 8  # piles that are tried until one comes to rest
MAX_STEPS = 6000  # of physics until a wave of bodies must rest
WAVE = 4  # bodies that fall at a time
GAP_M = 0.002  # around bodies before they fall
SCAN_FOCAL_PX = 1200.0  # the laser's view of the scan area, for judging what it can reach: about a pixel a millimetre


@dataclass(frozen=True)
class SceneOptions:
    """`bodies` are dropped; of them a share in `clutter` (least, most) is unmodelled, with sides of `sides` [m]. They start within a
    disc whose radius is drawn from `spread` [m]: small ones pile up, large ones lie flat. Kinds of parts in `absent` (least, most) number
    stay away. The `sensor` is a "camera" of `size_px` square pixels, `distance` [m] away from the pile, up to `tilt_deg` off the vertical,
    a pixel `pixel` [m] wide on the table; or the light-stripe "range_finder" with its own noise."""

    bodies: int = 20
    clutter: tuple[float, float] = (0.2, 0.4)
    sides: tuple[float, float] = (0.020, 0.070)
    spread: tuple[float, float] = (0.03, 0.17)
    absent: tuple[int, int] = (0, 2)
    sensor: str = CAMERA
    size_px: int = 512
    distance: tuple[float, float] = (0.5, 0.9)
    pixel: tuple[float, float] = (0.0008, 0.0012)
    tilt_deg: float = 40.0
    faults: SensorFaults = field(default_factory=SensorFaults)


@dataclass(frozen=True, eq=False)
class TruePose(Value):
    """Where an instance of a part truly is. `visible_px` pixels see it, the share `visible_fraction` of those that it would fill alone."""

    part: str
    T_world_part: NDArray
    visible_fraction: float
    visible_px: int

    def __post_init__(self) -> None:
        object.__setattr__(self, "T_world_part", frozen_array(self.T_world_part))


@dataclass(frozen=True, eq=False)
class SimulatedScene(Value):
    """What the sensor gives and what is there: the modelled parts in `truth`, the other bodies in `clutter`."""

    seed: int
    view: DepthView
    truth: tuple[TruePose, ...]
    clutter: tuple[SolidBody, ...]


def random_scene(seed: int, library: Library, options: SceneOptions = SceneOptions()) -> SimulatedScene:
    """A pile of the library's parts and unmodelled bodies at rest on the table, seen once; the same for the same seed.

    Raises BadInput when no pile comes to rest.
    """
    if options.sensor not in SENSORS:
        raise unknown_name("sensor", options.sensor, SENSORS)
    rng = np.random.default_rng(seed)
    bodies = next((pile for _ in range(ATTEMPTS) if (pile := _pile(library, rng, options))), ())
    if not bodies:
        raise BadInput(f"no pile of {options.bodies} bodies with seed {seed} comes to rest in {ATTEMPTS} attempts.")
    eye, view = _photographed(bodies, rng, options) if options.sensor == RANGE_FINDER else _seen(bodies, rng, options)
    exact = look_exactly(eye, bodies)
    truth = tuple(_true_pose(eye, exact, number, body) for number, body in enumerate(bodies) if body.name in library.part_files())
    clutter = tuple(body for body in bodies if body.name.startswith("clutter"))
    return SimulatedScene(seed, view, truth, clutter)


def _true_pose(eye: DepthCamera, exact: Seen, number: int, body: SolidBody) -> TruePose:
    visible = int((exact.body == number).sum())
    return TruePose(body.name, body.T_world_body, visible / max(pixels_alone(eye, body), 1), visible)


def _pile(library: Library, rng: np.random.Generator, options: SceneOptions) -> tuple[SolidBody, ...]:
    """The table and bodies at rest on it, dropped from low above in waves, so that they stay where they fall; empty if they keep moving."""
    waiting = _chosen(library, rng, options)
    radius = rng.uniform(*options.spread)
    resting = fixed_bodies(Workcell())
    for first in range(0, len(waiting), WAVE):
        settled = settle([*resting, *_in_the_air(waiting[first : first + WAVE], resting, radius, rng)], SettleOptions(max_steps=MAX_STEPS))
        if not settled.resting:
            return ()
        resting = settled.bodies
    return resting


def _chosen(library: Library, rng: np.random.Generator, options: SceneOptions) -> list[SolidBody]:
    """The bodies of a scene in random order."""
    kinds = sorted(library.part_files())
    away = int(rng.integers(options.absent[0], options.absent[1] + 1))
    present = rng.permutation(kinds)[: max(1, len(kinds) - away)]
    strangers = round(options.bodies * rng.uniform(*options.clutter))
    chosen = [_part_body(library, str(present[k % len(present)])) for k in range(options.bodies - strangers)]
    chosen += [SolidBody(f"clutter{k + 1}", _stranger(rng, options.sides), np.eye(4)) for k in range(strangers)]
    return [chosen[k] for k in rng.permutation(len(chosen))]


def _part_body(library: Library, name: str) -> SolidBody:
    part = library.part(name)
    return SolidBody(name, part.solid, np.eye(4), part.density, part.friction)


def _stranger(rng: np.random.Generator, sides: tuple[float, float]) -> Polyhedron:
    """A cuboid, or a prism over a triangle, a quadrilateral or a pentagon, of random size."""
    if rng.random() < 0.5:
        return box(np.round(rng.uniform(*sides, 3), 4))
    corners = int(rng.integers(3, 6))
    angles = 2 * np.pi * (np.arange(corners) + rng.uniform(-0.25, 0.25, corners)) / corners
    outline = np.stack([np.cos(angles), np.sin(angles)], axis=1) * rng.uniform(sides[0], 0.7 * sides[1])
    return prism(np.round(outline, 4), float(np.round(rng.uniform(*sides), 4)))


def _in_the_air(bodies: Sequence[SolidBody], below: Sequence[SolidBody], radius: float, rng: np.random.Generator) -> list[SolidBody]:
    """The bodies in random attitudes at random places of a disc, each as low as spheres around all others allow."""
    spheres = [_sphere(body) for body in below if not body.fixed]
    placed = []
    for body in bodies:
        angle, share = rng.uniform(0, 2 * np.pi), np.sqrt(rng.random())
        attitude = body.at(transform(Rotation.random(rng=rng).as_matrix()))
        middle, reach = _sphere(attitude)
        place = np.array([np.cos(angle) * radius * share, np.sin(angle) * radius * share, reach])
        for centre, other in sorted(spheres, key=lambda sphere: float(sphere[0][2])):
            apart = float(np.linalg.norm(place[:2] - centre[:2]))
            lift = np.sqrt(max((reach + other) ** 2 - apart**2, 0.0))
            if abs(place[2] - centre[2]) < lift:
                place[2] = centre[2] + lift
        spheres.append((place, reach))
        placed.append(attitude.at(transform(None, place - middle) @ attitude.T_world_body))
    return placed


def _sphere(body: SolidBody) -> tuple[NDArray, float]:
    """A ball (centre (3,), radius) [m] of the world that holds the body with some room."""
    corners = body.corners_world
    middle = (corners.min(axis=0) + corners.max(axis=0)) / 2
    return middle, float(np.linalg.norm(corners - middle, axis=1).max()) + GAP_M


def _seen(bodies: Sequence[SolidBody], rng: np.random.Generator, options: SceneOptions) -> tuple[DepthCamera, DepthView]:
    """A camera that looks at the pile's middle from a random direction, and what it gives."""
    middle = np.mean([body.corners_world.mean(axis=0) for body in bodies if not body.fixed], axis=0)
    distance = rng.uniform(*options.distance)
    focal = distance / rng.uniform(*options.pixel)
    tilt, around, roll = np.deg2rad(rng.uniform(0.0, options.tilt_deg)), rng.uniform(0, 2 * np.pi), rng.uniform(0, 2 * np.pi)
    down = transform(Rotation.from_euler("ZYZ", (around, np.pi - tilt, roll)).as_matrix())
    T = transform(None, middle) @ down @ transform(None, (0.0, 0.0, -distance))
    half = (options.size_px - 1) / 2
    camera = DepthCamera(Pinhole(focal, focal, half, half), (options.size_px, options.size_px), T)
    depth = with_faults(look_exactly(camera, bodies), options.faults, rng)
    noise = max(options.faults.noise_m, options.faults.step_m / np.sqrt(12.0))
    return camera, DepthView(depth, camera.projection, T, noise, distance / focal)


def _photographed(bodies: Sequence[SolidBody], rng: np.random.Generator, options: SceneOptions) -> tuple[DepthCamera, DepthView]:
    """The range finder's depth map from above, and its laser as an eye that tells what it can reach."""
    finder = RangeFinder(T_world_range=transform(None, (-RangeFinder().area[0] / 2, -RangeFinder().area[1] / 2, 0.0)))
    depth_map = photograph(finder, bodies, rng)
    T_range_laser = transform(np.diag([1.0, -1.0, -1.0]), finder.laser)
    x, y = (int(np.ceil(side / finder.laser[2] * SCAN_FOCAL_PX)) for side in finder.area)
    laser = DepthCamera(Pinhole(SCAN_FOCAL_PX, SCAN_FOCAL_PX, (x - 1) / 2, (y - 1) / 2), (y, x), finder.T_world_range @ T_range_laser)
    return laser, depth_map.view()
