"""The edges that a pose predicts: found, missing where they should be seen, or hidden (Handey 1987 §3)."""

import numpy as np
from numba import njit

from handey_studio.localization.edges import CONVEX
from handey_studio.localization.evidence import KIND, U, V, Z, in_image, nearest_edge, pixels_per_metre
from handey_studio.localization.posed import GRAZING, HIDDEN, ON, THROUGH, facing, placed, reading_at, turned
from handey_studio.localization.samples import ALONG, INTO_LEFT, INTO_RIGHT, LEFT, RIGHT
from handey_studio.sensing.drawing import project


@njit(cache=True, error_model="numpy", inline="always")
def vector(directions, e, which):
    """One of the directions of edge number e."""
    return directions[e, which, 0], directions[e, which, 1], directions[e, which, 2]


@njit(cache=True, error_model="numpy")
def edge_state(x, y, z, directions, e, concave, depth, nearest, edges, camera, pixel, limits):
    """One edge sample at a place, of edge number e with `directions` (e, 5, 3) there: 1 found, 2 no edge pixel but the surface ends
    there, 0 visible but missing, −1 not to be seen. Then the edge pixel that was found, or −1, how far [m] it lies inwards, and
    whether the faces left and right of the edge look at the sensor."""
    nx, ny, nz = vector(directions, e, LEFT)
    left = facing(nx, ny, nz, x, y, z, camera) >= GRAZING
    nx, ny, nz = vector(directions, e, RIGHT)
    right = facing(nx, ny, nz, x, y, z, camera) >= GRAZING
    inset, in_sight = limits.edge + pixel, False
    for side in range(INTO_LEFT if left else INTO_RIGHT, INTO_RIGHT + 1 if right else INTO_RIGHT):
        ix, iy, iz = vector(directions, e, side)
        seen, _ = reading_at(x + inset * ix, y + inset * iy, z + inset * iz, depth, camera, limits)
        in_sight = in_sight or seen in (ON, THROUGH)
    if not in_sight:
        return -1, -1, 0.0, left, right
    ax, ay, az = vector(directions, e, ALONG)
    du, dv = in_image(x, y, z, ax, ay, az, camera)
    k, sideways = nearest_edge(x, y, z, du, dv, nearest, edges, camera)
    close = k >= 0 and sideways <= limits.edge + 0.7 * pixel and abs(edges[k, Z] - z) <= limits.edge_depth
    ix, iy, iz = vector(directions, e, INTO_LEFT if left else INTO_RIGHT)
    off = inwards(x, y, z, du, dv, ix, iy, iz, edges[k, U], edges[k, V], camera) if close else 0.0
    if left and right:
        return (1, k, off, left, right) if close else (0, -1, 0.0, left, right)
    # a silhouette: sensors lose readings there, they do not add any, and a surface that bends away in sight is none
    if close and edges[k, KIND] != CONVEX and off >= -limits.outside - 0.7 * pixel:
        return 1, k, off, left, right
    beyond = limits.outside + pixel
    seen, _ = reading_at(x - beyond * ix, y - beyond * iy, z - beyond * iz, depth, camera, limits)
    if seen == HIDDEN:
        return (2 if concave else -1), -1, 0.0, left, right  # at a concave edge the part's own wall rises
    return (0 if seen == ON else 2), -1, 0.0, left, right


@njit(cache=True, error_model="numpy")
def inwards(x, y, z, du, dv, ix, iy, iz, u_pixel, v_pixel, camera):
    """How far [m] an edge pixel lies from an edge sample across the edge, (du, dv) in the image, positive towards the face that is
    seen, into which (ix, iy, iz) points."""
    u, v = project(x, y, z, camera)
    iu, iv = in_image(x, y, z, ix, iy, iz, camera)
    side = 1.0 if dv * iu - du * iv > 0 else -1.0
    off = (u_pixel - u) * dv - (v_pixel - v) * du
    return side * off / (np.sqrt(du * du + dv * dv) * pixels_per_metre(z, camera) + 1e-12)


@njit(cache=True, error_model="numpy")
def edge_states(R, t, samples, evidence, limits):
    """What `edge_state` says of each edge sample at a pose (n,)."""
    states, posed = np.empty(len(samples.edge), dtype=np.int64), turned(R, samples.directions)
    depth, nearest, edges, camera, pixel = evidence
    for k in range(len(states)):
        e = samples.edge[k]
        x, y, z = placed(R, t, samples.edge_point, k)
        states[k] = edge_state(x, y, z, posed, e, samples.concave[e], depth, nearest, edges, camera, pixel, limits)[0]
    return states
