"""What the planner believes: parts, robots, the hand, the world; and the living arm model."""

from handey_studio.world.arm import Arm, arm_of, hand_hulls
from handey_studio.world.library import Library
from handey_studio.world.link_body import LinkBody
from handey_studio.world.model_files import read_part, write_obj
from handey_studio.world.part import Held, Mate, Part, PlacedPart, Provenance
from handey_studio.world.robot import FINGERS, Hand, Robot
from handey_studio.world.robot_file import load_robot
from handey_studio.world.world import EVERYWHERE, NO_TABLE, Block, ConvexBody, World

__all__ = [
    "EVERYWHERE",
    "FINGERS",
    "NO_TABLE",
    "Arm",
    "Block",
    "ConvexBody",
    "Hand",
    "Held",
    "Library",
    "LinkBody",
    "Mate",
    "Part",
    "PlacedPart",
    "Provenance",
    "Robot",
    "World",
    "arm_of",
    "hand_hulls",
    "load_robot",
    "read_part",
    "write_obj",
]
