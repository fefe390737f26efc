"""Analyses in the Python interface: orbits and their families, fits, basins; their figures."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, cast

import numpy as np
import pyarrow as pa

from vibro_cli.analysis import fit as fits
from vibro_cli.analysis.orbit_branch import ENERGY, Branch, family_of
from vibro_cli.analysis.orbits import Orbit, find_orbit
from vibro_cli.assemble import build_any
from vibro_cli.errors import counted
from vibro_cli.interface import Drawing
from vibro_cli.scenario.base import Listed, checked, checked_path, plain
from vibro_cli.scenario.fields import unit_at
from vibro_cli.scenario.problems import parsed_path, shown
from vibro_cli.scenario.quantities import Count, Quantity
from vibro_cli.storage.folders import RESIDUALS, orbits
from vibro_cli.storage.frame import Table
from vibro_cli.storage.tables import to_arrow

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from vibro_cli.analysis.basins import Basins
    from vibro_cli.figures.analyses import Mapped
    from vibro_cli.scenario.base import AnyScenario
    from vibro_cli.scenario.models import Scenario


@dataclass(frozen=True)
class OrbitFamily(Branch):
    """A family of periodic orbits over a parameter of a scenario, from :func:`orbit_family`."""

    scenario: Scenario
    """Scenario with the start of the first orbit."""
    vary: str
    """Path of the parameter, or ``"energy"``."""

    @property
    def unit(self) -> str:
        """Unit of the parameter, empty for a pure number."""
        if self.vary == ENERGY:
            return "J"
        return unit_at(parsed_path(self.vary), type(self.scenario))

    @cached_property
    def table(self) -> Table:
        """One row per orbit, in order along the family, including special orbits."""
        return orbit_table(self, self.scenario)

    def figure(self, width: str = "single") -> Drawing:
        """Draw the period and the modulus of the largest multiplier over the parameter.

        ``width`` is ``"single"`` or ``"double"``: one column of a journal (85 mm) or two (170 mm).
        Raises ``ValueError`` for another width.
        """
        from vibro_cli.figures.analyses import branch_figure, label_of_number
        from vibro_cli.figures.style import width_of

        width_of(width)
        label = label_of_number(self.vary)
        return Drawing("orbits", branch_figure(dict(self.table), label, width))

    def __repr__(self) -> str:
        special = ", ".join(one.kind for one in self.special)
        orbits_of = f"{counted(len(self.points), 'orbit')} over {self.vary}"
        return f"<OrbitFamily of {self.scenario.name}: {orbits_of}; {special}>"


@dataclass(frozen=True, repr=False)
class Fit(fits.Fit):
    """Fitted parameters and their uncertainty, from :func:`fit`."""

    @classmethod
    def of(cls, found: fits.Fit) -> Fit:
        """Return a fit as an object with a table and a figure."""
        return cls(**vars(found))

    @cached_property
    def table(self) -> Table:
        """One row per measured impact: its time, noise and residuals (s)."""
        columns = {
            "n": self.measured.number,
            "t": self.measured.t,
            "noise": self.noise,
            "residual": self.residuals,
            "first": self.first,
        }
        return Table("residuals", to_arrow(RESIDUALS, columns, self.scenario.resolved()))

    def figure(self) -> Drawing:
        """Draw the residuals before and after the fit over the number of the impact."""
        from vibro_cli.figures.analyses import fit_figure

        return Drawing("residuals", fit_figure(dict(self.table)))


@dataclass(frozen=True)
class GridBasins:
    """The outcomes of the points of a grid, from ``grid.basins()``."""

    mapped: Mapped = field(repr=False)
    """Outcomes and basins on the lattice of the grid."""

    @property
    def basins(self) -> Basins:
        """Fractions of the outcomes, entropies, uncertainty exponent."""
        return self.mapped.basins

    @property
    def doubt(self) -> str:
        """Why outcomes may not be final; empty if few runs were ended by a stop."""
        return self.mapped.doubt

    def map(self, width: str = "double") -> Drawing | None:
        """Draw the map of the outcomes, None over one axis; ``ValueError`` for an invalid width."""
        drawn = self.mapped.map(width)
        return None if drawn is None else Drawing("basins", drawn)

    def scaling(self, width: str = "single") -> Drawing | None:
        """Draw the fraction of points with another outcome within a distance; None without any.

        Raises ``ValueError`` for an invalid width.
        """
        drawn = self.mapped.scaling(width)
        return None if drawn is None else Drawing("uncertainty", drawn)

    def __repr__(self) -> str:
        found = self.basins
        outcomes = counted(len(found.outcomes), "outcome")
        exponent = "" if found.exponent is None else f", uncertainty exponent {found.exponent}"
        doubt = f"; warning: {self.doubt}" if self.doubt else ""
        return f"<GridBasins: {outcomes}, basin entropy {found.entropy}{exponent}{doubt}>"


def orbit(scenario: AnyScenario, impacts: int | None = None, period: float | None = None) -> Orbit:
    """Find the periodic orbit of impacts near the start of a scenario, as ``vibro orbit`` does.

    Parameters
    ----------
    scenario
        Scenario of a trace, with k = 1.
    impacts, period
        Number of impacts per period, or a guess of the period (s), not both; by default taken from
        the nearest return.

    Raises
    ------
    NoOrbit
        If no orbit is found.
    ScenarioError, ValueError
        If the scenario is mechanically impossible, or of another system; for another number.
    TooQuiet
        As :func:`simulate`, of a scenario without ``stop.time``.
    """
    if impacts is not None:
        impacts = checked("impacts", impacts, Count())
    if period is not None:
        period = checked("period", period, Quantity(above=0.0))
    if impacts is not None and period is not None:
        raise ValueError("found impacts and period, expected one of them")
    system = _system_of_trace(scenario)
    return find_orbit(system, impacts, period, scenario.stop.time)


def orbit_family(
    scenario: AnyScenario, found: Orbit, vary: str, low: float, high: float
) -> OrbitFamily:
    """Follow a periodic orbit over a parameter of its scenario, as ``vibro orbit --vary`` does.

    Parameters
    ----------
    scenario, found
        The scenario, and its :func:`orbit`.
    vary, low, high
        Path of the parameter, such as ``"balls[2].mass"``, and its range (SI units, radians); or
        ``"energy"`` (J).

    Raises as :func:`orbit`.
    """
    if not isinstance(found, Orbit):
        raise TypeError(
            f"found: found {shown(found)}, expected an orbit: orbit(scenario) finds one"
        )
    _system_of_trace(scenario)
    low, high = checked("low", low, Quantity()), checked("high", high, Quantity())
    if not low < high:
        raise ValueError(f"{vary}: found {low!r} to {high!r}, expected an ascending range")
    of_trace = cast("Scenario", scenario)
    branch = family_of(of_trace, found, vary, low, high)
    return OrbitFamily(branch.points, branch.special, found.as_start(of_trace), vary)


def _system_of_trace(scenario: AnyScenario) -> Any:
    """Return the system of a scenario, which must be of a trace."""
    from vibro_cli.systems import system_named

    system = build_any(scenario)
    if not system_named(scenario.system).has_orbits:
        raise ValueError(f"found a scenario of {scenario.system}, expected one of a trace")
    return system


def fit(
    scenario: AnyScenario,
    measured: str | Path | Mapping[str, Any] | Table | ArrayLike,
    free: Sequence[str] | Mapping[str, tuple[float, float]],
    noise: float | None = None,
) -> Fit:
    """Fit parameters of a scenario of a trace at rest to measured times of impacts.

    Parameters
    ----------
    scenario
        Scenario with the initial values.
    measured
        The times (s); a table with the column ``t`` and optionally ``n``, ``error``, ``ball_a``,
        ``ball_b``, such as that of a run, a pyarrow table or a data frame; or a CSV or Parquet
        file, as for ``vibro fit``.
    free
        Paths of the parameters, such as ``"collision.k"``, or their bounds by path (SI units,
        radians); ``"start_time"`` for the time (s) of the start, if it is not 0.
    noise
        Standard deviation of the times (s), if known and not in the table.

    Raises
    ------
    NoFit
        If the parameters cannot be fitted to these times.
    NotMeasured
        If the table has no valid times.
    ScenarioError, ValueError
        If the scenario is mechanically impossible or of another system; for an invalid path, and
        for bounds that are not two numbers.
    """
    _system_of_trace(scenario)
    if isinstance(free, Mapping):
        numbers = [fits.Free.of(path, *_ends(path, free[path])) for path in free]
    else:
        numbers = [fits.Free.of(path) for path in checked("free", free, Listed("paths"))]
    from_start = not fits.has_start_time(numbers)
    if isinstance(measured, (str, Path)):
        found = fits.read_measured(checked_path("measured", measured), from_start)
    else:
        found = fits.measured_of(_columns_of(measured), from_start)
    return Fit.of(fits.fit_impacts(cast("Scenario", scenario), found, numbers, noise))


def _ends(path: str, bounds: Any) -> tuple[Any, Any]:
    """Return the two bounds of a number, possibly infinite; raises ``ValueError`` for others."""
    found = plain(bounds)
    if not isinstance(found, list) or len(found) != 2:
        raise ValueError(f"{path}: found {shown(found)}, expected two bounds, low and high")
    return found[0], found[1]


def _columns_of(measured: Any) -> Mapping[str, Any]:
    """Return the columns of a mapping, table or data frame by name; plain times become ``t``."""
    if isinstance(measured, pa.RecordBatch):
        measured = pa.Table.from_batches([measured])
    if isinstance(measured, pa.Table):
        measured = Table("measured", measured)
    if getattr(measured, "ndim", None) == 1:  # includes pandas series, whose keys are row labels
        return {"t": measured}
    names = measured.keys() if hasattr(measured, "keys") else getattr(measured, "columns", None)
    found = {"t": measured} if names is None else {name: measured[name] for name in names}
    arrow = (pa.Array, pa.ChunkedArray)  # their entries are not Python numbers
    return {
        name: column.to_pylist() if isinstance(column, arrow) else column
        for name, column in found.items()
    }


def orbit_table(found: Orbit | OrbitFamily, scenario: Scenario) -> Table:
    """Return the table of a family or of a single orbit of a scenario."""
    columns = orbit_columns(found)
    first = found if isinstance(found, Orbit) else found.points[0].orbit
    pieces = first.system.trace.pieces
    lines = [
        {pieces[arc - 1].is_line for arc in columns[f"arc_{ball}"]}
        for ball in range(1, len(scenario.balls) + 1)
    ]
    # A body whose orbits start on arcs and on lines has positions of either unit.
    positions = ["" if len(both) > 1 else "m" if True in both else "rad" for both in lines]
    table = orbits("" if isinstance(found, Orbit) else found.unit, positions)
    return Table("orbits", to_arrow(table, columns, scenario.resolved()))


def orbit_columns(found: Orbit | Branch) -> dict[str, Any]:
    """Return the columns of ``orbits.parquet`` for a family or a single orbit."""
    points: list[tuple[float, Orbit, str]] = []
    if isinstance(found, Orbit):
        points = [(float("nan"), found, "")]
    else:
        for n, point in enumerate(found.points):
            here = [one for one in found.special if one.after == n]
            if all(one.point is not point for one in here):
                points.append((point.value, point.orbit, ""))
            points += [(one.point.value, one.point.orbit, one.kind) for one in here]
    orbits_of = [orbit for _, orbit, _ in points]
    columns: dict[str, Any] = {
        "value": np.array([value for value, *_ in points]),
        "special": np.array([kind or None for *_, kind in points], dtype=object),
        "period": np.array([one.period for one in orbits_of]),
        "energy": np.array([one.energy for one in orbits_of]),
        "residual": np.array([one.residual for one in orbits_of]),
        "multiplier": np.array([float(abs(one.multipliers[0])) for one in orbits_of]),
        "stable": np.array([one.stable for one in orbits_of]),
        "least_speed": np.array([one.shot.approach for one in orbits_of]),
        "word": np.array([" ".join(one.shot.word) for one in orbits_of], dtype=object),
    }
    for body, _ in enumerate(orbits_of[0].system.bodies):
        starts = [one.system.initial[body] for one in orbits_of]
        columns[f"arc_{body + 1}"] = np.array([start.piece + 1 for start in starts])
        columns[f"position_{body + 1}"] = np.array([start.position for start in starts])
        columns[f"speed_{body + 1}"] = np.array([start.speed for start in starts])
    return columns
