"""A draft: a part in the making, as its scans and the list of operations over them. Values: the next draft is a new one."""

from dataclasses import dataclass, replace

from handey_studio.base import BadInput, Value
from handey_studio.modeling.operations import Operation
from handey_studio.modeling.scans import Scan

MAX_SCANS = 20
MAX_OPERATIONS = 1000


@dataclass(frozen=True, eq=False)
class Draft(Value):
    """A part in the making. The first scan's world is the model's frame: the support at z = 0, z up."""

    name: str
    scans: tuple[Scan, ...] = ()
    operations: tuple[Operation, ...] = ()

    def __post_init__(self) -> None:
        if not self.name or len(self.name) > 100:
            raise BadInput(f"the name of a draft has {len(self.name)} letters; it must have 1 to 100.")
        if len(self.scans) > MAX_SCANS or len(self.operations) > MAX_OPERATIONS:
            raise BadInput(
                f"a draft has {len(self.scans)} scans and {len(self.operations)} steps, the limits are {MAX_SCANS} and {MAX_OPERATIONS}."
            )
        names = [scan.name for scan in self.scans]
        if len(set(names)) < len(names):
            raise BadInput(f"two scans of the draft are called {max(names, key=names.count)}; each needs a name of its own.")


def with_scan(draft: Draft, scan: Scan) -> Draft:
    """The draft with one more scan, whose pose an `AlignScan` step tells unless it is the first. Raises BadInput."""
    return replace(draft, scans=(*draft.scans, scan))
