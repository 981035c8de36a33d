"""Why a MOVE could not be planned, in a sentence: what its ledger comes to."""

from collections import Counter

from handey_studio.base import Entry, describe
from handey_studio.base.ledger import measured
from handey_studio.world import World

MOST_REASONS = 3  # of the grasp groups that are told, the commonest first
MOST_BODIES = 2  # that are named with each
EFFORT_SPENT = "not looked at: the effort is spent"


def why_no_goal(world: World, candidates: int, part: str, to: str, entries: tuple[Entry, ...]) -> str:
    """Why there is not even a goal for a MOVE of `part` to `to`, of which there are so many `candidates`."""
    located = ", ".join(placed.name for placed in world.parts) or "nothing"
    if not candidates:
        return f'"{part}" was not found in the scan; found: {located}'
    fallen = [entry for entry in entries if entry.reason and entry.stage in ("destination", "area")]
    if not fallen:
        return f'nothing to put it on: "{to}" needs another part than the one that moves; found: {located}'
    others = f"; {len(fallen) - 1} other readings of the command fell too" if len(fallen) > 1 else ""
    return describe(fallen[0]) + others


def why_no_plan(entries: tuple[Entry, ...]) -> str:
    """Why no option was left: the commonest reasons and what met what, whether a regrasp would be the way, and what was not looked at."""
    groups = [entry for entry in entries if entry.stage == "grasp group" and entry.reason]
    if groups:
        reasons = Counter(entry.reason or "" for entry in groups).most_common(MOST_REASONS)
        said = "; ".join(f"{count} × {reason}{_bodies(groups, reason)}" for reason, count in reasons)
        words = f"none of {len(groups)} grasp groups works: {said}{_why_no_detour(entries)}"
    else:
        words = f"the hand cannot grasp this part: {_why_no_groups(entries)}"
    return words + "".join(f"; {entry.option} were {describe(entry)}" for entry in entries if entry.reason == EFFORT_SPENT)


def _bodies(groups: list[Entry], reason: str) -> str:
    """The bodies that most groups fell to for a reason."""
    met = Counter(body for entry in groups if entry.reason == reason for body in entry.bodies)
    return f" ({', '.join(body for body, _ in met.most_common(MOST_BODIES))})" if met else ""


def _why_no_groups(entries: tuple[Entry, ...]) -> str:
    """What is wrong with the pairs of features that a hand might take, and how much the nearest of them misses by."""
    fallen = [entry for entry in entries if entry.stage in ("grasp class", "approach group") and entry.reason]
    if not fallen:
        return "no two of its faces, nor a face and an edge or a vertex, face each other"
    reason, count = Counter(entry.reason for entry in fallen).most_common(1)[0]
    alike = [entry for entry in fallen if entry.reason == reason]
    nearest = min(alike, key=lambda entry: abs((entry.value or 0.0) - (entry.limit or 0.0)))
    number = f", at best {measured(nearest.value, nearest.unit)}" if nearest.value is not None else ""
    limit = f", limit {measured(nearest.limit, nearest.unit)}" if nearest.limit is not None else ""
    return f"{reason} ({count} of {len(fallen)} ways to take it){number}{limit}"


def _why_no_detour(entries: tuple[Entry, ...]) -> str:
    """What became of putting the part down on the way."""
    tried = sum(entry.stage == "placements" for entry in entries)
    fallen = [entry.reason for entry in entries if entry.stage == "regrasp" and entry.reason]
    if tried:
        return f"; {tried} ways of putting it down and taking it anew did not help"
    return f"; a regrasp does not help: {fallen[0]}" if fallen else ""
