"""What README shows works as it stands there."""

import re
import shlex
from pathlib import Path

import pytest

from handey_studio import cli

README = (Path(__file__).parents[1] / "README.md").read_text()


def section(title: str) -> str:
    return README.split(f"## {title}\n")[1].split("\n## ")[0]


def code(title: str) -> list[str]:
    return [line[4:] for line in section(title).splitlines() if line.startswith("    ") or not line.strip()]


def shell_lines() -> list[str]:
    return [line.split("#")[0].strip() for line in code("From the shell") if line.startswith("handey ")]


def test_there_are_commands_to_check():
    assert len(shell_lines()) >= 5


@pytest.mark.parametrize("line", shell_lines())
def test_every_shell_command_is_understood(line):
    words = shlex.split(re.sub(r"[\[\]]", "", line.replace("[SESSION]", "figure1")))
    command = cli._parser().parse_args(cli._words(words[1:])).command
    assert words[1 : 1 + len(command.split())] == command.split()


def test_the_python_example_moves_the_block(capsys):
    exec(compile("\n".join(code("From Python")), "README.md", "exec"), {})
    told = capsys.readouterr().out
    assert "l_block#1" in told and "planned" in told
    assert told.strip().splitlines()[-1].startswith("[") or "]]" in told, "the pose that was reached"


def test_the_modelling_example_builds_a_carton(capsys):
    exec(compile("\n".join(code("Modelling: a part is its history")), "README.md", "exec"), {})
    assert capsys.readouterr().out.startswith("(0.00139"), "180 × 119.5 × 65 mm"
