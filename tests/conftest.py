"""Property tests draw the same cases every time; `--hypothesis-profile=wide` draws new ones, and more.

The cores share the tests: each file stays in one process, for what it prepares, and all that drive a browser in one, for its patience.
"""

from pathlib import Path

import pytest
from hypothesis import settings

settings.register_profile("same", derandomize=True, deadline=None)
settings.register_profile("wide", max_examples=1000, deadline=None)
settings.load_profile("same")

BROWSER = Path(__file__).parent / "browser"


@pytest.hookimpl(tryfirst=True)  # before the groups are read
def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """The browser's tests come first, as they take longest."""
    items.sort(key=lambda item: BROWSER not in item.path.parents)
    for item in items:
        item.add_marker(pytest.mark.xdist_group("browser" if BROWSER in item.path.parents else str(item.path)))
