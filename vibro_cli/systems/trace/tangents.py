"""The tangent map of a run on a trace: the growth of a small perturbation of its start.

Equations: docs/tangent.md. The state of a body is the displacement along the path of its centre (m)
and its speed (m/s); both are continuous at junctions.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vibro_cli.kernels.world import Flight, World
from vibro_cli.mechanics.system import TraceSystem
from vibro_cli.numerics.elementwise import Floats, greatest_of
from vibro_cli.systems import tangents
from vibro_cli.systems.contract import Columns
from vibro_cli.systems.driver import with_logs, zeros
from vibro_cli.systems.request import Limits
from vibro_cli.systems.run import Run, Stretch, begun
from vibro_cli.systems.tangents import Growth
from vibro_cli.systems.trace import SYSTEM
from vibro_cli.systems.trace.world import make_world


def time_scale(system: TraceSystem) -> Any:
    """Return the time scale (s) of tangent maps: √(κρ/g) of body 1 on the widest arc.

    On lines alone, ρ is ten times its radius. For a system of arrays the scale is an array.
    """
    body = system.bodies[0]
    arcs = [piece for piece in system.trace.pieces if not piece.is_line]
    length: Any = 10.0 * body.radius
    if arcs:
        length = greatest_of([piece.path_radius(body.radius) for piece in arcs])
    return np.sqrt(body.kappa * length / system.gravity)


class TangentMap(tangents.TangentMap):
    """The tangent map of a run on a trace in progress.

    With `times`, the derivatives of the times of impacts are computed too.
    """

    def __init__(self, system: TraceSystem, times: bool = False) -> None:
        super().__init__(SYSTEM, system, float(time_scale(system)), times)

    def take(self, world: World, stretch: Stretch) -> Columns:
        """Follow a stretch whose logs `world` has, see `systems.tangents.TangentMap.go_on`."""
        instants = stretch.logs["impacts"]["t"]
        return self.go_on(world, stretch.known, stretch, instants, zeros(1, Flight))


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
    followed = TangentMap(run.system)
    _take_whole(followed, run.system, run.whole)
    return followed.matrix()


def _take_whole(followed: TangentMap, system: TraceSystem, whole: Stretch) -> Columns:
    """Follow a run that is one stretch; return the columns of its impacts."""
    world = make_world(system)
    return followed.take(
        with_logs(SYSTEM.loop, world, whole.engine, whole.logs, whole.clock), whole
    )


def follow_system(
    system: TraceSystem,
    stop_time: float | None,
    stop_collisions: int | None,
    engine_name: str = "compiled",
) -> TangentRun:
    """Solve a system and its tangent map; arguments as for ``systems.trace.simulate_system``."""
    followed = TangentMap(system, times=True)
    limits = Limits(stop_time, stop_collisions)
    whole, _ = begun(SYSTEM, system, limits, engine_name).whole()
    columns = _take_whole(followed, system, whole)
    return TangentRun(
        end_time=whole.end[0],
        matrix=followed.matrix(),
        sums=followed.sums,
        growth=followed.growth,
        **columns,
    )
