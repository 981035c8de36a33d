"""The steps that a model is made of, all kinds together. Each is a small value: what a person did, and nothing computed from it.

`replay` runs them. A step's `kind` is its word in a draft's file and on screen.
"""

from handey_studio.modeling.changing_steps import (
    ConfirmFace,
    CutByPlane,
    Delete,
    Mirror,
    MoveCorner,
    MoveEdge,
    MoveFace,
    SetAngle,
    SetDistance,
    SetLength,
)
from handey_studio.modeling.making_steps import AlignScan, Box, Extrude, Sketch, TakeSuggestion
from handey_studio.modeling.operation import Combine, Operation

__all__ = [
    "KINDS",
    "AlignScan",
    "Box",
    "Combine",
    "ConfirmFace",
    "CutByPlane",
    "Delete",
    "Extrude",
    "Mirror",
    "MoveCorner",
    "MoveEdge",
    "MoveFace",
    "Operation",
    "SetAngle",
    "SetDistance",
    "SetLength",
    "Sketch",
    "TakeSuggestion",
]

KINDS: dict[str, type[Operation]] = {
    operation.kind: operation
    for operation in (
        TakeSuggestion,
        AlignScan,
        Box,
        Sketch,
        Extrude,
        CutByPlane,
        MoveFace,
        MoveEdge,
        MoveCorner,
        SetDistance,
        SetLength,
        SetAngle,
        Mirror,
        Delete,
        ConfirmFace,
    )
}
