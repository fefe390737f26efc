"""The table of collisions from the log of impacts."""

from __future__ import annotations

from typing import Any

import numpy as np

from vibro_cli.mechanics.laws import LAW_NAMES
from vibro_cli.simulation.geometry import Floats, Places

_EPSILON = 2.0**-52
# An impact whose overlap, had it not happened, would have stayed below this many units in the last
# place of the positions cannot be told from a passing touch.
_GRAZING_UNITS = 16.0

_ENDS = ("a", "b")


def collision_table(
    places: Places, log: Any, counts: Any = None, masses: Any = None
) -> dict[str, Any]:
    """Return the columns of ``collisions.parquet``, of one run or of several of one system.

    Parameters
    ----------
    places
        Geometry of the system.
    log
        Impacts, run by run.
    counts
        How many there are of each run; None for a single run.
    masses
        Masses (kg) of the bodies of each impact's run; None for those of the system.
    """
    counts = np.array([len(log)]) if counts is None else counts
    trace = places.system.trace
    two_on_closed = trace.closed and len(places.system.bodies) == 2
    side = _side(places, log) if two_on_closed else None
    rows = _from_left(log) if two_on_closed else log
    starts = np.cumsum(counts) - counts
    table: dict[str, Any] = {"n": np.arange(len(rows)) + 1 - np.repeat(starts, counts)}
    table["t"] = rows["t"].copy()
    table["t_low"] = rows["t_low"].copy()
    table["dt"] = _intervals(rows)
    table["dt"][starts[counts > 0]] = np.nan
    table["ball_a"] = rows["a"] + 1
    table["ball_b"] = rows["b"] + 1
    if side is not None:
        table["side"] = side
    table["arc_a"] = rows["piece_a"] + 1
    table["arc_b"] = rows["piece_b"] + 1
    table.update(_places(places, rows))
    mass = {end: _masses(places, rows[end], masses) for end in _ENDS}
    table.update(_speeds(places, rows, mass))
    table["energy_loss"] = rows["loss"].copy()
    b = rows["b"]
    inertia = places.kappa[b] * mass["b"] * places.body_radius[b]
    table["impulse_moment"] = inertia * (rows["speed_b_post"] - rows["speed_b_pre"])
    approach = log["normal_a"] * log["speed_a_pre"] - log["normal_b"] * log["speed_b_pre"]
    parting = log["normal_b"] * log["speed_b_post"] - log["normal_a"] * log["speed_a_post"]
    table["approach_speed"] = approach
    table["separation_speed"] = parting
    table["gap"] = residual_gap(places, log)
    table["law"] = np.array(LAW_NAMES, dtype=object)[rows["law"]]
    table["admissible"] = rows["admissible"] == 1
    table["substituted"] = rows["substituted"] == 1
    table["simultaneous"] = rows["simultaneous"] == 1
    table["grazing"] = _grazing(places, rows, approach, table)
    table["contact"] = rows["contact"] == 1
    return table


def _intervals(rows: Any) -> Floats:
    """Time since the row before, from both doubles; nan in the first row."""
    result = np.full(len(rows), np.nan)
    result[1:] = np.diff(rows["t"]) + np.diff(rows["t_low"])
    return result


def _side(places: Places, log: Any) -> Any:
    """+1 where body 2 is met ahead of body 1, -1 where from behind (two bodies, closed trace)."""
    s_a, s_b = (
        places.arc_length(piece, places.position(piece, log[f"{end}_s"], log[f"{end}_c"]))
        for end, piece in ((end, log[f"piece_{end}"]) for end in _ENDS)
    )
    ahead = np.where(log["a"] == 0, s_b - s_a, s_a - s_b) % places.system.trace.length
    near = np.where(ahead <= 0.5 * places.system.trace.length, 1, -1)
    same = log["piece_a"] == log["piece_b"]
    return np.where(same, np.where(log["a"] == 0, 1, -1), near)


def _from_left(log: Any) -> Any:
    """Rows with body 1 first, whichever pair found the contact."""
    rows = log.copy()
    swap = log["a"] == 1
    names = [name for name in log.dtype.names if _other(name) in log.dtype.names]
    for name in names:
        rows[name][swap] = log[_other(name)][swap]
    return rows


def _other(name: str) -> str:
    """Name of the same quantity of the other body."""
    parts = name.split("_")
    swapped = [{"a": "b", "b": "a"}.get(part, part) for part in parts]
    return "_".join(swapped) if swapped != parts else ""


