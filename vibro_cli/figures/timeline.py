"""The motion of one body over time, flight by flight: place and energy."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from vibro_cli.analysis.landscape import Landscape
from vibro_cli.figures.source import Array, Integers, Recorded, Table
from vibro_cli.mechanics.trace import Piece

MOST_FLIGHTS = 3000
"""Of more flights than this, of all bodies together, only the first are drawn over time."""
MOST_PERIODS = 60
"""Of more small oscillations than this only the first are drawn over time."""
_POINTS = 40000
_PER_PERIOD = 64
"""Points of energies in one of the periods of lasting contact."""


@dataclass(frozen=True)
class Timeline:
    """States of one body in order of time; NaN where a line is to break."""

    time: Array
    """Times (s), shape (n,), not falling."""
    s: Array
    """Arc length of the contact point (m); NaN after the seam of a closed trace."""


def shown_until(run: Recorded) -> float:
    """Return the time (s) up to which the motion is drawn: the end, unless it would be a stain."""
    flights = run.flights()
    starts = np.sort(np.asarray(flights["t_start"]))
    end = float(np.max(flights["t_end"]))
    if len(starts) > MOST_FLIGHTS:
        end = float(starts[MOST_FLIGHTS])
    return min(end, _periods(run))


def timeline(run: Recorded, ball: int, until: float) -> Timeline:
    """Return where a body (from 1) is, up to a time (s)."""
    flights = run.flights()
    mine = np.flatnonzero(
        (np.asarray(flights["ball"]) == ball) & (np.asarray(flights["t_start"]) <= until)
    )
    lengths = flights["t_end"][mine] - flights["t_start"][mine]
    total = max(float(np.sum(lengths)), float(np.finfo(np.float64).tiny))
    run.look_at(mine)
    wanted = np.maximum(_least(len(mine)), _POINTS / 20 * lengths / total)
    times, places = [], []
    seam = 0.5 * run.system.trace.length
    last = math.nan
    for row, number in zip(mine.tolist(), wanted.tolist(), strict=True):
        piece = run.system.trace.pieces[int(flights["arc"][row]) - 1]
        time, position, _ = run.flight_curve(row, math.ceil(number) + 1)
        along = position if piece.is_line else piece.radius * (position - piece.angle_start)
        s = piece.start_s + along
        if abs(s[0] - last) > seam:
            times.append(time[:1])
            places.append(np.array([math.nan]))
        times.append(time)
        places.append(s)
        last = float(s[-1])
    return Timeline(np.maximum.accumulate(np.concatenate(times)), np.concatenate(places))


def _least(flights: int) -> float:
    """Return the least number of points of a flight: fewer where there are many."""
    return float(np.clip(_POINTS / 4 / max(flights, 1), 2.0, 16.0))


def calm_until(run: Recorded) -> float:
    """Return the time (s) up to which energies are drawn.

    The end of the run, but lasting contact without an impact only for as many periods as can be
    told apart.
    """
    flights = run.flights()
    end = float(np.max(flights["t_end"]))
    struck = np.asarray(run.collisions["t"], dtype=np.float64)
    contact = np.asarray(flights["contact"], dtype=np.bool_)
    begun = np.asarray(flights["t_start"])[contact & (np.asarray(flights["t_end"]) == end)]
    if not len(begun):
        return end
    joined = np.asarray(flights["cause_start"], dtype=object) == "contact_closed"
    closed = np.asarray(flights["t_start"])[joined]
    return min(end, float(np.max(np.concatenate([struck, closed, [0.0]]))) + _periods(run))


def _periods(run: Recorded) -> float:
    """Return the time (s) of as many slow oscillations as can be told apart; infinite on lines."""
    radii = [piece.radius for piece in run.system.trace.pieces if not piece.is_line]
    if not radii or run.system.gravity <= 0.0:
        return math.inf
    return MOST_PERIODS * 2.0 * math.pi * math.sqrt(max(radii) / run.system.gravity)


def energy_course(run: Recorded, ball: int, until: float = math.inf) -> tuple[Array, Array]:
    """Return times (s) up to one and the energy (J) of a body (from 1) then.

    Constant on a free flight; in lasting contact, where bodies exchange energy, sampled. At a jump
    a time stands twice.
    """
    flights = run.flights()
    hills = Landscape.of(run.system, ball)
    mine = np.flatnonzero(
        (np.asarray(flights["ball"]) == ball) & (np.asarray(flights["t_start"]) <= until)
    )
    mine, last = _kept_levels(flights, mine)
    contact = np.asarray(flights["contact"], dtype=np.bool_)[mine]
    starts, ends = flights["t_start"][mine], np.minimum(flights["t_end"][last], until)
    level = np.empty(len(mine))
    rows, times, energies = [], [], []
    for piece in run.system.trace.pieces:
        here = np.asarray(flights["arc"])[mine] == piece.index + 1
        begun = flights["angle_start"][mine[here]], flights["rate_start"][mine[here]]
        level[here] = hills.energy(piece, *begun)
        bound = mine[here & contact]
        if len(bound):
            run.look_at(bound)
        for row in bound.tolist():
            start, end = float(flights["t_start"][row]), float(flights["t_end"][row])
            lasts = min(end, until) - start
            count = max(2, math.ceil(lasts * _pace(run, ball, piece)) + 1)
            time, position, rate = run.flight_curve(row, count, lasts)
            rows.append(np.full(count, row))
            times.append(time)
            energies.append(hills.energy(piece, position, rate))
    free = np.column_stack([starts, ends])[~contact].ravel()
    levels = np.repeat(level[~contact], 2)
    if not rows:
        return np.maximum.accumulate(free), levels
    time, energy = np.concatenate([free, *times]), np.concatenate([levels, *energies])
    order = np.lexsort((time, np.concatenate([np.repeat(mine[~contact], 2), *rows])))
    return np.maximum.accumulate(time[order]), energy[order]


def _kept_levels(flights: Table, mine: Integers) -> tuple[Integers, Integers]:
    """Return the first and the last of those flights of a body between which its energy stays.

    Those are free flights that follow on one another across pieces.
    """
    free = ~np.asarray(flights["contact"], dtype=np.bool_)[mine]
    crossed = flights["cause_start"][mine] == "crossing"
    goes_on = crossed[1:] & free[1:] & free[:-1]
    return mine[np.append(True, ~goes_on)], mine[np.append(~goes_on, True)]


def _pace(run: Recorded, ball: int, piece: Piece) -> float:
    """Return the points a second that the energy of a body wants, in contact on a piece."""
    body = run.system.bodies[ball - 1]
    radius = run.system.trace.length if piece.is_line else piece.path_radius(body.radius)
    return _PER_PERIOD * body.natural_rate(run.system.gravity, radius) / (2.0 * math.pi)


def energy_residuals(run: Recorded) -> Iterator[tuple[Array, Array]]:
    """Yield the ends (s) of free flights and the change of energy along each, piece by piece.

    Relative to the energy of all bodies at the start; from the states alone, so that it is a
    measure of the error of the motion.
    """
    flights, pieces = run.flights(), run.system.trace.pieces
    hills = [Landscape.of(run.system, ball) for ball in range(1, len(run.system.bodies) + 1)]

    def energy(body: int, piece: Piece, rows: Integers, end: str) -> Array:
        return hills[body].energy(piece, *(flights[f"{x}_{end}"][rows] for x in ("angle", "rate")))

    # Flights stand body by body in order of time.
    firsts = np.searchsorted(flights["ball"], np.arange(1, len(hills) + 1))[:, None]
    whole = sum(
        float(energy(body, pieces[int(flights["arc"][row[0]]) - 1], row, "start")[0])
        for body, row in enumerate(firsts)
    )
    # the last flight of an accumulation stands for all the impacts that are left
    free = np.asarray(flights["cause_end"], dtype=object) != "contact_closed"
    free &= ~np.asarray(flights["contact"], dtype=np.bool_)
    for body in range(len(hills)):
        mine = free & (np.asarray(flights["ball"]) == body + 1)
        for piece in pieces:
            rows = np.flatnonzero(mine & (np.asarray(flights["arc"]) == piece.index + 1))
            change = energy(body, piece, rows, "end") - energy(body, piece, rows, "start")
            yield flights["t_end"][rows], change / (whole or 1.0)
