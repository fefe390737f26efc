"""The direction of imports, read from the source: every layer imports only from those below it."""

import ast
import gc
import re
import sys
import tomllib
from collections import Counter
from collections.abc import Collection, Iterator
from functools import cache
from graphlib import TopologicalSorter
from pathlib import Path

from tests.value_followed import modules_with_the_angle
from vibro_cli.systems import NAMES

ROOT = Path(__file__).parents[1]
PACKAGE = ROOT / "vibro_cli"

# From top to bottom: each line may import from itself and from the lines below it. systems,
# mechanics and numerics know nothing of scenario/, and scenario/ nothing of them; only assemble.py
# knows both.
LAYERS = (
    "commands",
    "interface",
    "report",
    "figures",
    "benchmark",
    "programs",
    "stress",
    "analysis",
    "grids",
    "storage",
    "api",
    "assemble",
    "scenario",
    "systems",
    "mechanics",
    "numerics",
    "kernels",
    "compile",
    "errors",
    "progress",
)
# The stages of the event loop and what is around them, likewise from top to bottom.
STAGES = (
    "rotating",
    "ensemble",
    "tangent",
    "statistics",
    "events",
    "cluster",
    "impact",
    "contact",
    "flow",
    "world",
    "numerics",
)
STRANGERS = {
    "scenario": {"systems", "mechanics", "numerics"},
    "systems": {"scenario"},
    "mechanics": {"scenario"},
    "kernels": {"scenario"},
    "numerics": {"scenario"},
    "compile": {"scenario"},
}
SOLVER = ("systems", "mechanics", "kernels", "numerics")
NOT_IN_THE_SOLVER = {"pydantic", "pyarrow", "matplotlib", "typer", "ruamel"}
HALVES = {"numba": "CyRK", "pydantic_core": "pydantic", "PIL": "pillow"}  # come with
LIGHT = ("__init__.py", "__main__.py", "errors.py")
HEAVY = {"numpy", "scipy", "pyarrow", "matplotlib", "pydantic", "ruamel"}
STANDS_APART = {"__init__", "__main__"}  # they hand over to other modules and are no layer
# The objects of systems and their contract: they import what is above in their methods only.
OBJECT = "object of a system"
# Parts of a system's folder, each on the layer of what it is part of.
PARTS = {
    "scenario": "scenario",
    "build": "assemble",
    "describe": "report",
    "stress": "stress",
    **dict.fromkeys(("grid_solver", "system_template"), "grids"),
    "phase_plane": "analysis",
    **dict.fromkeys(("figures", "plan", "portrait"), "figures"),
}

SOURCES = sorted(path for path in PACKAGE.rglob("*.py"))


def layer(path: Path) -> str:
    """Return the layer of a file."""
    parts = path.relative_to(PACKAGE).parts
    if parts[0] == "systems" and (parts[-1] in ("__init__.py", "contract.py")):
        return OBJECT
    if parts[0] == "systems" and len(parts) == 3:
        return PARTS.get(parts[2].removesuffix(".py"), "systems")
    return parts[0].removesuffix(".py")


@cache
def tree_of(path: Path) -> ast.Module:
    # Python 3.11 may fail (SystemError) where collected garbage runs code that parses too.
    gc.disable()
    try:
        return ast.parse(path.read_text(encoding="utf-8"))
    finally:
        gc.enable()


@cache
def imports(path: Path, at_module_level_only: bool = False) -> list[str]:
    """Full names of what a file imports; imports for type checking only do not count as loading."""
    tree = tree_of(path)
    names: list[str] = []
    for node in _loaded_at_import(tree) if at_module_level_only else ast.walk(tree):
        if isinstance(node, ast.Import):
            names += (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{path}: relative imports hide the layer"
            assert node.module is not None
            names += (f"{node.module}.{alias.name}" for alias in node.names)
    return names


def _loaded_at_import(tree: ast.AST) -> Iterator[ast.AST]:
    for node in ast.iter_child_nodes(tree):
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef | ast.Lambda):
            continue
        if isinstance(node, ast.If) and "TYPE_CHECKING" in ast.dump(node.test):
            continue
        yield node
        yield from _loaded_at_import(node)


@cache
def own_layers(path: Path) -> set[str]:
    """The layers a file imports from, anywhere in it."""
    names = (name for name in imports(path) if name.startswith("vibro_cli."))
    return {_layer_of(name) for name in names} - {"__version__", OBJECT}


def _layer_of(name: str) -> str:
    """Return the layer of a module, or of an imported object."""
    path = PACKAGE.joinpath(*name.split(".")[1:])
    while not path.with_suffix(".py").exists() and not path.is_dir():
        if path.parent == PACKAGE:
            return path.name
        path = path.parent
    return layer(path / "__init__.py" if path.is_dir() else path.with_suffix(".py"))


def test_there_is_something_to_check() -> None:
    """Every layer and every stage that a rule names is one of the package."""
    assert set(map(layer, SOURCES)) == {*LAYERS, *STANDS_APART, OBJECT}
    assert set(map(_stage, KERNELS)) == {*STAGES, *NAMES[1:], "__init__"}


