"""From what was picked, suggested or aligned to the references and steps of a history."""

from handey_studio.base import BadInput
from handey_studio.modeling.operations import AlignScan, TakeSuggestion
from handey_studio.modeling.picking.snap import Snap
from handey_studio.modeling.references import CornerAt, EdgeAt, FaceAt, Reference
from handey_studio.modeling.suggesting.suggestion import Alignment, Suggestion


def reference_of(snap: Snap) -> Reference:
    """What a step refers to when a click has snapped: the edge, the face (or a patch's plane), else the point."""
    if snap.kind == "edge":
        return EdgeAt(snap.point, snap.direction)
    if snap.kind == "plane":
        return FaceAt(snap.point, snap.normal)
    return CornerAt(snap.point)


def take(suggestion: Suggestion) -> TakeSuggestion:
    """The step that takes a suggested solid. Raises BadInput with the suggestion's reason when it has none."""
    if suggestion.solid is None:
        raise BadInput(f"there is no solid to take: {suggestion.reason}")
    return TakeSuggestion(suggestion.solid.vertices, tuple(face.loops for face in suggestion.solid.faces), suggestion.sources)


def take_alignment(scan: str, alignment: Alignment, other: int = 0) -> AlignScan:
    """The step that puts the scan of that name where an alignment says: the best pose, or one of the `others` counted from 1.

    Raises BadInput with the alignment's reason when it has none.
    """
    if alignment.T_model_scan is None:
        raise BadInput(f'scan "{scan}" could not be aligned: {alignment.reason}')
    poses = ((alignment.T_model_scan, alignment.rms), *alignment.others)
    if not 0 <= other < len(poses):
        raise BadInput(f'pose {other} of scan "{scan}" is not there; it has {len(poses)}, counted from 0.')
    return AlignScan(scan, *poses[other])
