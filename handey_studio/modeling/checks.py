"""What a part must be: closed, flat-faced, without crossings, nowhere too thin to see or to grip; each broken face is pointed at."""

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from handey_studio.base import measured
from handey_studio.geometry import Face, Polyhedron
from handey_studio.geometry.meshes import WELD_M
from handey_studio.geometry.soundness import crossings, unmatched_sides
from handey_studio.modeling.truth_values import Check
from handey_studio.world.model_files import MAX_SIZE_M, MIN_SIZE_M

FLAT_M = 1e-4  # a face may be bent by a tenth of a millimetre: what no sensor of ours can tell
THIN_M = 1e-3  # walls thinner than a millimetre are neither seen as two sides nor gripped
SHORT_M = 5e-4  # an edge, or a face's width
OPPOSITE = -0.9  # cosine between the normals of a wall's two sides
NO_AREA_M2 = 1e-12
SPOTS = 250  # at which walls are measured


def solid_checks(solid: Polyhedron, density: float = 700.0) -> tuple[Check, ...]:
    """All checks of a solid, in the order in which they make sense; what rests on one that failed is left out. `density` [kg/m³]."""
    checks = [_closed(solid), _planar(solid), _simple(solid)]
    if not all(check.ok for check in checks):
        return tuple(checks)
    return (*checks, _one_body(solid), _no_crossing(solid), _not_thin(solid), _no_sliver(solid), *_measures(solid, density))


def _closed(solid: Polyhedron) -> Check:
    sides = np.array([side for face in solid.faces for loop in face.loops for side in zip(loop, loop[1:] + loop[:1], strict=True)])
    wrong = np.concatenate(unmatched_sides(sides.reshape(-1, 2)))
    if not len(wrong):
        return Check("closed", True, f"The surface is closed: {len(solid.faces)} faces, {len(sides) // 2} edges.")
    named = {tuple(sorted(side)) for side in wrong.tolist()}
    pairs = [tuple(sorted(side)) for side in sides.tolist()]
    owners = np.repeat(np.arange(len(solid.faces)), [sum(len(loop) for loop in face.loops) for face in solid.faces])
    faces = tuple(sorted({int(f) for f, pair in zip(owners, pairs, strict=True) if pair in named}))
    sentence = f"The surface is open along {len(named)} sides, of {_faces(faces)}."
    fix = "Close it: extrude or mirror the faces there, or take the suggestion again."
    return Check("closed", False, sentence, fix, faces, solid.vertices[wrong].mean(axis=1))


def _planar(solid: Polyhedron) -> Check:
    off = [_bend(solid.vertices[[c for loop in face.loops for c in loop]]) for face in solid.faces]
    bent = tuple(f for f, (most, _) in enumerate(off) if most > FLAT_M)
    worst = max(range(len(off)), key=lambda f: off[f][0])
    if not bent:
        return Check("planar", True, f"All faces are planar within {measured(max(off[worst][0], 1e-5), 'm')}.")
    sentence = f"Face {worst} is bent by {measured(off[worst][0], 'm')}, the limit is {measured(FLAT_M, 'm')} ({_faces(bent)} bent in all)."
    fix = "Move the corner shown back into the plane of the others, or undo the step that moved it."
    return Check("planar", False, sentence, fix, bent, np.array([off[f][1] for f in bent]))


def _bend(corners: NDArray) -> tuple[float, NDArray]:
    """How far [m] the corner (3,) that is farthest off the best plane lies off it."""
    middle = corners.mean(axis=0)
    distances = np.abs((corners - middle) @ np.linalg.svd(corners - middle)[2][2])
    return float(distances.max()), corners[int(np.argmax(distances))]


