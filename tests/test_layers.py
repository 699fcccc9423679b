"""The shape of the code: imports point down only, no cycles, small files, small functions."""

import ast
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).parent.parent
PACKAGE = ROOT / "optiplan"
FILES = sorted(PACKAGE.rglob("*.py"))
ROOMS = (
    {"geometry"},
    {"robot"},
    {"kinematics", "collision", "trajectory"},
    {"workspace", "problem"},
    {"control", "importers"},
    {"planners", "verify"},
    {"runs"},
    {"simulation"},
    {"viewer"},
    {"api"},
    {"bench"},
    {"service"},
    {"cli"},
)
LEVELS = {name: level for level, names in enumerate(ROOMS, 1) for name in names}
GROUND = {"_core", "arrays", "cache", "config", "cores", "errors", "figure_style", "files", "libraries", "resources"}
MAX_FILE, MAX_FUNCTION = 420, 58
MAX_SIDE_BY_SIDE = 17


def module_name(path: Path) -> str:
    parts = path.relative_to(ROOT).with_suffix("").parts
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


def room(module: str) -> str:
    parts = module.split(".")
    name = parts[1] if len(parts) > 1 else "__init__"
    return "cli" if name == "__main__" else name


def level(module: str) -> int:
    return 0 if room(module) in GROUND | {"__init__"} else LEVELS[room(module)]


def imports(path: Path) -> set[str]:
    """Every optiplan module that the file imports, inside functions too; what only names a type is not imported."""
    found = set()
    for node in imported(ast.parse(path.read_text())):
        if isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{path}:{node.lineno}: relative import"
            found |= {submodule(node.module or "", alias.name) for alias in node.names}
    return {name for name in found if name.split(".")[0] == "optiplan"}


def imported(tree: ast.AST) -> Iterator[ast.AST]:
    """All nodes but those under `if TYPE_CHECKING:`."""
    yield tree
    typing_only = isinstance(tree, ast.If) and isinstance(tree.test, ast.Name) and tree.test.id == "TYPE_CHECKING"
    for child in tree.orelse if typing_only else ast.iter_child_nodes(tree):
        yield from imported(child)


def submodule(module: str, name: str) -> str:
    """`from a import b` names the module a.b when that is a file, else a."""
    inner = ROOT.joinpath(*module.split("."), name)
    return f"{module}.{name}" if inner.with_suffix(".py").exists() or inner.is_dir() else module


GRAPH = {module_name(path): imports(path) for path in FILES}


def test_every_room_has_a_level():
    unknown = {room(module) for module in GRAPH} - GROUND - set(LEVELS) - {"__init__"}
    assert not unknown, f"give these a level in this test and in docs/architecture.md: {sorted(unknown)}"


@pytest.mark.parametrize("module", sorted(GRAPH))
def test_imports_point_down(module):
    for target in GRAPH[module]:
        same_room = room(target) == room(module)
        below = level(target) < level(module) or level(target) == level(module) == 0
        assert same_room or below, f"{module} imports {target}, which is not below it"


def test_rooms_of_planners_point_one_way():
    """Also between the rooms of `planners/`: docs/architecture.md has them from the bottom up."""
    used: dict[str, set[str]] = {}
    for module, targets in GRAPH.items():
        own = planner_room(module)
        used.setdefault(own, set()).update({planner_room(target) for target in targets} - {own, ""})
    del used[""]
    above = [room for room in used if used[room]]
    while above:
        ready = [room for room in above if not used[room] & set(above)]
        assert ready, f"these import one another: {sorted(above)}"
        above = [room for room in above if room not in ready]


def planner_room(module: str) -> str:
    """`common` of `optiplan.planners.common.failures`; nothing for a module that is in no room of planners."""
    parts = module.split(".")
    return parts[2] if parts[:2] == ["optiplan", "planners"] and len(parts) > 3 else ""


def test_no_cycles():
    done: set[str] = set()

    def visit(module: str, path: tuple[str, ...]) -> None:
        assert module not in path, "import cycle: " + " -> ".join([*path[path.index(module) :], module])
        if module not in done:
            for target in GRAPH.get(module, set()):
                visit(target, (*path, module))
            done.add(module)

    for module in GRAPH:
        visit(module, ())


@pytest.mark.parametrize("path", FILES, ids=lambda path: str(path.relative_to(ROOT)))
def test_file_is_small_and_honest(path):
    text = path.read_text()
    assert text.strip(), "an empty file says nothing: give it a docstring"
    assert len(text.splitlines()) <= MAX_FILE


FOLDERS = sorted({path.parent for path in FILES})


@pytest.mark.parametrize("folder", FOLDERS, ids=lambda path: str(path.relative_to(ROOT)))
def test_a_room_can_be_seen_at_a_glance(folder):
    files = [path.name for path in folder.glob("*.py") if path.name != "__init__.py"]
    assert len(files) <= MAX_SIDE_BY_SIDE, f"more than {MAX_SIDE_BY_SIDE} files side by side: {files}"


@pytest.mark.parametrize("path", FILES, ids=lambda path: str(path.relative_to(ROOT)))
def test_functions_are_short(path):
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef):
            assert code_lines(node) <= MAX_FUNCTION, f"{path.name}:{node.lineno}: {node.name} is too long"


def code_lines(node: ast.FunctionDef | ast.AsyncFunctionDef) -> int:
    """Lines of a function from `def` to its end, the docstring apart."""
    first = node.body[0]
    has_docstring = isinstance(first, ast.Expr) and isinstance(first.value, ast.Constant)
    doc = (first.end_lineno or 0) - first.lineno + 1 if has_docstring else 0
    return (node.end_lineno or 0) - node.lineno + 1 - doc


def test_a_class_name_is_used_once():
    places: dict[str, list[str]] = {}
    for path in FILES:
        for node in ast.walk(ast.parse(path.read_text())):
            if isinstance(node, ast.ClassDef):
                places.setdefault(node.name, []).append(f"{path.relative_to(ROOT)}:{node.lineno}")
    assert not {name: where for name, where in places.items() if len(where) > 1}
