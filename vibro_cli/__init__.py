"""Vibro-impact dynamics of bodies rolling along curvilinear traces, solved exactly.

The verbs of the Python interface are loaded when they are first asked for, so that importing
the package costs nothing::

    from vibro_cli import load_scenario, simulate

    run = simulate(load_scenario("scenarios/three_arcs.toml"))
    run.collisions["t"]

`load_any` reads scenarios of every system, `load_scenario` those of a trace.
"""

from typing import TYPE_CHECKING, Any

__version__ = "0.1.0"

if TYPE_CHECKING:
    from vibro_cli.api import simulate as simulate
    from vibro_cli.scenario import load_any as load_any
    from vibro_cli.scenario import load_scenario as load_scenario

__all__ = ["__version__", "load_any", "load_scenario", "simulate"]

_HOME = {
    "load_any": "vibro_cli.scenario",
    "load_scenario": "vibro_cli.scenario",
    "simulate": "vibro_cli.api",
}


def __getattr__(name: str) -> Any:
    """Load a public name from the module it lives in (PEP 562)."""
    if name not in _HOME:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    from importlib import import_module

    return getattr(import_module(_HOME[name]), name)


def __dir__() -> list[str]:
    """The public names, loaded or not."""
    return sorted(__all__)