def _simple(solid: Polyhedron) -> Check:
    """Each face's own outline."""
    wrong = tuple(f for f, face in enumerate(solid.faces) if not _is_simple(solid, face))
    if not wrong:
        return Check("outlines", True, "No face's outline crosses itself.")
    sentence = f"The outline of {_faces(wrong)} crosses or touches itself, or has no area."
    where = np.array([solid.vertices[list(solid.faces[f].outer)].mean(axis=0) for f in wrong])
    return Check("outlines", False, sentence, "Move its corners apart, or undo the step that moved them.", wrong, where)


def _is_simple(solid: Polyhedron, face: Face) -> bool:
    corners = solid.vertices[list(face.outer)]
    area = np.linalg.norm(np.cross(corners, np.roll(corners, -1, axis=0)).sum(axis=0)) / 2.0
    if area < NO_AREA_M2 or np.linalg.norm(corners - np.roll(corners, -1, axis=0), axis=1).min() < WELD_M:
        return False
    alone = Polyhedron(solid.vertices, (face,))
    return bool(alone.face_polygon(0, alone.face_frame(0)).is_valid)


def _one_body(solid: Polyhedron) -> Check:
    pairs = np.array([(edge.left, edge.right) for edge in solid.edges])
    count, body = connected_components(coo_array((np.ones(len(pairs)), tuple(pairs.T)), shape=(len(solid.faces),) * 2), directed=False)
    if count == 1:
        return Check("one body", True, "It is one body without hollows.")
    smallest = int(np.argmin(np.bincount(body)))
    faces = tuple(np.nonzero(body == smallest)[0].tolist())
    where = np.array([solid.vertices[list(solid.faces[f].outer)].mean(axis=0) for f in faces])
    sentence = f"It falls into {count} surfaces that do not touch: separate bodies, or a hollow inside."
    return Check("one body", False, sentence, "Join them, or delete the one shown.", faces, where)


def _no_crossing(solid: Polyhedron) -> Check:
    where, triangles, _ = crossings(solid.vertices, solid.triangles)
    if not len(where):
        return Check("crossing", True, "The surface does not pass through itself.")
    faces = tuple(np.unique(solid.face_of_triangle[triangles]).tolist())
    sentence = f"The surface passes through itself at {len(where)} places, at {_faces(faces)}."
    return Check("crossing", False, sentence, "Move the faces apart, or join the bodies anew.", faces, where)


def _not_thin(solid: Polyhedron) -> Check:
    """How far it is from spots on each face straight in to the wall opposite."""
    corners = solid.vertices[solid.triangles]
    spots, faces = _spots(solid)
    inward = -solid.normals[faces]
    wall = solid.normals @ solid.normals.T < OPPOSITE
    for edge in solid.edges:  # a wedge gets thin towards its edge: that is no wall
        wall[edge.left, edge.right] = wall[edge.right, edge.left] = False
    thickness = np.where(wall[faces][:, solid.face_of_triangle], _ray_lengths(spots, inward, corners), np.inf)
    thinnest = thickness.min(axis=1)
    thin = thinnest < THIN_M
    if not thin.any():
        least = float(thinnest.min())
        walls = f"; the thinnest wall is {measured(least, 'm')}" if np.isfinite(least) else ""
        return Check("thin", True, f"No wall is thinner than {measured(THIN_M, 'm')}{walls}.")
    across = solid.face_of_triangle[np.argmin(thickness[thin], axis=1)]
    broken = tuple(np.unique(np.r_[faces[thin], across]).tolist())
    sentence = f"A wall is {measured(float(thinnest.min()), 'm')} thin, the limit is {measured(THIN_M, 'm')}, between {_faces(broken)}."
    return Check("thin", False, sentence, "Move one of these faces outward, or cut the wall away.", broken, spots[thin])


