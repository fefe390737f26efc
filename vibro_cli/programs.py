"""The programs of the library: the kernels called from Python, and their overrides.

``python -m vibro_cli.programs`` rebuilds the library of a source checkout.
"""

from __future__ import annotations

import sys

from vibro_cli.compile.build import BuildError, build
from vibro_cli.compile.kernel import TranslationError
from vibro_cli.compile.native import IF_CHANGED
from vibro_cli.compile.translate import Program
from vibro_cli.kernels.ensemble.lanes import run_points_in_lanes
from vibro_cli.kernels.ensemble.points import follow_points, proceed, run_points
from vibro_cli.kernels.ensemble.records import fill_stacked
from vibro_cli.kernels.events.liftoff_slip import find_passages
from vibro_cli.kernels.flow.flow import sample_flights
from vibro_cli.kernels.numerics.elliptic import fill_angles
from vibro_cli.kernels.rotating import TURNING
from vibro_cli.kernels.statistics.impact_columns import fill_columns
from vibro_cli.kernels.statistics.run_statistics import update_statistics
from vibro_cli.kernels.tangent.follow import follow_tangents
from vibro_cli.kernels.tangent.impact_times import differentiate_impacts
from vibro_cli.stress.kernels import find_first_contacts
from vibro_cli.stress.oracles.interval_oracle import judge_flights
from vibro_cli.systems import NAMES, system_named


def programs() -> list[Program]:
    """Return the programs; those that take longest to compile come first."""
    solving = (
        proceed,
        update_statistics,
        run_points,
        sample_flights,
        find_passages,
        follow_tangents,
        follow_points,
    )
    of_trace = (
        *solving,
        run_points_in_lanes,
        fill_columns,
        fill_stacked,
        fill_angles,
        differentiate_impacts,
        find_first_contacts,
    )
    return [
        Program("trace", of_trace),
        Program("rotating", solving, TURNING),
        *(Program(one.name, one.kernels, flags=one.flags) for one in map(system_named, NAMES[1:])),
        Program("judge", (judge_flights,)),
    ]


if __name__ == "__main__":
    try:
        build(programs(), if_changed=IF_CHANGED in sys.argv)
    except (BuildError, TranslationError, OSError) as error:
        sys.exit(f"vibro: {error}")
