"""Scenarios as Python reads, checks and draws them; their periodic orbits and fits."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, cast

from vibro_cli.assemble import build_any, warnings_of
from vibro_cli.interface import Drawing
from vibro_cli.scenario import gallery
from vibro_cli.scenario.base import Listed, Texts, checked, checked_path, plain
from vibro_cli.scenario.loading import any_scenario_of, load_any, parse_document
from vibro_cli.scenario.problems import shown
from vibro_cli.scenario.quantities import Count, Quantity, Text

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path
    from typing import Any

    from numpy.typing import ArrayLike

    from vibro_cli.analysis.fit import Fit
    from vibro_cli.analysis.orbit_branch import Branch
    from vibro_cli.analysis.orbits import Orbit
    from vibro_cli.scenario.base import AnyScenario
    from vibro_cli.scenario.models import Scenario


def example(name: str) -> AnyScenario:
    """Return a scenario of the gallery, such as ``"three_arcs"``: what ``vibro new`` writes.

    Raises ``ScenarioError`` with the names there are.
    """
    checked("name", name, Text("the name of a scenario of the gallery, a text"))
    return any_scenario_of(parse_document(gallery.text(name), "toml", f"{name}.toml", name))


def load_scenario(source: str | Path, overrides: Sequence[str] = ()) -> AnyScenario:
    """Read a scenario of any system from a file in TOML, JSON or YAML, told by its suffix.

    Parameters
    ----------
    source
        The file; ``"-"`` is standard input.
    overrides
        Values to change as ``--set`` takes them, such as ``"balls[1].angle=-60 deg"``.

    Raises
    ------
    ScenarioError
        With everything that is wrong with it, each with line and column.
    OSError
        If the file cannot be read.
    """
    texts = checked("overrides", overrides, Texts("texts path=value"))
    return load_any(checked_path("source", source), texts)


def check(scenario: AnyScenario) -> tuple[str, ...]:
    """Check the mechanics of a scenario without running it; return what is doubtful about it.

    Raises ``ScenarioError`` with everything that makes it impossible.
    """
    return warnings_of(scenario, build_any(scenario))


def portrait(scenario: AnyScenario, body: int = 1, width: str = "double") -> Drawing:
    """Draw the phase portrait of a body without a run, as ``vibro portrait`` does.

    Level curves and separatrices in closed form, centres and saddles; on a trace the figure eight.

    Parameters
    ----------
    scenario
        Of any system; of a table, one within an ellipse or a circle.
    body
        The body, from 1.
    width
        ``"single"`` or ``"double"``: one column of a journal (85 mm) or two (170 mm).

    Raises
    ------
    ScenarioError
        If the scenario is mechanically impossible.
    ValueError
        For another body or width, and for a table without a portrait.
    """
    from vibro_cli.systems import system_named

    system = build_any(scenario)
    bodies = len(system.bodies)
    body = checked("body", body, Count(1, bodies))
    _, figures = system_named(scenario.system).portrait(system, width, True)
    for stem, figure in figures.items():
        if str(body) in stem.split("_"):  # equal bodies share one: portrait_1_2
            return Drawing(stem, figure)
    radii = [one.radius for one in system.bodies]  # balls of a table do by their radius alone
    first = f"portrait_{radii.index(radii[body - 1]) + 1}"
    return Drawing(first, figures[first])


def orbit(scenario: AnyScenario, impacts: int | None = None, period: float | None = None) -> Orbit:
    """Find the periodic orbit of impacts next to the start of a scenario, as ``vibro orbit`` does.

    Parameters
    ----------
    scenario
        Of a trace, with k = 1.
    impacts, period
        Impacts of one period, or a guess of the period (s); by default those of the nearest return.

    Raises
    ------
    NoOrbit
        If there is none.
    ScenarioError, ValueError
        If the scenario is mechanically impossible, or of another system; for another number.
    """
    from vibro_cli.analysis.orbits import find_orbit

    if impacts is not None:
        impacts = checked("impacts", impacts, Count())
    if period is not None:
        period = checked("period", period, Quantity(above=0.0))
    system = _system_of_trace(scenario)
    return find_orbit(system, impacts, period, scenario.stop.time or 1000.0)


def orbit_family(scenario: AnyScenario, found: Orbit, vary: str, low: float, high: float) -> Branch:
    """Follow a periodic orbit over a number of its scenario, as ``vibro orbit --vary`` does.

    Parameters
    ----------
    scenario, found
        The scenario, and its :func:`orbit`.
    vary, low, high
        Path of the number, such as ``"balls[2].mass"``, and its range (SI units, radians); or
        ``"energy"`` (J).

    Raises as :func:`orbit`.
    """
    from vibro_cli.analysis.orbit_branch import family_of
    from vibro_cli.analysis.orbits import Orbit

    if not isinstance(found, Orbit):
        raise TypeError(
            f"found: found {shown(found)}, expected an orbit: orbit(scenario) finds one"
        )
    _system_of_trace(scenario)
    low, high = checked("low", low, Quantity()), checked("high", high, Quantity())
    if not low < high:
        raise ValueError(f"{vary}: found {low!r} to {high!r}, expected a range that grows")
    return family_of(cast("Scenario", scenario), found, vary, low, high)


def _system_of_trace(scenario: AnyScenario) -> Any:
    """The checked system of a scenario, which has to be of a trace."""
    from vibro_cli.systems import system_named

    system = build_any(scenario)
    if not system_named(scenario.system).has_orbits:
        raise ValueError(f"found a scenario of {scenario.system}, expected one of a trace")
    return system


def fit(
    scenario: AnyScenario,
    measured: str | Path | Mapping[str, Any] | ArrayLike,
    free: Sequence[str] | Mapping[str, tuple[float, float]],
    noise: float | None = None,
) -> Fit:
    """Fit numbers of a scenario of a trace at rest to measured instants of impacts.

    Parameters
    ----------
    scenario
        With the values to begin with.
    measured
        The instants (s), a table with them (``t``, and if wanted ``n``, ``error``, ``ball_a``,
        ``ball_b``) such as that of a run or a frame, or a CSV or parquet file, as for ``vibro
        fit``.
    free
        Paths of the numbers, such as ``"collision.k"``, or their bounds by their paths (SI units,
        radians).
    noise
        Standard deviation of the instants (s), if it is known and stands not in the table.

    Raises
    ------
    NoFit
        If the numbers cannot be fitted to these instants.
    NotMeasured
        If the table does not tell of instants.
    ScenarioError, ValueError
        If the scenario is mechanically impossible or of another system; for a text that is no path,
        and for bounds that are not two numbers.
    """
    from vibro_cli.analysis.fit import Free, fit_impacts, measured_of, read_measured

    _system_of_trace(scenario)
    if isinstance(free, Mapping):
        numbers = [Free.of(path, *_ends(path, free[path])) for path in free]
    else:
        numbers = [Free.of(path) for path in checked("free", free, Listed("paths"))]
    if isinstance(measured, (str, Path)):
        told = read_measured(measured)
    else:
        told = measured_of(_columns_of(measured))
    return fit_impacts(cast("Scenario", scenario), told, numbers, noise)


def _ends(path: str, bounds: Any) -> tuple[Any, Any]:
    """The two bounds of a number, which may be infinite; raises ``ValueError``."""
    found = plain(bounds)
    if not isinstance(found, list) or len(found) != 2:
        raise ValueError(f"{path}: found {shown(found)}, expected two bounds, low and high")
    return found[0], found[1]


def _columns_of(measured: Any) -> Mapping[str, Any]:
    """The columns of a mapping, a table or a frame by their names; instants alone as ``t``."""
    names = measured.keys() if hasattr(measured, "keys") else getattr(measured, "columns", None)
    return {"t": measured} if names is None else {name: measured[name] for name in names}
