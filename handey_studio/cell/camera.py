"""A depth camera before true bodies: what each pixel sees, exactly, and then with a real sensor's faults."""

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import distance_transform_edt, gaussian_filter, maximum_filter, minimum_filter

from handey_studio.base import Value, frozen_array
from handey_studio.cell.bodies import SolidBody
from handey_studio.cell.stripes import Surfaces
from handey_studio.geometry.transforms import apply, inverse
from handey_studio.sensing.depth_view import Pinhole

ALONE_MARGIN_PX = 1  # around the corners' box when a body is drawn alone


@dataclass(frozen=True, eq=False)
class DepthCamera(Value):
    """A pinhole of `shape` (height, width) pixels; `T_world_camera` (4, 4) maps its optical frame (z forward) to the world."""

    projection: Pinhole
    shape: tuple[int, int]
    T_world_camera: NDArray

    def __post_init__(self) -> None:
        object.__setattr__(self, "T_world_camera", frozen_array(self.T_world_camera))


@dataclass(frozen=True, eq=False)
class Seen(Value):
    """What every pixel (H, W) sees: `depth` [m] along the optical axis, NaN for nothing; the numbers of the `body` and of the `face`
    (counted through all bodies), -1 for none; `cosine` of the angle between ray and surface normal."""

    depth: NDArray
    body: NDArray
    face: NDArray
    cosine: NDArray

    def __post_init__(self) -> None:
        object.__setattr__(self, "depth", frozen_array(self.depth))
        object.__setattr__(self, "body", frozen_array(self.body, int))
        object.__setattr__(self, "face", frozen_array(self.face, int))
        object.__setattr__(self, "cosine", frozen_array(self.cosine))


@dataclass(frozen=True)
class SensorFaults:
    """What real depth sensors add. `noise_m` is the standard deviation of a reading, `step_m` its rounding. Readings on faces seen at more
    than `grazing_deg` off their normal are lost with the chance `grazing_lost`. Pixels beside a jump of more than `jump_m` are lost with
    the chance `jump_lost` or lie anywhere between the two surfaces with the chance `jump_mixed`. Structured light does worse: the nearer
    surface loses a ragged margin of about `ragged_px` at jumps, noise is shared between readings within `shared_px`, and the whole
    field is warped by `warp_m` (standard deviation) over a tenth of the image."""

    noise_m: float = 0.0005
    step_m: float = 0.0001
    grazing_deg: float = 80.0
    grazing_lost: float = 0.7
    jump_m: float = 0.005
    jump_lost: float = 0.15
    jump_mixed: float = 0.10
    ragged_px: float = 0.0
    shared_px: float = 0.0
    warp_m: float = 0.0


STRUCTURED_LIGHT = SensorFaults(ragged_px=2.2, shared_px=0.7, warp_m=0.0004)


def look_exactly(camera: DepthCamera, bodies: Sequence[SolidBody]) -> Seen:
    """The first surface along each pixel's ray, without noise."""
    height, width = camera.shape
    v, u = np.mgrid[:height, :width]
    return _cast(camera, bodies, u, v)


def pixels_alone(camera: DepthCamera, body: SolidBody) -> int:
    """How many pixels the body would fill alone, were the image large enough to hold it."""
    corners = apply(inverse(camera.T_world_camera), body.corners_world)
    uv = camera.projection.project(corners)
    low = np.floor(uv.min(axis=0)).astype(int) - ALONE_MARGIN_PX
    high = np.ceil(uv.max(axis=0)).astype(int) + ALONE_MARGIN_PX
    v, u = np.mgrid[low[1] : high[1] + 1, low[0] : high[0] + 1]
    return int((_cast(camera, [body], u, v).body >= 0).sum())


