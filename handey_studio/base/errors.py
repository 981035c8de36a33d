"""Bad input, told in one sentence that a person can act on."""

from collections.abc import Iterable


class BadInput(ValueError):
    """Input that cannot be used: the thing, its value, the limit and the choices, in one sentence.

    The command line prints it and exits with status 2; the workbench shows it as a notice. It is never a bug report.
    """


def unknown_name(kind: str, name: str, choices: Iterable[str]) -> BadInput:
    """'robot "foo" is not known; choose one of: ur5.'"""
    listed = ", ".join(sorted(choices)) or "none are there"
    return BadInput(f'{kind} "{name}" is not known; choose one of: {listed}.')
