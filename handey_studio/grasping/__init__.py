"""§5: grasp classes and approach groups, legal rotations, the ways in and out of the grasp plane, stable grips, regrasping."""

from handey_studio.grasping.bump_lines import BumpLines, BumpOptions, bump_lines, plan_approach
from handey_studio.grasping.bump_run import BumpIterations, BumpRun
from handey_studio.grasping.classes import (
    GraspClass,
    GraspOptions,
    contact_area,
    contact_areas,
    grasp_classes,
    hand_in_plane,
)
from handey_studio.grasping.free_patches import Patch, PatchOptions, Wanted, free_patches
from handey_studio.grasping.grasp_motion import MotionOptions, plan_grasp_motion, plan_removal, plan_retreat
from handey_studio.grasping.grasp_placement_table import GraspPlacementTable, TableOptions, grasp_placement_table, legal_at, tilts_at
from handey_studio.grasping.grasp_plane import GraspPlane, fill_grasp_plane
from handey_studio.grasping.groups import GraspGroup, grasp_groups
from handey_studio.grasping.hand_outline import hand_outline, outline_with
from handey_studio.grasping.placements import Placement, PlacementOptions, stable_placements
from handey_studio.grasping.plane_outlines import PlaneOutline, plane_outlines
from handey_studio.grasping.plane_search import SearchOptions, plane_space
from handey_studio.grasping.ranking import RankTerms, rank_terms
from handey_studio.grasping.reach import reached_at, within_reach
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
from handey_studio.grasping.stability import Grip, GripOptions, PadWrenches, gravity_in_hand, grip_margin, pad_wrenches
from handey_studio.grasping.standing import topples_by

__all__ = [
    "GOAL",
    "HAND_MARGIN_M",
    "START",
    "BumpIterations",
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
    "Grip",
    "GripOptions",
    "LegalRotations",
    "MotionOptions",
    "PadWrenches",
    "Patch",
    "PatchOptions",
    "Placement",
    "PlacementOptions",
    "PlaneOutline",
    "RankTerms",
    "RegraspSequence",
    "RotationFault",
    "SearchOptions",
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
    "gravity_in_hand",
    "grip_margin",
    "hand_in_plane",
    "hand_outline",
    "legal_at",
    "legal_rotations",
    "outline_with",
    "pad_wrenches",
    "plan_approach",
    "plan_grasp_motion",
    "plan_removal",
    "plan_retreat",
    "plane_outlines",
    "plane_space",
    "rank_terms",
    "reached_at",
    "sequences",
    "stable_placements",
    "tilt",
    "tilts_at",
    "topples_by",
    "why_none",
    "within_reach",
]
