"""Compiling ahead on a machine where all is new."""

import importlib.util
import os
import time

import pytest

from handey_studio.base.compiled import is_compiled
from handey_studio.session import ahead

SOURCE = """
from numba import njit

@njit(cache=True)
def twice(x):
    return 2 * x
"""


def test_a_function_is_compiled_once_its_code_is_kept_and_until_its_source_changes(tmp_path):
    path = tmp_path / "sums.py"
    path.write_text(SOURCE)
    spec = importlib.util.spec_from_file_location("sums", path)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    assert not is_compiled(module.twice)
    assert module.twice(2) == 4
    assert is_compiled(module.twice)
    later = time.time() + 10
    os.utime(path, (later, later))
    assert not is_compiled(module.twice)


@pytest.mark.parametrize("compiled", [True, False])
def test_a_process_beside_works_only_where_something_is_left_to_compile(compiled, tmp_path, monkeypatch):
    monkeypatch.setattr(ahead, "is_compiled", lambda function: compiled)
    assert ahead.compile_beside(os.mkdir, str(tmp_path / "done")) is not compiled
    until = time.monotonic() + 60
    while not compiled and not (tmp_path / "done").exists() and time.monotonic() < until:
        time.sleep(0.05)
    assert (tmp_path / "done").exists() is not compiled
