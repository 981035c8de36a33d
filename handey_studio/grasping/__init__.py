"""§5: grasp classes and approach groups, legal rotations, and the bump-line approach in the grasp plane."""

from handey_studio.grasping.bump_lines import BumpLines, BumpOptions, BumpRun, bump_lines, plan_approach
from handey_studio.grasping.classes import (
    GraspClass,
    GraspOptions,
    contact_area,
    contact_areas,
    grasp_classes,
    hand_in_plane,
    opening_around,
)
from handey_studio.grasping.free_patches import Patch, PatchOptions, Wanted, free_patches
from handey_studio.grasping.grasp_placement_table import GraspPlacementTable, TableOptions, grasp_placement_table, legal_at, tilts_at
from handey_studio.grasping.grasp_plane import GraspPlane, fill_grasp_plane
from handey_studio.grasping.groups import GraspGroup, grasp_groups
from handey_studio.grasping.placements import Placement, PlacementOptions, stable_placements
from handey_studio.grasping.regrasps import GOAL, START, RegraspSequence, SequenceCosts, Transfer, sequences, why_none
from handey_studio.grasping.rotations import (
    HAND_MARGIN_M,
    ForbiddenRange,
    GraspEnd,
    LegalRotations,
    RotationFault,
    angle_range,
    legal_rotations,
    tilt,
)

__all__ = [
    "GOAL",
    "HAND_MARGIN_M",
    "START",
    "BumpLines",
    "BumpOptions",
    "BumpRun",
    "ForbiddenRange",
    "GraspClass",
    "GraspEnd",
    "GraspGroup",
    "GraspOptions",
    "GraspPlacementTable",
    "GraspPlane",
    "LegalRotations",
    "Patch",
    "PatchOptions",
    "Placement",
    "PlacementOptions",
    "RegraspSequence",
    "RotationFault",
    "SequenceCosts",
    "TableOptions",
    "Transfer",
    "Wanted",
    "angle_range",
    "bump_lines",
    "contact_area",
    "contact_areas",
    "fill_grasp_plane",
    "free_patches",
    "grasp_classes",
    "grasp_groups",
    "grasp_placement_table",
    "hand_in_plane",
    "legal_at",
    "legal_rotations",
    "opening_around",
    "plan_approach",
    "sequences",
    "stable_placements",
    "tilt",
    "tilts_at",
    "why_none",
]
