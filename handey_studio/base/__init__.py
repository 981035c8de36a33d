"""What every room uses: the ledger of tried options, progress and cancel, read-only arrays, errors a person can act on."""

from handey_studio.base.arrays import Value, frozen_array
from handey_studio.base.errors import BadInput
from handey_studio.base.ledger import Entry, Ledger, Posture, describe, entry_report, finite, measured, rejected_counts
from handey_studio.base.progress import Progress, Share, Silent

__all__ = [
    "BadInput",
    "Entry",
    "Ledger",
    "Posture",
    "Progress",
    "Share",
    "Silent",
    "Value",
    "describe",
    "entry_report",
    "finite",
    "frozen_array",
    "measured",
    "rejected_counts",
]