def test_imports_go_down_only() -> None:
    for path in SOURCES:
        here = layer(path)
        if here == OBJECT:
            loaded = imports(path, at_module_level_only=True)
            own = {name for name in loaded if name.startswith("vibro_cli.")}
            assert all(name.startswith("vibro_cli.systems.contract") for name in own), path
        elif here not in STANDS_APART:
            below = set(LAYERS[LAYERS.index(here) :]) - STRANGERS.get(here, set())
            strange = own_layers(path) - below
            assert not strange, (
                f"{path.relative_to(PACKAGE)} imports from {sorted(strange)}, expected what is "
                f"below {here} (and a name from its own module, not from {PACKAGE.name})"
            )


KERNELS = sorted((PACKAGE / "kernels").rglob("*.py"))


def _stage(path: Path) -> str:
    """Return the stage of the event loop to which a file of the kernels belongs."""
    return path.relative_to(PACKAGE / "kernels").with_suffix("").parts[0]


def test_stages_of_the_event_loop_import_those_below_only() -> None:
    for path in KERNELS:
        stage = _stage(path)
        if stage in STAGES:  # or of another system, with an event loop of its own
            below = STAGES[STAGES.index(stage) :]
            names = (name for name in imports(path) if name.startswith("vibro_cli.kernels."))
            used = {name.split(".")[2] for name in names}
            assert used <= set(below), (path, used - set(below))


def test_the_solver_knows_no_files_and_no_figures() -> None:
    for path in SOURCES:
        if layer(path) in SOLVER:
            found = {name.split(".")[0] for name in imports(path)}
            assert not found & (NOT_IN_THE_SOLVER | {"pathlib", "json", "tomllib"}), path


def test_only_assemble_knows_both_scenario_and_mechanics() -> None:
    upper = set(LAYERS[: LAYERS.index("assemble")])
    both = {
        str(path.relative_to(PACKAGE))
        for path in SOURCES
        if layer(path) not in {*upper, "assemble", OBJECT}
        and {"scenario", "mechanics"} <= own_layers(path)
    }
    assert not both


def test_what_every_command_line_loads_is_light() -> None:
    light = [PACKAGE / name for name in LIGHT]
    for path in [path for path in SOURCES if layer(path) == "commands"] + light:
        loaded = set(imports(path, at_module_level_only=True))
        assert not {name.split(".")[0] for name in loaded} & HEAVY, path
        loaded -= {"vibro_cli.systems.NAMES", "vibro_cli.systems.PLURALS"}
        own = {name.split(".")[1] for name in loaded if name.startswith("vibro_cli.")}
        assert own <= {"commands", "__version__", "errors", "unsupported"}, path


def test_commands_are_imported_by_nobody() -> None:
    for path in SOURCES:
        if layer(path) not in {"commands", "__main__"}:
            assert "commands" not in own_layers(path), path


def test_every_library_that_is_imported_is_declared() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    extras = project["optional-dependencies"]
    required = [
        *project["dependencies"],
        *extras["dask"],
        *extras["stress"],
        *extras["peers"],
        *extras["frames"],
    ]
    declared = {text.split(">")[0].split("[")[0].split(".")[0] for text in required}
    found = {name.split(".")[0] for path in SOURCES for name in imports(path)}
    found = {HALVES.get(name, name) for name in found}
    assert found - set(sys.stdlib_module_names) - {"vibro_cli"} <= declared | {"dask"}


def test_no_private_name_of_another_package_is_used() -> None:
    own = {"vibro_cli", "__future__"}
    for path in SOURCES:
        for name in imports(path):
            parts = name.split(".")
            if parts[0] not in own:
                assert not any(part.startswith("_") for part in parts), (path, name)


OUTSIDE = [
    path
    for path in SOURCES
    if path.relative_to(PACKAGE).parts[0] != "systems"
    and path.relative_to(PACKAGE).parts[:2] not in {("kernels", name) for name in NAMES}
]


def test_nobody_asks_for_a_system_by_name_or_type() -> None:
    """Differences between systems are attributes of their objects."""
    own = [f"vibro_cli.{home}.{name}." for name in NAMES[1:] for home in ("systems", "kernels")]
    for path in OUTSIDE:
        assert not [name for name in imports(path) if f"{name}.".startswith(tuple(own))], path
        for node in ast.walk(tree_of(path)):
            assert not _asks_for_a_system(node), (path, ast.unparse(node))


def _asks_for_a_system(node: ast.AST) -> bool:
    if isinstance(node, ast.Compare) and "system" in ast.unparse(node.left):
        sides = [ast.unparse(one) for one in node.comparators]
        return any(f"'{name}'" in one for one in sides for name in NAMES)
    if isinstance(node, ast.Call) and ast.unparse(node.func) == "isinstance":
        asked = ast.unparse(node.args[1]).rpartition(".")[2]
        return asked in {"System", "TraceSystem", "Scenario", "ImpactSystem"}
    return False


