"""The direction of imports, read from the source: every layer imports only from those below it."""

import ast
import sys
import tomllib
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
PACKAGE = ROOT / "vibro_cli"

# From top to bottom: each line may import from itself and from the lines below it. systems,
# simulation, mechanics and numerics know nothing of scenario/, and scenario/ nothing of them; only
# build/ knows both.
LAYERS = (
    "commands",
    "report",
    "figures",
    "benchmark",
    "stress",
    "analysis",
    "grids",
    "storage",
    "api",
    "build",
    "scenario",
    "systems",
    "simulation",
    "mechanics",
    "numerics",
)
STRANGERS = {
    "scenario": {"systems", "simulation", "mechanics", "numerics"},
    "systems": {"scenario"},
    "simulation": {"scenario"},
    "mechanics": {"scenario"},
    "numerics": {"scenario"},
}
SOLVER = ("systems", "simulation", "mechanics", "numerics")
NOT_IN_THE_SOLVER = {"pydantic", "pyarrow", "matplotlib", "typer", "ruamel"}
KERNEL_CACHE = {PACKAGE / f"numerics/{name}.py" for name in ("machine_code", "cache")}
HALVES = {"llvmlite": "numba", "pydantic_core": "pydantic", "PIL": "pillow"}  # one release
LIGHT = ("__init__.py", "__main__.py", "commands")
HEAVY = {"numpy", "scipy", "numba", "pyarrow", "matplotlib", "pydantic", "ruamel"}
STANDS_APART = {"__init__", "__main__"}  # they hand over to other modules and are no layer

SOURCES = sorted(path for path in PACKAGE.rglob("*.py"))


def layer(path: Path) -> str:
    """The layer a file belongs to."""
    return path.relative_to(PACKAGE).parts[0].removesuffix(".py")


def imports(path: Path, at_module_level_only: bool = False) -> Iterator[str]:
    """Full names of what a file imports; imports for type checking only do not count as loading."""
    tree = ast.parse(path.read_text(encoding="utf-8"))
    for node in _loaded_at_import(tree) if at_module_level_only else ast.walk(tree):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{path}: relative imports hide the layer"
            assert node.module is not None
            yield from (f"{node.module}.{alias.name}" for alias in node.names)


def _loaded_at_import(tree: ast.AST) -> Iterator[ast.AST]:
    for node in ast.iter_child_nodes(tree):
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef | ast.Lambda):
            continue
        if isinstance(node, ast.If) and "TYPE_CHECKING" in ast.dump(node.test):
            continue
        yield node
        yield from _loaded_at_import(node)


def own_layers(path: Path) -> set[str]:
    """The layers a file imports from, anywhere in it."""
    parts = (name.split(".") for name in imports(path) if name.startswith("vibro_cli."))
    return {part[1] for part in parts} - {"__version__"}


def test_there_is_something_to_check() -> None:
    assert {"commands", "storage", "scenario", "mechanics", "numerics"} <= set(map(layer, SOURCES))


@pytest.mark.parametrize("path", SOURCES, ids=lambda path: str(path.relative_to(PACKAGE)))
def test_imports_go_down_only(path: Path) -> None:
    here = layer(path)
    if here in STANDS_APART:
        return
    below = set(LAYERS[LAYERS.index(here) :]) - STRANGERS.get(here, set())
    assert own_layers(path) <= below


@pytest.mark.parametrize("path", SOURCES, ids=lambda path: str(path.relative_to(PACKAGE)))
def test_the_solver_knows_no_files_and_no_figures(path: Path) -> None:
    if layer(path) in SOLVER:
        found = {name.split(".")[0] for name in imports(path)}
        files = set() if path in KERNEL_CACHE else {"pathlib", "json", "tomllib"}
        assert not found & (NOT_IN_THE_SOLVER | files)


def test_only_build_knows_both_scenario_and_mechanics() -> None:
    upper = set(LAYERS[: LAYERS.index("build")])
    both = {
        str(path.relative_to(PACKAGE))
        for path in SOURCES
        if layer(path) not in upper and {"scenario", "mechanics"} <= own_layers(path)
    }
    assert all(path.startswith("build/") for path in both)


@pytest.mark.parametrize("path", SOURCES, ids=lambda path: str(path.relative_to(PACKAGE)))
def test_what_every_command_line_loads_is_light(path: Path) -> None:
    relative = str(path.relative_to(PACKAGE))
    if relative.startswith(LIGHT) and relative.count("/") == (layer(path) == "commands"):
        loaded = set(imports(path, at_module_level_only=True))
        assert not {name.split(".")[0] for name in loaded} & HEAVY
        own = {name.split(".")[1] for name in loaded if name.startswith("vibro_cli.")}
        assert own <= {"commands", "__version__"}


@pytest.mark.parametrize("path", SOURCES, ids=lambda path: str(path.relative_to(PACKAGE)))
def test_commands_are_imported_by_nobody(path: Path) -> None:
    if layer(path) not in {"commands", "__main__"}:
        assert "commands" not in own_layers(path)


def test_every_library_that_is_imported_is_declared() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    extras = project["optional-dependencies"]
    required = [*project["dependencies"], *extras["dask"], *extras["stress"], *extras["peers"]]
    declared = {text.split(">")[0].split("[")[0].split(".")[0] for text in required}
    found = {name.split(".")[0] for path in SOURCES for name in imports(path)}
    found = {HALVES.get(name, name) for name in found}
    assert found - set(sys.stdlib_module_names) - {"vibro_cli"} <= declared | {"dask"}
