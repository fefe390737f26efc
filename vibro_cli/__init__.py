"""Vibro-impact dynamics of bodies rolling along curvilinear traces, solved exactly.

Names of the Python interface are loaded on first use, so that importing the package is fast::

    from vibro_cli import load_scenario, simulate

    run = simulate(load_scenario("scenarios/three_arcs.toml"))
    run.collisions["t"]

Errors about a scenario, a run, a grid or a folder are subclasses of `VibroError`.
"""

from typing import TYPE_CHECKING, Any

__version__ = "0.2.0"

if TYPE_CHECKING:
    from vibro_cli.analysis.basins import NoBasins as NoBasins
    from vibro_cli.analysis.fit import NoFit as NoFit
    from vibro_cli.analysis.fit import NotMeasured as NotMeasured
    from vibro_cli.analysis.orbits import NoOrbit as NoOrbit
    from vibro_cli.analysis.orbits import Orbit as Orbit
    from vibro_cli.api import NotRecalled as NotRecalled
    from vibro_cli.errors import NoPortrait as NoPortrait
    from vibro_cli.errors import NothingToShow as NothingToShow
    from vibro_cli.errors import VibroError as VibroError
    from vibro_cli.figures.film import NoFilm as NoFilm
    from vibro_cli.grids.dataset import FolderInUse as FolderInUse
    from vibro_cli.grids.dataset import GridChanged as GridChanged
    from vibro_cli.grids.dataset import NoManifest as NoManifest
    from vibro_cli.grids.dataset import Verdict as Verdict
    from vibro_cli.interface import Drawing as Drawing
    from vibro_cli.interface import check as check
    from vibro_cli.interface import example as example
    from vibro_cli.interface import load_scenario as load_scenario
    from vibro_cli.interface import portrait as portrait
    from vibro_cli.interface.analyses import Fit as Fit
    from vibro_cli.interface.analyses import GridBasins as GridBasins
    from vibro_cli.interface.analyses import OrbitFamily as OrbitFamily
    from vibro_cli.interface.analyses import fit as fit
    from vibro_cli.interface.analyses import orbit as orbit
    from vibro_cli.interface.analyses import orbit_family as orbit_family
    from vibro_cli.interface.grids import Grid as Grid
    from vibro_cli.interface.grids import open_grid as open_grid
    from vibro_cli.interface.grids import sweep as sweep
    from vibro_cli.interface.runs import Run as Run
    from vibro_cli.interface.runs import open_run as open_run
    from vibro_cli.interface.runs import simulate as simulate
    from vibro_cli.interface.runs import simulate_many as simulate_many
    from vibro_cli.interface.runs import verify as verify
    from vibro_cli.scenario.base import AnyScenario as AnyScenario
    from vibro_cli.scenario.models import Scenario as Scenario
    from vibro_cli.scenario.problems import ScenarioError as ScenarioError
    from vibro_cli.storage.files import FolderRefused as FolderRefused
    from vibro_cli.storage.folders import NotContinuable as NotContinuable
    from vibro_cli.storage.frame import Table as Table
    from vibro_cli.storage.stored import NotAGrid as NotAGrid
    from vibro_cli.systems.driver import CannotContinue as CannotContinue
    from vibro_cli.systems.driver import TooQuiet as TooQuiet
    from vibro_cli.systems.request import TooManyInstants as TooManyInstants

_HOME = {
    "vibro_cli.analysis.basins": ("NoBasins",),
    "vibro_cli.analysis.fit": ("NoFit", "NotMeasured"),
    "vibro_cli.analysis.orbits": ("NoOrbit", "Orbit"),
    "vibro_cli.api": ("NotRecalled",),
    "vibro_cli.errors": ("NoPortrait", "NothingToShow", "VibroError"),
    "vibro_cli.figures.film": ("NoFilm",),
    "vibro_cli.grids.dataset": ("FolderInUse", "GridChanged", "NoManifest", "Verdict"),
    "vibro_cli.interface": ("Drawing", "check", "example", "load_scenario", "portrait"),
    "vibro_cli.interface.analyses": (
        "Fit",
        "GridBasins",
        "OrbitFamily",
        "fit",
        "orbit",
        "orbit_family",
    ),
    "vibro_cli.interface.grids": ("Grid", "open_grid", "sweep"),
    "vibro_cli.interface.runs": ("Run", "open_run", "simulate", "simulate_many", "verify"),
    "vibro_cli.scenario": ("Scenario", "ScenarioError"),
    "vibro_cli.scenario.base": ("AnyScenario",),
    "vibro_cli.storage.frame": ("Table",),
    "vibro_cli.storage.files": ("FolderRefused",),
    "vibro_cli.storage.folders": ("NotContinuable",),
    "vibro_cli.storage.stored": ("NotAGrid",),
    "vibro_cli.systems.driver": ("CannotContinue", "TooQuiet"),
    "vibro_cli.systems.request": ("TooManyInstants",),
}
_MODULES = {name: module for module, names in _HOME.items() for name in names}

__all__ = ["__version__", *sorted(_MODULES)]


def unsupported() -> str | None:
    """Return why the package cannot be used on this operating system, None if it can."""
    import sys

    system: str = sys.platform  # `str`, as mypy would otherwise evaluate the test below
    if system != "win32":
        return None
    return "vibro runs on Linux and macOS; on Windows it runs within WSL, as on Linux"


def __getattr__(name: str) -> Any:
    """Load a public name from its module (PEP 562).

    Raises `ImportError` on an unsupported operating system.
    """
    if name not in _MODULES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    from importlib import import_module

    reason = unsupported()
    if reason is not None:
        raise ImportError(reason)
    return getattr(import_module(_MODULES[name]), name)


def __dir__() -> list[str]:
    """Return the public names, loaded or not."""
    return sorted(__all__)
