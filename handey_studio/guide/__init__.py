"""The guide's pages, as the shell and the workbench show them."""

import re
from pathlib import Path

PICTURE = re.compile(r"!\[[^]]*\]\([^)]*\)\n+")


def pages() -> dict[str, str]:
    """Every page's text in Markdown by its name, without pictures, which neither a terminal nor a dialog shows."""
    return {path.stem: PICTURE.sub("", path.read_text(encoding="utf-8")) for path in sorted(Path(__file__).parent.glob("*.md"))}


__all__ = ["pages"]
