"""Tangent maps of scenes drawn at random against differences of neighbouring motions in 50 digits.

Taken are the scenes of ``drawn`` whose motion has a derivative through its first impacts: at rest,
of two bodies or more that do not touch at the start, none of which comes to rest at a wall, until
the first impact that is not smooth.
"""

from __future__ import annotations

import numpy as np

from vibro_cli.mechanics.system import System
from vibro_cli.simulation.run import simulate_system
from vibro_cli.simulation.tangents import follow_system, time_scale
from vibro_cli.stress.drawing import draw
from vibro_cli.stress.finding import Document, Finding, Plan, Worst
from vibro_cli.stress.scenes import system_of

CHECK = "tangent"
MOST_IMPACTS = 3
# Beyond it the rounding of the motion itself shows in its derivatives.
MOST_GROWTH = 1.0e4


def check(plan: Plan) -> list[Finding]:
    """Errors of maps and of derivatives of instants, as shares of their largest elements."""
    maps, times = Worst(), Worst()
    number, wanted = 0, plan.scenes(4, 200)
    while maps.cases < wanted:
        document = draw(plan.seed, number)
        number += 1
        count = smooth_impacts(document)
        if count:
            document = document | {"stop": {"collisions": count}}
            found = errors_of(system_of(document), count)
            maps.take(found[0], document)
            times.take(found[1], document)
    tried = f"scenes drawn at random, up to {MOST_IMPACTS} impacts, with walls, junctions and laws"
    return [
        maps.finding(CHECK, "error of the tangent map, of its largest element", tried, 1e-10),
        times.finding(CHECK, "error of the instants' derivatives, of the largest", tried, 1e-10),
    ]


def smooth_impacts(document: Document) -> int:
    """Number of first impacts, up to a few, through which a motion has a derivative."""
    balls = document["balls"]
    if "turning" in document["trace"] or len(balls) < 2 or any("touching" in b for b in balls):
        return 0
    system = system_of(document)
    stop = float(document["stop"]["time"])
    found = follow_system(system, stop, MOST_IMPACTS)
    good = found.smooth & (found.amplification < MOST_GROWTH)
    count = len(good) if good.all() else int(np.argmin(good))
    # Lasting contact, and rest at a wall, take directions; the twin knows of neither.
    kept = count > 0 and bool(np.isfinite(follow_system(system, None, count).sums).all())
    return count if kept else 0


def errors_of(system: System, count: int) -> tuple[float, float]:
    """Errors of the map after so many impacts and of their instants' derivatives.

    Ways (m) and speeds, as the way in the time scale of the system, are compared with one another.
    """
    from vibro_cli.stress.highprecision.scene import scene_of_system
    from vibro_cli.stress.highprecision.twin import happenings_of
    from vibro_cli.stress.highprecision.variations import differences

    told = happenings_of(simulate_system(system, None, count))
    found = follow_system(system, None, count)
    matrix, times = differences(scene_of_system(system), told, found.end_time)
    scale = np.tile([1.0, float(time_scale(system))], len(system.bodies))
    matrices = [one * scale[:, None] / scale[None, :] for one in (found.matrix, matrix)]
    instants = [one / scale for one in (found.times, times)]
    return _error(*matrices), _error(*instants)


def _error(found: np.ndarray, exact: np.ndarray) -> float:
    return float(np.max(np.abs(found - exact)) / np.max(np.abs(exact)))
