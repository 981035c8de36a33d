"""Commands in the words of the screen: millimetres and degrees."""

from handey_studio.task.plan import MoveCommand


def destination_words(to: str) -> str:
    """A pose or an area (as in `handey move --to`, metres and degrees) in mm and degrees; a destination on a part stays as it is."""
    area = to.startswith("in:")
    try:
        numbers = [float(word) for word in to.removeprefix("in:").split(",")]
    except ValueError:
        return to
    mm = [f"{round(1e3 * number, 1) + 0.0:g}" for number in numbers]
    if area and len(numbers) == 4:
        return f"x {mm[0]} to {mm[2]}, y {mm[1]} to {mm[3]} mm"
    turns = ", ".join(f"{round(number, 1) + 0.0:g}°" for number in numbers[3:])
    return f"{', '.join(mm[:3])} mm" + (f", turned {turns}" if any(numbers[3:]) else "")


def move_words(command: MoveCommand) -> str:
    """`MOVE l_block TO 350, -80, 0 mm`."""
    return f"MOVE {command.part} TO {destination_words(command.to)}"


def arrow_words(command: MoveCommand) -> str:
    """`l_block → 350, -80, 0 mm`, for lists."""
    return f"{command.part} → {destination_words(command.to)}"