def _places(places: Places, rows: Any) -> dict[str, Any]:
    columns: dict[str, Any] = {}
    position, centre = {}, {}
    for end in _ENDS:
        body, piece, s, c = rows[end], rows[f"piece_{end}"], rows[f"{end}_s"], rows[f"{end}_c"]
        columns[f"angle_{end}"] = places.angle(piece, s, c)
        position[end] = places.arc_length(piece, places.position(piece, s, c))
        centre[end] = places.centre(body, piece, s, c)
    for end in _ENDS:
        columns[f"s_{end}"] = position[end]
    for end in _ENDS:
        columns[f"x_{end}"], columns[f"y_{end}"] = centre[end]
    return columns


def _masses(places: Places, body: Any, masses: Any) -> Floats:
    of_all = places.mass[body] if masses is None else masses[np.arange(len(body)), body]
    mass: Floats = of_all
    return mass


def _speeds(places: Places, rows: Any, mass: dict[str, Floats]) -> dict[str, Any]:
    """Rates, angular velocities, speeds and energies of both bodies, before and after."""
    columns: dict[str, Any] = {}
    for when in ("pre", "post"):
        for end in _ENDS:
            body, piece = rows[end], rows[f"piece_{end}"]
            speed = rows[f"speed_{end}_{when}"]
            columns[f"rate_{end}_{when}"] = places.rate(body, piece, speed)
            columns[f"omega_{end}_{when}"] = speed / places.body_radius[body]
            columns[f"speed_{end}_{when}"] = speed.copy()
            columns[f"energy_{end}_{when}"] = (mass[end] * places.gravity) * rows[
                f"head_{end}_{when}"
            ]
    ordered = [
        f"{name}_{end}_{when}"
        for name in ("rate", "omega", "speed", "energy")
        for when in ("pre", "post")
        for end in _ENDS
    ]
    return {name: columns[name] for name in ordered}


def residual_gap(places: Places, rows: Any) -> Floats:
    """Distance of the surfaces (m) left in the states of the impacts, without cancellation."""
    a, b, piece = rows["a"], rows["b"], rows["piece_a"]
    radius_a, radius_b = places.body_radius[a], places.body_radius[b]
    reach = radius_a + radius_b
    ax, ay = places.centre(a, piece, rows["a_s"], rows["a_c"])
    bx, by = places.centre(b, rows["piece_b"], rows["b_s"], rows["b_c"])
    dx, dy = bx - ax, by - ay
    gap = np.sqrt(dx * dx + dy * dy) - reach
    same = piece == rows["piece_b"]
    rho_a, rho_b = places.path_radius[a, piece], places.path_radius[b, piece]
    arc = same & (rho_a > 0.0)
    # d^2 - (r_a + r_b)^2 = 4 rho_a rho_b sin((delta - beta)/2) sin((delta + beta)/2)
    product = np.where(arc, rho_a * rho_b, 1.0)
    half_sine = np.sqrt(np.where(arc, radius_a * radius_b / product, 0.0))
    half_cosine = np.sqrt(1.0 - np.minimum(half_sine, 1.0) ** 2)
    delta = np.abs(rows["b_s"] * rows["a_c"] - rows["b_c"] * rows["a_s"])
    cosine = np.abs(rows["b_c"] * rows["a_c"] + rows["b_s"] * rows["a_s"])
    less = delta * half_cosine - cosine * half_sine
    more = delta * half_cosine + cosine * half_sine
    on_arc = 2.0 * product * less * more / reach
    line = same & (rho_a == 0.0)
    along = rows["b_s"] - rows["a_s"]
    distance = 2.0 * np.sqrt(radius_a * radius_b)
    on_line = (along - distance) * (along + distance) / (2.0 * reach)
    result: Floats = np.where(arc, on_arc, np.where(line, on_line, gap))
    return result


def _grazing(places: Places, rows: Any, approach: Floats, table: dict[str, Any]) -> Any:
    """Flag impacts whose overlap, had the bodies passed, would be lost in rounding."""
    acceleration = np.zeros(len(rows))
    for end in _ENDS:
        body, piece = rows[end], rows[f"piece_{end}"]
        rho = places.path_radius[body, piece]
        speed = rows[f"speed_{end}_pre"]
        with np.errstate(divide="ignore", invalid="ignore"):
            central = np.where(rho > 0.0, speed * speed / rho, 0.0)
        acceleration += places.gravity / places.kappa[body] + central
    size = np.abs(table["x_a"]) + np.abs(table["y_a"]) + np.abs(table["x_b"]) + np.abs(table["y_b"])
    overlap = approach * approach / (2.0 * acceleration)
    return overlap < _GRAZING_UNITS * _EPSILON * size
