"""What of the Grasp tab is looked at."""

from dataclasses import dataclass

from handey_studio.world import Part


@dataclass(frozen=True)
class GraspLook:
    """`obstacles` says whose filled cells the grasp plane shows. Of `part`: the number of a grasp class, and of its grasp–placement table a
    row (a placement, or an end of the MOVE) and a column; None for none."""

    obstacles: str = "pickup"
    part: Part | None = None
    grasp_class: int | None = None
    row: int | None = None
    column: int | None = None
