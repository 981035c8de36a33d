"""What every step of a model's history is: a small value that tells what a person did, in the model's frame [m]."""

from dataclasses import dataclass
from typing import ClassVar, Literal

from handey_studio.base import Value

Combine = Literal["join", "cut", "common"]


@dataclass(frozen=True, eq=False)
class Operation(Value):
    """One step of a draft."""

    kind: ClassVar[str] = ""

    @property
    def told(self) -> str:
        """The step in a few words, with its numbers in mm and degrees."""
        return self.kind


def combined_words(combine: Combine) -> str:
    """What becomes of the new body, as a step's words end; nothing for what goes without saying."""
    return {"join": "", "cut": ", cut away", "common": ", only what is common kept"}[combine]
