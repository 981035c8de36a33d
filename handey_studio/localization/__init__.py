"""§3 Locating the object: depth edges, pairs of edges, hypotheses, verified and refined poses."""

from handey_studio.localization.locate import localize
from handey_studio.localization.result import Hypothesis, LocatedPose, LocateOptions, LocateResult, Rival
from handey_studio.localization.segments import DataEdge

__all__ = ["DataEdge", "Hypothesis", "LocateOptions", "LocateResult", "LocatedPose", "Rival", "localize"]
