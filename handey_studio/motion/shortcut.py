"""Shorter paths: straight ways across, and turns that a joint need not make, each proved before it is taken.

After Geraerts & Overmars 2007: from place to place on the path all joints go straight, or one joint does while the others keep to the path.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from handey_studio.motion.certificate import Mover

LEAST_GAIN = 1e-3  # shares of the path's length below this are not worth a proof
HALVINGS = 4


@dataclass(frozen=True, eq=False)
class Route:
    """Points (n, joints) [rad] and the mover that proves each segment between them."""

    points: NDArray
    movers: tuple[Mover, ...]

    @property
    def places(self) -> NDArray:
        """How far along the path (n,) [rad] each point is."""
        return np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(self.points, axis=0), axis=1))])

    @property
    def length(self) -> float:
        return float(self.places[-1])


def shorten(route: Route, common: Mover, tries: int, rng: np.random.Generator) -> Route:
    """A route shortened by up to `tries` proofs of random short cuts, corners cut before and after.

    A short cut is proved by the mover that all the segments it replaces share, else by `common`, which allows nothing that one of them
    forbids.
    """
    route = cut_corners(route, common)
    joints = route.points.shape[1]
    for number in range(tries):
        if len(route.movers) == 1:
            break
        a, b = np.sort(rng.uniform(0.0, route.length, 2))
        route = _straight(route, common, a, b) if number % 2 else _one_joint(route, common, a, b, int(rng.integers(joints)))
    return tighten(cut_corners(route, common), common)


def cut_corners(route: Route, common: Mover) -> Route:
    """From each point straight to the farthest one that is reached so, looked for by halving the reach."""
    points, movers, start = list(route.points), list(route.movers), 0
    while start < len(points) - 2:
        reach = len(points) - 1 - start
        while reach > 1:
            mover = _speaker(movers[start : start + reach], common)
            if mover.moves(points[start], points[start + reach]):
                points[start + 1 : start + reach], movers[start : start + reach] = [], [mover]
                break
            reach = reach // 2 if reach > 2 else 1
        start += 1
    return Route(np.array(points), tuple(movers))


def tighten(route: Route, common: Mover) -> Route:
    """Each corner pulled towards the straight line between its neighbours as far as halving the pull proves it."""
    points, movers = np.array(route.points), route.movers
    for k in range(1, len(points) - 1):
        across, pull = points[k + 1] - points[k - 1], 1.0
        foot = points[k - 1] + across * np.clip((points[k] - points[k - 1]) @ across / (across @ across + 1e-300), 0.0, 1.0)
        for _ in range(HALVINGS):
            moved = points[k] + pull * (foot - points[k])
            if movers[k - 1].moves(points[k - 1], moved) and movers[k].moves(moved, points[k + 1]):
                points[k] = moved
                break
            pull /= 2
    return without_idle_points(Route(points, movers))


def _straight(route: Route, common: Mover, a: float, b: float) -> Route:
    """With a straight way from place a to place b, if that is shorter and proved."""
    cut = _cut(route, a, b)
    if cut is None:
        return route
    head, inner, tail = cut
    gain = inner.length - float(np.linalg.norm(inner.points[-1] - inner.points[0]))
    mover = _speaker(inner.movers, common)
    if gain < LEAST_GAIN * route.length or not mover.moves(inner.points[0], inner.points[-1]):
        return route
    return without_idle_points(_joined(head, Route(inner.points[[0, -1]], (mover,)), tail))


def _one_joint(route: Route, common: Mover, a: float, b: float, joint: int) -> Route:
    """With one joint going straight between places a and b and the others as they do, if that is shorter and proved."""
    cut = _cut(route, a, b)
    if cut is None:
        return route
    head, inner, tail = cut
    points, places = np.array(inner.points), inner.places
    points[:, joint] = np.interp(places, places[[0, -1]], points[[0, -1], joint])
    changed = Route(points, inner.movers)
    if inner.length - changed.length < LEAST_GAIN * route.length:
        return route
    for k, mover in enumerate(inner.movers):
        if not mover.moves(points[k], points[k + 1]):
            return route
    return without_idle_points(_joined(head, changed, tail))


def _cut(route: Route, a: float, b: float) -> tuple[Route, Route, Route] | None:
    """The route before place a, between a and b, and after b; None when no corner is between."""
    places = route.places
    first, last = (int(np.clip(np.searchsorted(places, at, side="right") - 1, 0, len(places) - 2)) for at in (a, b))
    if first == last:
        return None
    here, there = (np.array([np.interp(at, places, column) for column in route.points.T]) for at in (a, b))
    points, movers = route.points, route.movers
    return (
        Route(np.vstack([points[: first + 1], here]), movers[: first + 1]),
        Route(np.vstack([here, points[first + 1 : last + 1], there]), movers[first : last + 1]),
        Route(np.vstack([there, points[last + 1 :]]), movers[last:]),
    )


def _joined(head: Route, inner: Route, tail: Route) -> Route:
    points = np.vstack([head.points[:-1], inner.points, tail.points[1:]])
    return Route(points, head.movers + inner.movers + tail.movers)


def _speaker(movers: list[Mover] | tuple[Mover, ...], common: Mover) -> Mover:
    return movers[0] if all(mover is movers[0] for mover in movers) else common


def without_idle_points(route: Route) -> Route:
    """Without points that lie on the straight line between their neighbours, or on one of them."""
    path, movers = [route.points[0]], []
    for point, mover in zip(route.points[1:], route.movers, strict=True):
        if np.abs(point - path[-1]).max() < 1e-12:
            continue
        if movers and movers[-1] is mover and _between(path[-2], path[-1], point):
            path[-1] = point
            continue
        path.append(point)
        movers.append(mover)
    return Route(np.array(path), tuple(movers))


def _between(a: NDArray, b: NDArray, c: NDArray) -> bool:
    t = float((b - a) @ (c - a) / ((c - a) @ (c - a) + 1e-300))
    return 0.0 < t < 1.0 and float(np.abs(a + t * (c - a) - b).max()) < 1e-9