def _spots(solid: Polyhedron) -> tuple[NDArray, NDArray]:
    """Spots (n, 3) [m] inside the triangles, more in the larger, and the face of each (n,)."""
    corners = solid.vertices[solid.triangles]
    area = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
    counts = 1 + np.floor(SPOTS * area / area.sum()).astype(int)
    share = np.random.default_rng(0).dirichlet((1.5, 1.5, 1.5), int(counts.sum()))
    triangle = np.repeat(np.arange(len(corners)), counts)
    return np.einsum("nk,nkx->nx", share, corners[triangle]), solid.face_of_triangle[triangle]


def _ray_lengths(starts: NDArray, directions: NDArray, corners: NDArray) -> NDArray:
    """How far (n, m) [m] rays (n, 3) go until they leave through triangles (m, 3, 3); infinite where they do not."""
    along, across = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    facing = directions @ np.cross(along, across).T
    to_start = starts[:, None] - corners[None, :, 0]
    turned = np.cross(to_start, directions[:, None])
    with np.errstate(divide="ignore", invalid="ignore"):
        s, t = -(across * turned).sum(axis=2) / facing, (along * turned).sum(axis=2) / facing
        length = -(np.cross(along, across) * to_start).sum(axis=2) / facing
        leaves = (facing > 0) & (s >= 0) & (t >= 0) & (s + t <= 1) & (length > 0)
    return np.where(leaves, length, np.inf)


def _no_sliver(solid: Polyhedron) -> Check:
    ends = solid.vertices[[[edge.start, edge.end] for edge in solid.edges]]
    lengths = np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1)
    polygons = [solid.face_polygon(f, solid.face_frame(f)) for f in range(len(solid.faces))]
    narrow = [f for f, polygon in enumerate(polygons) if 2.0 * polygon.area / polygon.length < SHORT_M]
    short = np.nonzero(lengths < SHORT_M)[0]
    if not narrow and not len(short):
        return Check("sliver", True, f"No edge is shorter than {measured(float(lengths.min()), 'm')}.")
    faces = tuple(sorted({*narrow, *(f for e in short for f in (solid.edges[e].left, solid.edges[e].right))}))
    least = f"an edge is {measured(float(lengths.min()), 'm')} long" if len(short) else f"face {narrow[0]} is a sliver"
    sentence = f"Something is too small to mean anything: {least}, the limit is {measured(SHORT_M, 'm')}, at {_faces(faces)}."
    where = np.array([*ends[short].mean(axis=1), *(solid.vertices[list(solid.faces[f].outer)].mean(axis=0) for f in narrow)])
    return Check("sliver", False, sentence, "Move the faces beside it until they meet, or undo the step that made it.", faces, where)


def _measures(solid: Polyhedron, density: float) -> tuple[Check, ...]:
    volume, centre = solid.volume_and_centroid
    size = np.ptp(solid.vertices, axis=0)
    fits = MIN_SIZE_M <= solid.diameter <= MAX_SIZE_M
    sides = " × ".join(f"{1e3 * side:.1f}" for side in size)
    at = ", ".join(f"{x:.1f}" for x in np.round(1e3 * centre, 1) + 0.0)
    range_fix = "" if fits else f"Parts are {MIN_SIZE_M:g} to {MAX_SIZE_M:g} m across; check the unit."
    return (
        Check("size", fits, f"It is {sides} mm large.", range_fix),
        Check("volume", volume > 0, f"Its volume is {1e6 * volume:.1f} cm³.", "" if volume > 0 else "Its faces look inward; turn them."),
        Check("mass", volume > 0, f"Its mass is {1e3 * density * volume:.0f} g at {density:g} kg/m³.", where=centre),
        Check("centre of mass", True, f"Its centre of mass is at {at} mm.", where=centre),
    )


def _faces(faces: tuple[int, ...]) -> str:
    """'face 3', 'faces 1, 2 and 5'."""
    numbers = [str(f) for f in faces]
    if len(numbers) < 2:
        return f"face {''.join(numbers)}"
    return f"faces {', '.join(numbers[:-1][:8])}{' …' if len(numbers) > 9 else ''} and {numbers[-1]}"
