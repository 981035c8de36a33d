"""Property tests draw the same cases every time; `--hypothesis-profile=wide` draws new ones, and more.

The cores share the tests: each file stays in one process, for what it prepares, and all that drive a browser in one, for its patience.
"""

from typing import Any

import pytest
from hypothesis import settings
from xdist.scheduler import LoadScopeScheduling

settings.register_profile("same", derandomize=True, deadline=None)
settings.register_profile("wide", max_examples=1000, deadline=None)
settings.load_profile("same")

BROWSER = "tests/browser/"


class ByFile(LoadScopeScheduling):
    """Files go to processes as they become free, in order."""

    def _split_scope(self, nodeid: str) -> str:
        return BROWSER if nodeid.startswith(BROWSER) else nodeid.split("::")[0]


def pytest_xdist_make_scheduler(config: pytest.Config, log: Any) -> ByFile:
    return ByFile(config, log)


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """The browser's tests come first, as they take longest."""
    items.sort(key=lambda item: not item.nodeid.startswith(BROWSER))
