"""Periodic orbits and fits as Python asks for them."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, cast

from vibro_cli.assemble import build_any

if TYPE_CHECKING:
    from collections.abc import Sequence
    from typing import Any

    from numpy.typing import ArrayLike

    from vibro_cli.analysis.fit import Fit
    from vibro_cli.analysis.orbit_branch import Branch
    from vibro_cli.analysis.orbits import Orbit
    from vibro_cli.scenario.base import AnyScenario
    from vibro_cli.scenario.models import Scenario


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
        If the scenario is mechanically impossible, or of another system.
    """
    from vibro_cli.analysis.orbits import find_orbit

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

    _system_of_trace(scenario)
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
        ``ball_b``), or a CSV or parquet file, as for ``vibro fit``.
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
        If the scenario is mechanically impossible or of another system; for a text that is no path.
    """
    from vibro_cli.analysis.fit import Free, fit_impacts, measured_of, read_measured

    _system_of_trace(scenario)
    bounds: Any = free.items() if isinstance(free, Mapping) else [(path, ()) for path in free]
    numbers = [Free.of(path, *ends) for path, ends in bounds]
    if isinstance(measured, (str, Path)):
        told = read_measured(measured)
    else:
        told = measured_of(measured if isinstance(measured, Mapping) else {"t": measured})
    return fit_impacts(cast("Scenario", scenario), told, numbers, noise)
