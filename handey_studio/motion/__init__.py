"""Arm motion (Handey 1987 §4): slice configuration space, the three-leg path, its certificate, timing."""

from handey_studio.motion.certificate import MARGIN_M, certify
from handey_studio.motion.path import plan_path
from handey_studio.motion.query import PathOptions
from handey_studio.motion.reach import plan_reach
from handey_studio.motion.results import Certificate, CSpaceSummary, Leg, PathResult, Trajectory
from handey_studio.motion.straight import straight_path
from handey_studio.motion.timing import time_path
from handey_studio.motion.warm_up import warm_up

__all__ = [
    "MARGIN_M",
    "CSpaceSummary",
    "Certificate",
    "Leg",
    "PathOptions",
    "PathResult",
    "Trajectory",
    "certify",
    "plan_path",
    "plan_reach",
    "straight_path",
    "time_path",
    "warm_up",
]
