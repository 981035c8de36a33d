"""Other libraries in an interpreter of their own: their packages need not mix with ours, and what they break is theirs."""

import json
import subprocess
import sys
from pathlib import Path
from typing import Any, Self

from handey_studio.base import BadInput

PATIENCE_S = 2.0  # for a worker to end by itself


class PeerProcess:
    """A running worker: a script that answers each request, a JSON object a line, with one. Use it as a context; it ends with it."""

    def __init__(self, worker: Path, python: str | None = None) -> None:
        self.python = python or sys.executable
        try:
            self._process = subprocess.Popen([self.python, str(worker)], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
        except OSError as error:
            raise BadInput(f'--peer-python "{python}" cannot be run: {error.strerror}.') from None

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """End the worker."""
        if self._process.stdin is not None:
            self._process.stdin.close()
        try:
            self._process.wait(timeout=PATIENCE_S)
        except subprocess.TimeoutExpired:  # in the middle of a search that nobody waits for any more
            self._process.kill()
            self._process.wait()

    def ask(self, **request: Any) -> dict[str, Any]:
        """One request, one answer. BadInput when the worker has ended."""
        assert self._process.stdin is not None and self._process.stdout is not None
        try:
            self._process.stdin.write(json.dumps(request) + "\n")
            self._process.stdin.flush()
            answer = self._process.stdout.readline()
        except BrokenPipeError:
            answer = ""
        if not answer:
            raise BadInput(f'the peers\' process ended at the request "{request["do"]}"; its last lines on standard error tell why.')
        return json.loads(answer)
