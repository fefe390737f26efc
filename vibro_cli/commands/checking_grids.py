"""What `vibro check` tells of grids."""

from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from vibro_cli.grids.document import Grid


def understood_grid(grid: "Grid") -> dict[str, Any]:
    """What a grid means, as plain values; of its points the first and the last are tried."""
    from vibro_cli.grids.axes import unit_of
    from vibro_cli.scenario.problems import path_text

    axes = [
        {
            "paths": [path_text(path) for path in axis.paths],
            "unit": unit_of(axis.kinds[0]),
            "values": len(axis) or None,
            **_ends(axis),
        }
        for axis in grid.design.axes
    ]
    return {
        "name": grid.name,
        "valid": True,
        "grid": grid.resolved(),
        "points": grid.design.points,
        "axes": axes,
        "first_point": _point(grid, 0),
        "last_point": _point(grid, grid.design.points - 1),
    }


def _ends(axis: Any) -> dict[str, Any]:
    """The first and the last value of an axis; the ends of an interval that a design draws from."""
    if axis.interval is not None:
        return {"from": axis.interval[0], "to": axis.interval[1]}
    first, last = (axis.at(index)[0] for index in (0, -1))
    return {"from": _plain(first), "to": _plain(last)}


def _plain(value: Any) -> Any:
    return value.item() if hasattr(value, "item") else value


def _point(grid: "Grid", index: int) -> str | None:
    """Why a point is no valid scenario, None where it is one."""
    import numpy as np

    from vibro_cli.assemble import build_any
    from vibro_cli.grids.points import document_at, reason_of
    from vibro_cli.scenario import ScenarioError, any_scenario_of

    values = {path: column[0] for path, column in grid.design.columns(np.array([index])).items()}
    try:
        build_any(any_scenario_of(document_at(grid.base, values)))
    except ScenarioError as error:
        return reason_of(error)
    return None


def lines_of_grid(found: dict[str, Any]) -> Iterator[str]:
    """What was understood, as text."""
    grid, points = found["grid"], found["points"]
    yield f"{found['name']}: valid grid of {points:,} {'point' if points == 1 else 'points'}"
    yield f"  mode {grid['mode']}"
    for axis in found["axes"]:
        values = "drawn" if axis["values"] is None else f"{axis['values']:,} values"
        ends = " to ".join(_shown(axis[key]) for key in ("from", "to"))
        yield f"  axis {', '.join(axis['paths'])}: {values}, {ends} {axis['unit']}".rstrip()
    kept = grid["keep"]
    columns = "all columns" if kept["columns"] is None else ", ".join(kept["columns"])
    yield "  kept: " + (
        f"summaries and every impact ({columns})" if kept["collisions"] else "summaries"
    )
    for which in ("first", "last"):
        if found[f"{which}_point"] is not None:
            yield f"  warning: the {which} point is invalid: {found[f'{which}_point']}"


def _shown(value: Any) -> str:
    return f"{value:.6g}" if isinstance(value, float) else str(value)
