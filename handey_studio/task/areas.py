"""Places in an area: where exactly the part is put down is one more choice of the search (Handey 1987 §7)."""

from numpy.typing import NDArray

from handey_studio.base import Ledger
from handey_studio.geometry.transforms import inverse
from handey_studio.grasping import PatchOptions, Placement, free_patches, stable_placements
from handey_studio.task.destination import Area, format_pose
from handey_studio.world import PlacedPart, World

AS_IT_STANDS, OTHERWISE = 4, 1  # places that are offered for the placement that the part is in now, and for each other one


def area_poses(world: World, placed: PlacedPart, area: Area, ledger: Ledger) -> list[tuple[str, NDArray]]:
    """(what it is, T_world_part) of free places in an area for an instance, those first in which it stands as it does now.

    How many other places there are, and what speaks against them, is in the ledger.
    """
    placements, _ = stable_placements(placed.part)
    entry = ledger.add("area", f"{placed.name} in x {area.low[0]:g} to {area.high[0]:g} m, y {area.low[1]:g} to {area.high[1]:g} m")
    found, near = [], placed.T_world_part[:2, 3]
    for k, placement in enumerate(sorted(placements, key=lambda placement: -_likeness(placement, placed))):
        options = PatchOptions(count=OTHERWISE if k else AS_IT_STANDS, nearest=0.0, farthest=1.0, area=(*area.low, *area.high))
        patches, entries = free_patches(world.without(placed.name), placed.part, placement.T_plane_part, near=near, options=options)
        ledger.adopt(entries, parent=ledger.add("placements", placement.name, parent=entry))
        found += [(f"{placement.name} at {format_pose(patch.T_world_part)}", patch.T_world_part) for patch in patches]
    if not found:
        ledger.fall(entry, "there is no free place for it in the area")
    return found


def _likeness(placement: Placement, placed: PlacedPart) -> float:
    """How much the same side is up as now: the greatest cosine, over the names that the part's symmetries give its faces."""
    up = inverse(placed.T_world_part)[:3, 2]
    return float((placement.Ts_plane_part[:, 2, :3] @ up).max())
