"""Why a MOVE could not be planned, in a sentence: what its ledger comes to."""

from collections import Counter, defaultdict

from handey_studio.base import Entry, Ledger, describe, measured
from handey_studio.task.options import OPENED_LESS
from handey_studio.world import World

MOST_REASONS = 3  # of the grasp groups that are told, the commonest first
MOST_BODIES = 2  # that are named with each
EFFORT_SPENT = "not looked at: the effort is spent"
GAVE_WAY = {
    "grasp group": "nothing works at any of its hand angles",
    "approach": "neither way round works",
    "hand": "no pair of arm configurations works",
}


def settle(ledger: Ledger, waiting: set[int]) -> None:
    """Options below which everything fell have fallen themselves; those in `waiting`, with something untested below, stand."""
    standing, below = set(waiting), {entry.parent for entry in ledger.entries}
    for entry in reversed(ledger.entries):
        if entry.reason is not None or entry.parent is None or entry.stage not in (*GAVE_WAY, "arm"):
            continue
        if entry.stage == "arm" or entry.id in standing or entry.id not in below:
            standing.add(entry.parent)
        else:
            ledger.fall(entry.id, GAVE_WAY[entry.stage])


def why_no_goal(world: World, candidates: int, part: str, to: str, entries: tuple[Entry, ...]) -> str:
    """Why there is not even a goal for a MOVE of `part` to `to`, of which there are so many `candidates`."""
    located = ", ".join(placed.name for placed in world.parts) or "nothing"
    if not candidates:
        return f'"{part}" was not found in the scan; found: {located}'
    fallen = [entry for entry in entries if entry.reason and entry.stage in ("destination", "area")]
    if not fallen:
        return f'nothing to put it on: "{to}" needs another part than the one that moves; found: {located}'
    more = len(fallen) - 1
    others = f"; {more} other reading{'s' if more > 1 else ''} of the command fell too" if more else ""
    return describe(fallen[0]) + others


def why_no_plan(entries: tuple[Entry, ...]) -> str:
    """Why no option was left: the commonest reasons and what met what, whether a regrasp would be the way, and what was not looked at."""
    groups = [entry for entry in entries if entry.stage == "grasp group" and entry.reason]
    if groups:
        count = len({entry.option.removesuffix(OPENED_LESS) for entry in groups})
        words = f"none of {count} grasp groups works: {_commonest(groups, entries)}{_why_no_detour(entries)}"
    else:
        words = f"the hand cannot grasp this part: {_why_no_groups(entries)}"
    return words + "".join(f"; {entry.option} were {describe(entry)}" for entry in entries if entry.reason == EFFORT_SPENT)


def _commonest(groups: list[Entry], entries: tuple[Entry, ...]) -> str:
    """What most groups fell for, with the bodies that were met most often; of those that gave way below, what fell there most often."""
    below: dict[int | None, list[Entry]] = defaultdict(list)
    for entry in entries:
        below[entry.parent].append(entry)
    counts, met = Counter(), defaultdict(Counter)
    for group in groups:
        fallen = _ends_below(group, below)
        reason, _ = Counter(entry.reason or "" for entry in fallen).most_common(1)[0]
        counts[reason] += 1
        met[reason].update(body for entry in fallen if entry.reason == reason for body in entry.bodies)
    named = {reason: ", ".join(body for body, _ in met[reason].most_common(MOST_BODIES)) for reason in counts}
    said = (f"{count} × {reason}{f' ({named[reason]})' if named[reason] else ''}" for reason, count in counts.most_common(MOST_REASONS))
    return "; ".join(said)


def _ends_below(entry: Entry, below: dict[int | None, list[Entry]]) -> list[Entry]:
    """The entries at which everything below an entry ended; itself if nothing fell below it."""
    ends = [end for child in below[entry.id] for end in _ends_below(child, below) if end.reason]
    return ends or [entry]


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
