"""How a part can stand on a plane: the faces of its hull that hold its centre of mass (Handey 1987 §5.3, after Tournassoud et al. 1987)."""

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import ConvexHull

from handey_studio.base import Entry, Ledger, Value, frozen_array
from handey_studio.geometry import Polyhedron
from handey_studio.geometry.transforms import apply, rotation_about, transform
from handey_studio.world import Part

SAME_FACE_RAD = np.deg2rad(0.2)  # triangles of the hull within this angle are one face
ON_FACE_M = 2e-5  # corners this near a face's plane belong to it: far above rounding, below anything that rocks visibly


@dataclass(frozen=True)
class PlacementOptions:
    """A placement must stand a knock: the least angle [rad] that it tips by before it falls, and the least distance [m] of the centre of
    mass, seen from above, to the border of the face that it stands on."""

    least_tip: float = float(np.deg2rad(6.0))
    least_border: float = 0.004


@dataclass(frozen=True, eq=False)
class Placement(Value):
    """One way of standing on a plane, any yaw: the symmetric ones are one.

    `Ts_plane_part` (k, 4, 4) are the poses that look the same under the part's symmetries and name its faces differently, the first one its
    own: plane z = 0, centre of mass above the origin, the least turn from the part's own axes (yaw 0). `corners` (m, 2) [m] of the
    hull's face in the plane, counter-clockwise. `height` [m] of the centre of mass, `border` [m] its projection's distance to the face's
    border, `tip` [rad] the least angle by which it must be tipped to fall over.
    """

    Ts_plane_part: NDArray
    corners: NDArray
    height: float
    border: float
    tip: float

    def __post_init__(self) -> None:
        object.__setattr__(self, "Ts_plane_part", frozen_array(self.Ts_plane_part))
        object.__setattr__(self, "corners", frozen_array(self.corners))

    @property
    def T_plane_part(self) -> NDArray:
        """The pose (4, 4) of the part on the plane, yaw 0."""
        return self.Ts_plane_part[0]

    @property
    def name(self) -> str:
        """Which direction of the part points up, as people say it: `+x up`, or the direction's numbers when it is none of the axes."""
        up = self.T_plane_part[2, :3]
        axis = int(np.argmax(np.abs(up)))
        if abs(up[axis]) > np.cos(np.deg2rad(1.0)):
            return f"{'+' if up[axis] > 0 else '−'}{'xyz'[axis]} up"
        return "(" + ", ".join(f"{number:.2f}" for number in np.round(up, 2) + 0.0) + ") up"


@lru_cache(maxsize=64)
def stable_placements(part: Part, options: PlacementOptions = PlacementOptions()) -> tuple[tuple[Placement, ...], tuple[Entry, ...]]:
    """All ways of standing with that margin, the hardest to tip first, and the ledger of the hull's faces: those that fall say why."""
    ledger, found = Ledger(), []
    downs: list[NDArray] = []
    for down in hull_normals(part.solid):
        twins = part.symmetries[:, :3, :3] @ down
        if any(np.abs(twins - other).max(axis=1).min() < SAME_FACE_RAD for other in downs):
            continue
        downs.append(down)
        placement = _placement(part, down, twins)
        entry = ledger.add("placement", placement.name)
        if placement.border <= 0:
            ledger.fall(entry, "it topples: the centre of mass is not above the face", value=placement.border, limit=0.0, unit="m")
        elif placement.border < options.least_border:
            ledger.fall(entry, "the centre of mass is too near the face's border", value=placement.border,
                        limit=options.least_border, unit="m")  # fmt: skip
        elif placement.tip < options.least_tip:
            ledger.fall(entry, "a small knock tips it over", value=placement.tip, limit=options.least_tip, unit="rad")
        else:
            found.append(placement)
    return tuple(sorted(found, key=lambda placement: -placement.tip)), ledger.entries


def hull_normals(solid: Polyhedron) -> NDArray:
    """Outward unit normals (m, 3) of the faces of a solid's convex hull, the largest face first."""
    hull = ConvexHull(solid.vertices)
    a, b, c = (hull.points[hull.simplices[:, k]] for k in range(3))
    areas = np.linalg.norm(np.cross(b - a, c - a), axis=1)
    normals: list[NDArray] = []
    shares: list[float] = []
    for k in np.argsort(-areas, kind="stable"):
        near = [i for i, normal in enumerate(normals) if np.linalg.norm(hull.equations[k, :3] - normal) < SAME_FACE_RAD]
        if near:
            shares[near[0]] += areas[k]
        else:
            normals.append(hull.equations[k, :3])
            shares.append(areas[k])
    return np.array(normals)[np.argsort(-np.array(shares), kind="stable")]


def _placement(part: Part, down: NDArray, twins: NDArray) -> Placement:
    centre = part.solid.volume_and_centroid[1]
    T_plane_part = _standing(part, down)
    local = apply(T_plane_part, part.solid.vertices)
    touching = local[local[:, 2] < ON_FACE_M][:, :2]
    corners = touching[ConvexHull(touching).vertices]
    sides = np.roll(corners, -1, axis=0) - corners
    border = float(((-corners[:, 1] * sides[:, 0] + corners[:, 0] * sides[:, 1]) / np.linalg.norm(sides, axis=1)).min())
    height = float(apply(T_plane_part, centre)[2])
    others: list[NDArray] = []
    for twin in twins:
        if all(np.abs(twin - other).max() > SAME_FACE_RAD for other in [down, *others]):
            others.append(twin)
    poses = np.array([T_plane_part, *(_standing(part, twin) for twin in others)])
    return Placement(poses, corners, height, border, float(np.arctan2(border, height)))


def _standing(part: Part, down: NDArray) -> NDArray:
    """T_plane_part (4, 4) with a direction of the part straight down by the least turn, on z = 0, the centre of mass above the origin."""
    axis = np.cross(down, (0.0, 0.0, -1.0))
    sine = float(np.linalg.norm(axis))
    R = rotation_about(axis if sine > 1e-9 else (1.0, 0.0, 0.0), float(np.arctan2(sine, -down[2])))
    turned = part.solid.vertices @ R.T
    x, y, _ = R @ part.solid.volume_and_centroid[1]
    return frozen_array(transform(R, (-x, -y, -turned[:, 2].min())))
