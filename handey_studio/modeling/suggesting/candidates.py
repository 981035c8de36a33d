"""Closed solids that an object may be: cuboids, prisms on each face seen, and columns under all faces that look up."""

from collections.abc import Iterator, Sequence

from numpy.typing import NDArray

from handey_studio.modeling.suggesting.clues import UP, Body, Clue
from handey_studio.modeling.suggesting.columns import columns, upright_of
from handey_studio.modeling.suggesting.cuboids import cuboids
from handey_studio.modeling.suggesting.planes import BodyPlane
from handey_studio.modeling.suggesting.prisms import prisms
from handey_studio.modeling.suggesting.shapes import ALONG, Shape

CAP_SHARE = 0.25  # of the largest face's size: smaller ones are no face of a prism
LEAST_UP = 0.2  # sine of a face's tilt from upright


def shapes_of(body: Body, clues: Sequence[Clue], planes: Sequence[BodyPlane], frame: NDArray, short: float) -> Iterator[Shape]:
    """All candidates for an object; `short` [m]: outlines' sides below are the sensor's raggedness."""
    yield from cuboids(clues, planes, frame)
    caps = [clue for clue in clues if clue.kind == "seen"]
    most = max((clue.size for clue in caps), default=0.0)
    for cap in caps:
        if cap.size > CAP_SHARE * most:
            yield from prisms(body, cap, planes, short)
    upward = [cap for cap in caps if cap.normal @ UP > LEAST_UP]
    if upward and (len(upward) > 1 or upward[0].normal @ UP < ALONG):
        yield columns(body, upward, planes, upright_of(frame), short)
