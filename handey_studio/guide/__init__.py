"""The guide's pages, as the shell and the workbench show them."""

from pathlib import Path


def pages() -> dict[str, str]:
    """Every page's text in Markdown by its name."""
    return {path.stem: path.read_text(encoding="utf-8") for path in sorted(Path(__file__).parent.glob("*.md"))}


__all__ = ["pages"]
