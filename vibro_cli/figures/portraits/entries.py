"""What the legend of a portrait names: marks of the run, and what stands behind them."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from vibro_cli.figures.legend import Entry
from vibro_cli.figures.portraits import layers
from vibro_cli.figures.portraits.background import Background
from vibro_cli.figures.portraits.trajectory import Trajectory


def legend_of(
    path: Trajectory, behind: Background, marked: bool, others: Sequence[Entry] = ()
) -> list[Entry]:
    """Return names and looks of everything on a portrait, `others` after what is of the run."""
    jumps = path.jumps
    entries = [("start", layers.START)]
    if np.any(path.first.made):
        first = "" if marked else f" 1–{path.first.number[-1]}"
        entries += [("before", layers.BEFORE), (f"after impact{first}", layers.AFTER)]
    if not marked and np.any(jumps.made):
        share = f" (1 in {path.every})" if path.every > 1 else ""
        entries.append((f"jump{share}", layers.many_jumps(1)))
    if not np.all(jumps.made):
        entries.append(("inadmissible", layers.NOT_MADE))
    if any(np.any(branches.contact) for branches in path.branches):
        entries.append(("lasting contact", layers.CONTACT))
    return [*entries, *others, *behind_entries(behind)]


def behind_entries(behind: Background) -> list[Entry]:
    """Return names and looks of what stands behind the branches."""
    entries: list[Entry] = []
    if behind.separatrices:
        entries.append(("separatrix", layers.SEPARATRIX))
    if behind.arc_separatrices:
        entries.append(("separatrix of the full circle", layers.ARC_SEPARATRIX))
    if behind.levels:
        entries.append(("level", layers.LEVEL))
    for kind, marker in layers.MARKER.items():
        if any(point.kind == kind for point in behind.points):
            entries.append((kind, layers.POINT | {"marker": marker}))
    return entries


def last_time(path: Trajectory) -> float:
    """Return the time (s) with which the colours of time end: of the body's last impact."""
    made = path.jumps.time[path.jumps.made]
    return float(np.max(made)) if len(made) else path.end