def with_faults(seen: Seen, faults: SensorFaults, rng: np.random.Generator) -> NDArray:
    """The depth (H, W) [m] that a sensor would give, NaN where it gives none."""
    depth = np.array(seen.depth)
    near = minimum_filter(np.nan_to_num(depth, nan=np.inf), size=3)
    far = maximum_filter(np.nan_to_num(depth, nan=-np.inf), size=3)
    beside = beside_jumps(seen, faults.jump_m)
    chance, between = rng.random(depth.shape), rng.random(depth.shape)
    mixed = beside & (chance >= faults.jump_lost) & (chance < faults.jump_lost + faults.jump_mixed)
    depth[mixed] = near[mixed] + between[mixed] * (far[mixed] - near[mixed])
    depth += faults.noise_m * _field(depth.shape, faults.shared_px, rng)
    if faults.warp_m > 0:
        depth += faults.warp_m * _field(depth.shape, depth.shape[1] / 10, rng)
    grazing = seen.cosine < np.cos(np.deg2rad(faults.grazing_deg))
    lost = (beside & (chance < faults.jump_lost)) | (grazing & (rng.random(depth.shape) < faults.grazing_lost))
    depth[lost] = np.nan
    if faults.ragged_px > 0:
        depth[_ragged(seen, faults, rng)] = np.nan
    return np.round(depth / faults.step_m) * faults.step_m if faults.step_m > 0 else depth


def _field(shape: tuple[int, ...], sigma_px: float, rng: np.random.Generator) -> NDArray:
    """Random numbers (H, W) of mean 0 and standard deviation 1, shared between pixels within about `sigma_px`."""
    if sigma_px <= 0:
        return rng.normal(0.0, 1.0, shape)
    coarse = max(1, int(sigma_px / 4))  # a wide field needs no number for each pixel
    small = gaussian_filter(rng.normal(0.0, 1.0, [side // coarse + 2 for side in shape]), sigma_px / coarse)
    field = cv2.resize(small, (shape[1], shape[0]), interpolation=cv2.INTER_LINEAR)
    return field / field.std()


def _ragged(seen: Seen, faults: SensorFaults, rng: np.random.Generator) -> NDArray:
    """Pixels (H, W) of the nearer surface that are lost at its jumps, to a depth that changes along the outline."""
    width = faults.ragged_px * np.clip(0.6 + 0.4 * _field(seen.depth.shape, 3.0, rng), 0.0, 2.0)
    depth = np.nan_to_num(seen.depth, nan=np.inf)
    with np.errstate(invalid="ignore"):
        rim = beside_jumps(seen, faults.jump_m) & (maximum_filter(depth, size=3) - depth > faults.jump_m)
    if not rim.any():
        return rim
    distance = np.asarray(distance_transform_edt(~rim))
    near = minimum_filter(np.where(rim, depth, np.inf), size=2 * int(2.0 * faults.ragged_px) + 1)  # the rim's depth around each pixel
    with np.errstate(invalid="ignore"):
        return (distance < width) & (np.abs(depth - near) < 2.0 * faults.jump_m)


def beside_jumps(seen: Seen, jump: float) -> NDArray:
    """Pixels (H, W) with a neighbour in the row or column that sees another face, nearer or farther by more than `jump` [m]."""
    found = np.zeros(seen.depth.shape, dtype=bool)
    for one, other in ((np.s_[:, :-1], np.s_[:, 1:]), (np.s_[:-1], np.s_[1:])):
        with np.errstate(invalid="ignore"):
            jumps = (np.abs(seen.depth[one] - seen.depth[other]) > jump) & (seen.face[one] != seen.face[other])
        found[one] |= jumps
        found[other] |= jumps
    return found


def _cast(camera: DepthCamera, bodies: Sequence[SolidBody], u: NDArray, v: NDArray) -> Seen:
    """What the rays through pixels u, v (H, W) meet first."""
    rays = camera.projection.unproject(np.stack([u, v], axis=-1).reshape(-1, 2).astype(float), np.ones(u.size))
    rays /= np.linalg.norm(rays, axis=1, keepdims=True)
    hits = Surfaces(bodies, inverse(camera.T_world_camera)).first(np.zeros(3), rays)
    owner = np.repeat(np.arange(len(bodies)), [len(body.solid.faces) for body in bodies])
    body = np.where(hits.face >= 0, owner[hits.face], -1)
    return Seen(*(image.reshape(u.shape) for image in (hits.points[:, 2], body, hits.face, hits.cosine)))