REGISTRY = PACKAGE / "systems" / "__init__.py"
FOLDERS = {PACKAGE / home / name for name in NAMES[1:] for home in ("systems", "kernels")}
TEXTS = [path for suffix in ("js", "css", "html", "hpp") for path in PACKAGE.rglob(f"*.{suffix}")]
SHARED = [path for path in (*SOURCES, *sorted(TEXTS)) if not FOLDERS & set(path.parents)]
# A trace and a table are also other things, but not as the system of a scenario.
OTHERS = "|".join(NAMES[1:])
NAMED = re.compile(rf'\bsprings?\b|"system": "({OTHERS})"', re.IGNORECASE)


def test_a_system_is_named_in_its_folders_and_in_the_registry_only() -> None:
    """In no code, text, comment or scene of another file: the springs are a plug-in."""
    assert NAMED.search(REGISTRY.read_text(encoding="utf-8"))
    for path in SHARED:
        found = NAMED.search(path.read_text(encoding="utf-8"))
        assert found is None or path == REGISTRY, (path, found)


def test_few_files_are_beside_each_other() -> None:
    """A folder should be readable at a glance; one with more topics has subfolders."""
    beside = Counter(path.parent for path in SOURCES if path.name != "__init__.py")
    assert {str(folder): count for folder, count in beside.items() if count > 15} == {}


def test_chains_of_imports_are_short() -> None:
    """Modules that are loaded one for another: no circles, and at most 15 on top of one another."""
    modules = {_module_of(path): path for path in SOURCES}
    below: dict[str, set[str]] = {}
    for module, path in modules.items():
        names = imports(path, at_module_level_only=True)
        below[module] = {_nearest(name, modules) for name in names} - {""}
    height: dict[str, int] = {}
    for module in TopologicalSorter(below).static_order():  # raises where there is a circle
        height[module] = 1 + max((height[one] for one in below.get(module, ())), default=0)
    assert max(height.values()) <= 15, max(height, key=lambda module: height[module])


def _module_of(path: Path) -> str:
    parts = path.relative_to(ROOT).with_suffix("").parts
    return ".".join(parts).removesuffix(".__init__")


def _nearest(name: str, modules: Collection[str]) -> str:
    """The module that an imported name is in, empty for other packages'."""
    while name and name not in modules:
        name = name.rpartition(".")[0]
    return name


def _is_of_the_kernels(node: ast.stmt) -> bool:
    """Whether a statement declares a kernel, a struct, a named tuple of arrays or a number."""
    if isinstance(node, ast.FunctionDef):
        private_constant = node.name.startswith("_") and not node.args.args
        return private_constant or "kernel" in map(ast.unparse, node.decorator_list)
    if isinstance(node, ast.ClassDef):
        of_arrays = [ast.unparse(base) for base in node.bases] == ["NamedTuple"]
        return of_arrays or "struct" in map(ast.unparse, node.decorator_list)
    plain = (ast.Import, ast.ImportFrom, ast.Assign, ast.AnnAssign)
    return isinstance(node, plain) or ast.unparse(node).startswith(("'", '"'))


def test_kernels_hold_nothing_but_kernels_and_structs() -> None:
    for path in KERNELS:
        for node in tree_of(path).body:
            assert _is_of_the_kernels(node), f"{path}:{node.lineno}"


def test_every_field_of_a_struct_is_set() -> None:
    """As a whole, by element, or by its name as a column: a field never set is silently 0."""
    fields, is_set = set[str](), set[str]()
    for path in SOURCES:
        for node in ast.walk(tree_of(path)):
            if isinstance(node, ast.ClassDef) and "struct" in map(ast.unparse, node.decorator_list):
                fields |= {ast.unparse(n.target) for n in node.body if isinstance(n, ast.AnnAssign)}
            elif isinstance(node, ast.Constant):
                is_set.add(str(node.value))
            elif isinstance(getattr(node, "ctx", None), ast.Store):
                named = node.value if isinstance(node, ast.Subscript) else node
                is_set |= {named.attr} if isinstance(named, ast.Attribute) else set()
    assert len(fields) > 200
    assert fields - is_set == set()


def test_functions_fit_a_screen() -> None:
    """At most 40 lines without the docstring, and at most 8 parameters."""
    for path in SOURCES:
        for node in ast.walk(tree_of(path)):
            if isinstance(node, ast.FunctionDef):
                where = f"{path}:{node.lineno}: {node.name}"
                assert _lines_of(node) <= 40, where
                names = [one.arg for one in (*node.args.args, *node.args.kwonlyargs)]
                assert len([name for name in names if name not in ("self", "cls")]) <= 8, where


def _lines_of(function: ast.FunctionDef) -> int:
    """Return the number of lines of a function without its docstring."""
    first = function.body[0]
    is_text = ast.get_docstring(function) is not None
    described = first.end_lineno - first.lineno + 1 if is_text and first.end_lineno else 0
    assert function.end_lineno is not None
    return function.end_lineno - function.lineno + 1 - described


def test_few_modules_handle_the_angle_of_a_ball() -> None:
    """From the scenario to the tables; most modules pass on the object that holds it."""
    assert 5 < len(modules_with_the_angle()) <= 20
