"""Photographs as the range finder's cameras would take them: a stripe of laser light on true bodies, under a room's light.

Each pixel is an average over rays to the first surface; a ray's light is the room's plus the laser's, if the laser reaches that
point: a Gaussian across the plane of light, times the cosine at which it falls, times how white the surface is. Then come the
lens's blur, the sensor's noise, the end of the scale and whole numbers. Light that goes from surface to surface is left out.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from handey_studio.base import BadInput
from handey_studio.cell.bodies import SolidBody
from handey_studio.cell.stripes import LIT_M, Surfaces
from handey_studio.sensing.stripes.laser_planes import distances
from handey_studio.sensing.stripes.stripe_camera import StripeCamera

LASERS = {"red": (0.03, 0.06, 1.0), "green": (0.08, 1.0, 0.10), "grey": (1.0, 1.0, 1.0)}  # what each channel sees: blue, green, red
ROOM = (0.85, 1.0, 0.95)
BRIGHTNESSES = (0.55, 0.4, 0.618034)  # least, span, and the step by which bodies get theirs: no two neighbours alike
EDGE_LIGHT = 1.0  # of 255, between neighbours, that asks for more rays
GOLDEN = 0.618034
STRIPE_SIGMAS = 4.5  # beyond so many, the stripe's light is under a thousandth of a grey level

Paint = Callable[[NDArray, NDArray], NDArray]  # how white (n,) the surface is, from faces (n,) and points (n, 3) of the range frame


@dataclass(frozen=True)
class Exposure:
    """Light on a scale of 255: `room` on a white surface seen squarely, `laser` in the stripe's middle on one lit squarely.

    `line_sigma` [m] is the stripe's half width (one sigma), `blur_px` the lens's, `noise` the sensor's standard deviation. Each pixel
    averages `samples`² rays.
    """

    room: float = 35.0
    laser: float = 170.0
    line_sigma: float = 0.0005
    blur_px: float = 0.8
    noise: float = 1.5
    colour: str = "red"
    samples: int = 3

    def __post_init__(self) -> None:
        if self.colour not in LASERS:
            raise BadInput(f'laser colour "{self.colour}" is not known; choose one of: {", ".join(LASERS)}.')


@dataclass(frozen=True, eq=False)
class Seen:
    """What a camera sees: for each ray (n,) its pixel, its point (n, 3) [m], the cosine there, and how white the surface is."""

    shape: tuple[int, int]
    pixel: NDArray
    points: NDArray
    cosine: NDArray
    white: NDArray
    samples: int


def body_paint(bodies: Sequence[SolidBody]) -> Paint:
    """A whiteness of its own for each body, in the order in which `Surfaces` counts their faces."""
    least, span, step = BRIGHTNESSES
    of_face = np.repeat(least + span * ((step * np.arange(len(bodies))) % 1.0), [len(body.solid.faces) for body in bodies])
    return lambda face, _: of_face[face]


def see(camera: StripeCamera, surfaces: Surfaces, paint: Paint, samples: int, pixels: NDArray | None = None) -> Seen:
    """The first surfaces along a camera's rays, `samples` × `samples` a pixel: of all pixels, or of those numbered (row by row)."""
    pixels = np.arange(camera.width * camera.height) if pixels is None else pixels
    parts = _spread(samples**2)
    number = np.repeat(pixels, len(parts))
    uv = np.stack([number % camera.width, number // camera.width], axis=1) + np.tile(parts, (len(pixels), 1))
    rays = camera.rays(uv)
    rays = (rays / np.linalg.norm(rays, axis=1, keepdims=True)) @ camera.T_range_camera[:3, :3].T
    hits = surfaces.first(camera.T_range_camera[:3, 3], rays)
    hit = hits.face >= 0
    white = paint(hits.face[hit], hits.points[hit])
    return Seen((camera.height, camera.width), number[hit], hits.points[hit], hits.cosine[hit], white, samples)


def _spread(count: int) -> NDArray:
    """Places (count, 2) in a pixel, in [−½, ½], no two in one row or column: on a square grid an upright edge could only move by jumps."""
    k = np.arange(count)
    return np.stack([(k + 0.5) / count, (0.5 + k * GOLDEN) % 1.0], axis=1) - 0.5


def room_light(seen: Seen, exposure: Exposure) -> NDArray:
    """The room's light (H, W) on what a camera sees."""
    return _gathered(seen, seen.pixel, exposure.room * seen.white * (0.5 + 0.5 * seen.cosine))


def stripe_light(seen: Seen, surfaces: Surfaces, plane: NDArray, laser: NDArray, exposure: Exposure) -> NDArray:
    """The laser's light (H, W): a plane (4,) from a source (3,), where nothing stands between."""
    away = distances(plane, seen.points)
    near = np.flatnonzero(np.abs(away) < STRIPE_SIGMAS * exposure.line_sigma)
    if not len(near):
        return np.zeros(seen.shape)
    beams = seen.points[near] - laser
    first = surfaces.first(laser, beams / np.linalg.norm(beams, axis=1, keepdims=True))
    with np.errstate(invalid="ignore"):
        lit = np.linalg.norm(first.points - seen.points[near], axis=1) < LIT_M
    profile = np.exp(-0.5 * (away[near] / exposure.line_sigma) ** 2)
    light = exposure.laser * seen.white[near] * np.where(lit, np.clip(first.cosine, 0.0, 1.0) * profile, 0.0)
    return _gathered(seen, seen.pixel[near], light)


def look(camera: StripeCamera, surfaces: Surfaces, paint: Paint, exposure: Exposure, plane: NDArray | None = None) -> tuple[NDArray, Seen]:
    """The room's light (H, W) on what a camera sees, and the rays in which a stripe may fall.

    One ray a pixel serves where neighbours look alike; the others, and those by the plane (4,), are looked at with `samples` × `samples`.
    Without a plane all pixels are, so that any stripe may fall.
    """
    once = see(camera, surfaces, paint, 1)
    room = room_light(once, exposure)
    around = np.ones((3, 3), np.uint8)
    fine = cv2.morphologyEx(room, cv2.MORPH_GRADIENT, around) > EDGE_LIGHT
    if plane is not None:
        near = np.abs(distances(plane, once.points)) < 2 * STRIPE_SIGMAS * exposure.line_sigma
        fine.ravel()[once.pixel[near]] = True
        fine = cv2.dilate(fine.astype(np.uint8), around) > 0
    else:
        fine[:] = True
    seen = see(camera, surfaces, paint, exposure.samples, np.flatnonzero(fine))
    return np.where(fine, room_light(seen, exposure), room), seen


def _gathered(seen: Seen, pixel: NDArray, light: NDArray) -> NDArray:
    height, width = seen.shape
    return np.bincount(pixel, weights=light, minlength=height * width).reshape(seen.shape) / seen.samples**2


def develop(room: NDArray, stripe: NDArray | None, exposure: Exposure, rng: np.random.Generator) -> NDArray:
    """The photograph (H, W, 3) uint8, blue, green, red, of a room's light and a stripe's; without a stripe it is a dark frame."""
    light = room[..., None] * np.array(ROOM)
    if stripe is not None:
        light = light + stripe[..., None] * np.array(LASERS[exposure.colour])
    if exposure.blur_px > 0:
        light = cv2.GaussianBlur(light, (0, 0), exposure.blur_px)
    noisy = light + rng.normal(0.0, exposure.noise, light.shape)
    return np.clip(np.round(noisy), 0, 255).astype(np.uint8)
