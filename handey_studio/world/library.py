"""The library: robots, parts and sessions by name, the user's own first and then the bundled ones."""

import os
import sys
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

from handey_studio.base.errors import unknown_name
from handey_studio.world.model_files import MESH_SUFFIXES, read_part
from handey_studio.world.part import Part
from handey_studio.world.robot import Robot
from handey_studio.world.robot_file import load_robot

KINDS = ("robots", "parts", "sessions")


@lru_cache(maxsize=1)
def bundled() -> Path:
    """The read-only folder that holds the bundled robots, parts and sessions."""
    inside = Path(__file__).resolve().parent.parent / "library"
    return inside if inside.is_dir() else Path(__file__).resolve().parents[2]


def user_data_folder() -> Path:
    """Where a user's own things go unless told otherwise, by the platform's custom."""
    if sys.platform == "darwin":
        return Path.home() / "Library" / "Application Support" / "handey-studio"
    base = os.environ.get("XDG_DATA_HOME")
    return (Path(base) if base else Path.home() / ".local" / "share") / "handey-studio"


@dataclass(frozen=True)
class Library:
    """`folder` holds the user's own robots/, parts/ and sessions/; bundled ones are found behind it."""

    folder: Path

    @classmethod
    def choose(cls, folder: str | os.PathLike | None = None) -> "Library":
        """The named folder, else the current one if it has any of the three, else the user's data folder."""
        if folder is not None:
            return cls(Path(folder))
        here = Path.cwd()
        return cls(here if any((here / kind).is_dir() for kind in KINDS) else user_data_folder())

    def robot(self, name: str) -> Robot:
        """A robot by its name, or a folder with a robot.toml."""
        if (Path(name) / "robot.toml").is_file():
            return load_robot(name)
        known = self.robot_folders()
        if name not in known:
            raise unknown_name("robot", name, known)
        return load_robot(known[name])

    def robot_folders(self) -> dict[str, Path]:
        """Name → folder with a robot.toml."""
        return self._named("robots", lambda path: (path / "robot.toml").is_file())

    def part(self, name: str, scale: float = 1.0) -> Part:
        """A part by its name, or a mesh file [m × scale]."""
        known = self.part_files()
        if name in known:
            return read_part(known[name], scale)
        if Path(name).suffix.lower() in MESH_SUFFIXES:
            return read_part(name, scale)
        raise unknown_name("part", name, known)

    def part_files(self) -> dict[str, Path]:
        """Name → model file."""
        return {path.stem: path for path in self._named("parts", lambda path: path.suffix.lower() in MESH_SUFFIXES).values()}

    def drafts(self) -> dict[str, Path]:
        """Name of a part → the draft that it was modelled by; only the one beside the model that is used."""
        beside = {name: path.with_suffix(".draft") for name, path in self.part_files().items()}
        return {name: path for name, path in beside.items() if path.is_file()}

    def sessions(self) -> dict[str, Path]:
        """Name → session file."""
        return {path.stem: path for path in self._named("sessions", lambda path: path.suffix == ".handey").values()}

    def _named(self, kind: str, wanted) -> dict[str, Path]:
        found: dict[str, Path] = {}
        for root in (bundled(), self.folder):
            if (root / kind).is_dir():
                found |= {path.name: path for path in sorted((root / kind).iterdir()) if wanted(path)}
        return found
