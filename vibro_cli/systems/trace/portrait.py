"""Phase portraits of the bodies on a trace, without a run, and their singular points as text."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence
from typing import Any

from matplotlib.figure import Figure

from vibro_cli.analysis.levels import Landscape
from vibro_cli.analysis.singular import as_record, portrait_of
from vibro_cli.figures.portraits.trace_phase_plane import family, structure
from vibro_cli.mechanics.system import TraceSystem
from vibro_cli.progress import WORK

_LONGEST_NAME = 240
"""Longest list of body numbers in a file name; file systems allow 255 characters in all."""


def portrait(
    system: TraceSystem, width: str, drawn: Collection[int]
) -> tuple[dict[str, Any], dict[str, Figure]]:
    """Return the singular points of all bodies, and figures of the bodies `drawn` (from 1).

    Equal bodies share a figure.
    """
    portraits = [portrait_of(Landscape.of(system, n + 1)) for n in range(len(system.bodies))]
    groups: dict[tuple[float, float], list[int]] = {}
    for ball, one in enumerate(portraits, 1):
        body = one.landscape.body
        groups.setdefault((body.radius, body.kappa), []).append(ball)
    figures: dict[str, Figure] = {}
    for balls in (some for some in groups.values() if not set(some).isdisjoint(drawn)):
        index = ",".join(map(str, balls))
        name = index.replace(",", "_")
        if len(name) > _LONGEST_NAME:
            index, name = f"{balls[0]},…", f"{balls[0]}_and_{len(balls) - 1}_others"
        WORK.report(f"portrait_{name}")
        figure = structure(portraits[balls[0] - 1], width, index if len(groups) > 1 else "")
        figures[f"portrait_{name}"] = figure
    bodies = [{"ball": n, **as_record(one)} for n, one in enumerate(portraits, 1)]
    return {"bodies": bodies}, figures


def point_lines(body: dict[str, Any]) -> Iterator[str]:
    """Return the singular points of a body as lines of text."""
    yield "  point  kind        arc  angle [rad]         s [m]         E [J]   E/(m g) [m]"
    for point in body["points"]:
        angle = "         -" if point["angle"] is None else f"{point['angle']:10.6f}"
        yield (
            f"  {point['name']:5}  {point['kind']:10}  {point['arc']:3}  {angle}  "
            f"{point['s']:12.7g}  {point['energy']:12.6g}  {point['height']:12.6g}"
        )
    for trigger in body["triggers"]:
        yield f"  {trigger['points']}: {trigger['orbit']}; {trigger['condition']}"


def family_type(system: TraceSystem, ball: int) -> str:
    """Return the type of the portrait of a body (from 1)."""
    return portrait_of(Landscape.of(system, ball)).type


def family_figure(members: Sequence[tuple[str, TraceSystem]], ball: int, width: str) -> Figure:
    """Draw the portraits of a body (from 1) in several systems, each under its title."""
    portraits = [(title, portrait_of(Landscape.of(one, ball))) for title, one in members]
    return family(portraits, width)
