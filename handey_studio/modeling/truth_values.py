"""How well a model agrees with its scans, and what is wrong with it: the values that the screen shows."""

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from handey_studio.base import Value, frozen_array


@dataclass(frozen=True, eq=False)
class Check(Value):
    """One thing that a part must be. `sentence` tells what was found, `fix` what would help (empty when all is well).

    `name`: "closed", "planar", "outlines", "one body", "crossing", "thin", "sliver", "size", "volume", "mass" or "centre of mass"; of
    doubts "explained" or "seen through".
    `faces` are the numbers of the faces that it is about, `where` (n, 3) [m] points in the model frame that show it.
    """

    name: str
    ok: bool
    sentence: str
    fix: str = ""
    faces: tuple[int, ...] = ()
    where: NDArray = field(default_factory=lambda: np.empty((0, 3)))

    def __post_init__(self) -> None:
        object.__setattr__(self, "where", frozen_array(np.asarray(self.where, dtype=float).reshape(-1, 3)))


@dataclass(frozen=True, eq=False)
class ScanTruth(Value):
    """One scan against the model, in the model frame.

    `points` (n, 3) [m]: the object's readings; `distances` (n,) [m] from the model's surface, + in front of it (outside), - behind;
    `faces` (n,) the nearest face; `noise` [m] one reading's. `left_out`: (reason, count) of the readings that do not count.
    `explained`: the share within 3 noises. `seen_through` is the share of the model's image that readings behind it deny,
    `seen_through_m` how deep at most [m], and `through_points` (k, 3) where on the model.
    """

    name: str
    points: NDArray
    distances: NDArray
    faces: NDArray
    noise: float
    left_out: tuple[tuple[str, int], ...]
    rms: float
    explained: float
    seen_through: float
    seen_through_m: float
    through_points: NDArray

    def __post_init__(self) -> None:
        for key in ("points", "distances", "through_points"):
            object.__setattr__(self, key, frozen_array(getattr(self, key)))
        object.__setattr__(self, "faces", frozen_array(self.faces, int))


@dataclass(frozen=True, eq=False)
class Truth(Value):
    """The model against all its scans. `rms` [m] of all readings, `explained` the share of them within 3 noises of the surface.

    `seen`: the share of the model's surface that readings lie on, in any scan; `faces_seen` (m,) the same for each face.
    `checks` are those of `solid_checks`, `doubts` what the scans say against the model. Without a reading `rms` is NaN and `explained` 0.
    """

    scans: tuple[ScanTruth, ...]
    rms: float
    explained: float
    seen: float
    faces_seen: NDArray
    checks: tuple[Check, ...]
    doubts: tuple[Check, ...] = ()

    def __post_init__(self) -> None:
        object.__setattr__(self, "faces_seen", frozen_array(self.faces_seen))

    @property
    def ok(self) -> bool:
        """Whether every check holds: it can be a part. It may be a wrong one, see `doubts`."""
        return all(check.ok for check in self.checks)

    @property
    def findings(self) -> tuple[Check, ...]:
        """All checks and then the doubts, as they are numbered on screen."""
        return (*self.checks, *self.doubts)
