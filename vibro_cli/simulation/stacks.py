"""Making the records of many systems that differ in numbers only (``kernels.ensemble.stacks``)."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from vibro_cli.compile.kernel import dtype
from vibro_cli.kernels.ensemble.stacks import PairNumbers, SettingNumbers, Stack, SystemNumber
from vibro_cli.kernels.structs import BodyData, PairTrack, PieceData, TrackData
from vibro_cli.kernels.world import World
from vibro_cli.mechanics.system import System
from vibro_cli.simulation.prepare import make_world


def stack_of(system: System, count: int, of_runs: Any) -> Stack:
    """Return the records of ``count`` systems, whose numbers are arrays.

    ``of_runs`` tells the number of the system of each run.
    """
    import numpy as np

    world = make_world(system, None, None, far_apart=False)
    numbers = np.zeros(len(of_runs), dtype=dtype(SystemNumber))
    numbers["number"] = of_runs
    return Stack(
        settings=_rows(world.settings, SettingNumbers, count),
        bodies=_rows(world.bodies, BodyData, count),
        pieces=_rows(world.pieces, PieceData, count),
        tracks=_rows(world.tracks, TrackData, count),
        contacts=_rows(world.contacts, PairTrack, count),
        pairs=_rows(world.pairs, PairNumbers, count),
        of_runs=numbers,  # type: ignore[arg-type]
    )


def own_records(world: World) -> World:
    """Return a compiled world whose records are its own where those of a stack are installed."""
    changed: Any = {
        name: getattr(world, name).copy()
        for name in ("settings", "bodies", "pieces", "tracks", "contacts", "pairs")
    }
    return world._replace(**changed)


def _rows(records: Sequence[Any], cls: type, count: int) -> Any:
    """Records with arrays of ``count`` numbers as rows of plain records, system by system."""
    import numpy as np

    rows = np.zeros((count, len(records)), dtype=dtype(cls))
    for place, one in enumerate(records):
        for name in rows.dtype.names or ():
            rows[name][:, place] = getattr(one, name)
    return rows.reshape(-1)
