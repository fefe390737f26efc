"""The tangent map of a run on a trace: the growth of a small perturbation of its start.

Equations: docs/tangent.md. The state of a body is the displacement along the path of its centre (m)
and its speed (m/s); both are continuous at junctions.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from vibro_cli.mechanics.system import TraceSystem
from vibro_cli.numerics.elementwise import Floats
from vibro_cli.systems.request import Limits
from vibro_cli.systems.run import Run
from vibro_cli.systems.tangents import Growth, TangentMap, followed
from vibro_cli.systems.trace import SYSTEM


@dataclass(frozen=True)
class TangentRun:
    """The tangent map of a finished run."""

    end_time: float
    """Time of the end (s)."""
    amplification: Floats
    smooth: NDArray[np.bool_]
    times: Floats
    """[impact, 2 body + 0 or 1]: derivatives of the times of impacts (s) with respect to initial
    displacements and speeds (m, m/s)."""
    matrix: Floats
    """Derivative of the displacements and speeds of all bodies at the end with respect to those at
    the start."""
    sums: Floats
    """Logarithms of the growth of an orthonormal frame's vectors until the end."""
    growth: Growth


def matrix_of(run: Run) -> Floats:
    """Return the tangent map of a whole run, in displacements (m) and speeds (m/s)."""
    found = TangentMap(SYSTEM, run.system)
    found.take(run.whole)
    return found.matrix()


def follow_system(
    system: TraceSystem,
    stop_time: float | None,
    stop_collisions: int | None,
    engine_name: str = "compiled",
) -> TangentRun:
    """Solve a system and its tangent map; arguments as for ``systems.trace.simulate_system``."""
    limits = Limits(stop_time, stop_collisions)
    found, columns, whole = followed(SYSTEM, system, limits, engine_name, times=True)
    return TangentRun(
        end_time=whole.end[0],
        matrix=found.matrix(),
        sums=found.sums,
        growth=found.growth,
        **columns["collisions"],
    )
