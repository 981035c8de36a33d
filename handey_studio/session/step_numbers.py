"""The one number of a step that a person may change afterwards: a height, a distance, a length, an angle."""

from dataclasses import replace

from handey_studio.base import BadInput
from handey_studio.modeling.operations import Box, Extrude, MoveFace, Operation, SetAngle, SetDistance, SetLength

NUMBERS = {Box: "depth", Extrude: "height", MoveFace: "distance", SetDistance: "distance", SetLength: "length", SetAngle: "angle"}


def number_of(operation: Operation) -> tuple[float, str] | None:
    """The step's number and its unit, "m" or "rad"; None when it has none."""
    name = NUMBERS.get(type(operation))
    value = getattr(operation, name) if name else None
    return None if value is None else (float(value), "rad" if isinstance(operation, SetAngle) else "m")


def with_number(operation: Operation, value: float) -> Operation:
    """The step with another number [m or rad]. Raises BadInput when it has none."""
    if number_of(operation) is None:
        raise BadInput(f'"{operation.told}" has no number to change; remove it and do it anew.')
    return replace(operation, **{NUMBERS[type(operation)]: value})
