"""The house stays as it is laid out: imports run one way, only the workbench imports viser, files and functions stay short."""

import ast
from functools import cache
from pathlib import Path

import handey_studio

ROOT = Path(handey_studio.__file__).parent
FLOORS = (
    {"base", "guide"},
    {"geometry"},
    {"world"},
    {"sensing"},
    {"modeling", "localization", "motion"},
    {"grasping"},
    {"cell"},
    {"task"},
    {"session"},
    {"app"},
    {"commands"},
    {"cli"},
)
FLOOR = {room: number for number, rooms in enumerate(FLOORS) for room in rooms}


@cache
def _modules():
    return [(path, ast.parse(path.read_text())) for path in sorted(ROOT.rglob("*.py"))]


def _imports(tree: ast.Module):
    for node in ast.walk(tree):
        if isinstance(node, ast.ImportFrom) and node.module:
            yield node.module
        elif isinstance(node, ast.Import):
            yield from (name.name for name in node.names)


def _room(path: Path) -> str:
    return path.relative_to(ROOT).parts[0].removesuffix(".py")


def test_imports_run_one_way():
    wrong = []
    for path, tree in _modules():
        room = _room(path)
        for module in _imports(tree):
            words = module.split(".")
            if room == "__init__" or words[0] != "handey_studio" or len(words) < 2 or words[1] == room:
                continue
            if FLOOR[words[1]] >= FLOOR[room]:
                wrong.append(f"{path.relative_to(ROOT)} imports {module}")
    assert not wrong, wrong


def test_every_room_has_a_floor():
    rooms = {_room(path) for path, _ in _modules()} - {"__init__"}
    assert rooms <= set(FLOOR), rooms - set(FLOOR)


def test_only_the_workbench_imports_viser():
    users = {_room(path) for path, tree in _modules() for module in _imports(tree) if module.split(".")[0] == "viser"}
    assert users == {"app"}


def test_no_planner_imports_the_simulated_truth():
    hidden = ("physics", "scenes", "check", "simulated", "truth", "geometric", "bodies", "stripes", "camera")
    planners = {"localization", "motion", "grasping", "sensing", "world", "modeling"}
    for path, tree in _modules():
        if _room(path) in planners or (_room(path) == "task" and "bench" not in path.parts):
            words = [module.split(".") for module in _imports(tree) if module.startswith("handey_studio.cell.")]
            assert not [module for module in words if module[2] in hidden], path


def test_functions_stay_short():
    long = [
        f"{path.relative_to(ROOT)}:{node.lineno} {node.name} has {node.end_lineno - node.lineno + 1} lines"
        for path, tree in _modules()
        for node in ast.walk(tree)
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef) and node.end_lineno - node.lineno + 1 > 70
    ]
    assert not long, long
