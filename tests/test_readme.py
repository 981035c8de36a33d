"""What README shows works as it stands there."""

import re
import shlex
from pathlib import Path

import pytest

from handey_studio import cli

ROOT = Path(__file__).parents[1]
README = (ROOT / "README.md").read_text()
MODELLING = (ROOT / "handey_studio/guide/modelling.md").read_text()


def code(title: str, text: str = README) -> list[str]:
    section = text.split(f"## {title}\n")[1].split("\n## ")[0]
    return [line[4:] for line in section.splitlines() if line.startswith("    ") or not line.strip()]


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


def test_the_modelling_example_builds_a_carton_whose_draft_is_replayed(capsys, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    exec(compile("\n".join(code("A part is its history", MODELLING)), "modelling.md", "exec"), {})
    assert capsys.readouterr().out.startswith("(0.00139"), "180 × 119.5 × 65 mm"
    assert cli.main(["model", "replay", "carton.draft"]) == 0


def test_readme_links_to_every_page_of_the_guide_and_to_nothing_that_is_not_there():
    linked = set(re.findall(r"\]\((\S+?)\)", README))
    assert all((ROOT / link).is_file() for link in linked)
    assert {str(page.relative_to(ROOT)) for page in (ROOT / "handey_studio/guide").glob("*.md")} <= linked


def test_a_page_of_the_guide_is_shown_by_the_beginning_of_its_name(capsys):
    assert cli.main(["guide", "model"]) == 0
    assert capsys.readouterr().out == MODELLING
    assert cli.main(["guide"]) == 0
    assert "parts_and_robots" in capsys.readouterr().out
    assert cli.main(["guide", "cooking"]) == 2
    assert "workbench" in capsys.readouterr().err
