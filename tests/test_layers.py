"""The shape of the code: imports point down only, no cycles, small files, small functions."""

import ast
import gc
from collections.abc import Iterator
from functools import cache
from pathlib import Path

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
    {"execution", "studies"},
    {"simulation"},
    {"viewer"},
    {"api"},
    {"bench"},
    {"service"},
    {"cli"},
)
LEVELS = {name: level for level, names in enumerate(ROOMS, 1) for name in names}
GROUND = {
    "_core",
    "arrays",
    "cache",
    "config",
    "cores",
    "errors",
    "figure_style",
    "files",
    "libraries",
    "records",
    "resources",
}
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


@cache
def parsed(path: Path) -> ast.Module:
    return ast.parse(path.read_text())


def imports(path: Path) -> set[str]:
    """Every optiplan module that the file imports, inside functions too; what only names a type is not imported."""
    found = set()
    for node in imported(parsed(path)):
        if isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{path}:{node.lineno}: relative import"
            found |= {submodule(node.module or "", alias.name) for alias in node.names}
    return {name for name in found if name.split(".")[0] == "optiplan"}


def imported(tree: ast.AST) -> Iterator[ast.AST]:
    """All statements but those under `if TYPE_CHECKING:`; an expression has none in it."""
    found = [tree]
    while found:
        node = found.pop()
        yield node
        typing_only = isinstance(node, ast.If) and isinstance(node.test, ast.Name) and node.test.id == "TYPE_CHECKING"
        inner = node.orelse if typing_only else ast.iter_child_nodes(node)
        found.extend(child for child in inner if not isinstance(child, ast.expr))


@cache
def submodule(module: str, name: str) -> str:
    """`from a import b` names the module a.b when that is a file, else a."""
    inner = ROOT.joinpath(*module.split("."), name)
    return f"{module}.{name}" if inner.with_suffix(".py").exists() or inner.is_dir() else module


@cache
def graph() -> dict[str, set[str]]:
    """Every module with those that it imports; made by the worker that has these tests alone."""
    gc.disable()  # trees are no garbage: looking for it among them takes twice the time of making them
    try:
        return {module_name(path): imports(path) for path in FILES}
    finally:
        gc.enable()


def test_every_room_has_a_level():
    unknown = {room(module) for module in graph()} - GROUND - set(LEVELS) - {"__init__"}
    assert not unknown, f"give these a level in this test and in docs/architecture.md: {sorted(unknown)}"


def test_imports_point_down():
    def below(module, target):
        return level(target) < level(module) or level(target) == level(module) == 0

    pairs = [(module, target) for module, targets in graph().items() for target in targets]
    wrong = [pair for pair in pairs if room(pair[1]) != room(pair[0]) and not below(*pair)]
    assert not wrong, f"modules and what they import, which is not below them: {wrong}"


def test_rooms_of_planners_point_one_way():
    """Also between the rooms of `planners/`: docs/architecture.md has them from the bottom up."""
    used: dict[str, set[str]] = {}
    for module, targets in graph().items():
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
            for target in graph().get(module, set()):
                visit(target, (*path, module))
            done.add(module)

    for module in graph():
        visit(module, ())


def test_files_are_small_and_honest():
    texts = {str(path.relative_to(ROOT)): path.read_text() for path in FILES}
    empty = [name for name, text in texts.items() if not text.strip()]
    assert not empty, f"an empty file says nothing, give it a docstring: {empty}"
    assert not [name for name, text in texts.items() if len(text.splitlines()) > MAX_FILE]


def test_a_room_can_be_seen_at_a_glance():
    for folder in sorted({path.parent for path in FILES}):
        files = [path.name for path in folder.glob("*.py") if path.name != "__init__.py"]
        assert len(files) <= MAX_SIDE_BY_SIDE, f"more than {MAX_SIDE_BY_SIDE} files side by side in {folder}: {files}"


def test_functions_are_short():
    for path in FILES:
        for node in ast.walk(parsed(path)):
            if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef):
                assert code_lines(node) <= MAX_FUNCTION, f"{path}:{node.lineno}: {node.name} is too long"


def code_lines(node: ast.FunctionDef | ast.AsyncFunctionDef) -> int:
    """Lines of a function from `def` to its end, the docstring apart."""
    first = node.body[0]
    has_docstring = isinstance(first, ast.Expr) and isinstance(first.value, ast.Constant)
    doc = (first.end_lineno or 0) - first.lineno + 1 if has_docstring else 0
    return (node.end_lineno or 0) - node.lineno + 1 - doc


def test_a_class_name_is_used_once():
    places: dict[str, list[str]] = {}
    for path in FILES:
        for node in ast.walk(parsed(path)):
            if isinstance(node, ast.ClassDef):
                places.setdefault(node.name, []).append(f"{path.relative_to(ROOT)}:{node.lineno}")
    assert not {name: where for name, where in places.items() if len(where) > 1}
