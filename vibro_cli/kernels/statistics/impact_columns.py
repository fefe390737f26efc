"""The kernel that turns the log of impacts into the columns of their table, row by row.

Single runs and grids share it, so that their rows are the same to the bit.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import product
from typing import NamedTuple

from vibro_cli.compile.kernel import BoolMatrix, FloatMatrix, IntMatrix, kernel
from vibro_cli.kernels.contact.contact_kinematics import centre_position
from vibro_cli.kernels.impact.laws import LAW_NAMES, TRANSLATIONAL
from vibro_cli.kernels.statistics.regimes import (
    EIGHTS,
    REGIMES,
    regime_of,
    side_of_eight,
    survey,
)
from vibro_cli.kernels.statistics.run_statistics import residual_gap
from vibro_cli.kernels.world import ImpactRow, PieceData, World

_EPSILON = 2.0**-52
# An impact whose overlap, had it not happened, would have stayed below this many units in the last
# place of the positions cannot be told from a passing touch.
_GRAZING_UNITS = 16.0

ENDS = ("a", "b")
PLACES = ("angle", "s", "x", "y")
MOTIONS = ("rate", "omega", "speed", "energy")
PHASES = ("regime", "eight")
WORDS = {
    "law": LAW_NAMES,
    **{f"regime_{end}_{when}": REGIMES for end, when in product(ENDS, ("pre", "post"))},
    **{f"eight_{end}_{when}": EIGHTS for end, when in product(ENDS, ("pre", "post"))},
}
"""What the numbers in columns of words stand for, from 0."""

NUMBERS = (
    "t",
    "t_low",
    "dt",
    "energy_loss",
    "impulse_moment",
    "approach_speed",
    "separation_speed",
    "gap",
    *(f"{name}_{end}" for name, end in product(PLACES, ENDS)),
    *(f"{name}_{end}_{when}" for name, when, end in product(MOTIONS, ("pre", "post"), ENDS)),
    *(f"kinetic_energy_{end}_{when}" for when, end in product(("pre", "post"), ENDS)),
    "impulse",
)
"""Columns of floats, in the order in which the kernel knows them."""
INTEGERS = (
    *("scenario", "n", "ball_a", "ball_b", "arc_a", "arc_b", "side", "law"),
    *(f"{name}_{end}_{when}" for name, when, end in product(PHASES, ("pre", "post"), ENDS)),
)
"""Columns of whole numbers, some of which stand for words."""
FLAGS = ("admissible", "substituted", "simultaneous", "grazing", "contact")

# Where the columns of both bodies begin; that of body b follows that of body a.
_ANGLE, _S, _X, _Y = 8, 10, 12, 14
# And those of both bodies before the impact; those after it are two further on.
_RATE, _OMEGA, _SPEED, _ENERGY, _KINETIC = 16, 20, 24, 28, 32
_AFTER = 2
_IMPULSE = 36
# Among the whole numbers.
_REGIME, _EIGHT = 8, 12


class Columns(NamedTuple):
    """Room for columns; those that are not wanted share one."""

    numbers: FloatMatrix
    """[column, row], float64"""
    integers: IntMatrix
    """[column, row], int64"""
    flags: BoolMatrix
    """[column, row], bool"""
    numbers_at: Sequence[int]
    """Which of ``numbers`` each of :data:`NUMBERS` goes to; likewise the other two."""
    integers_at: Sequence[int]
    flags_at: Sequence[int]


class Runs(NamedTuple):
    """The runs that a log is of, in its order."""

    numbers: Sequence[int]
    """The number of each, for the column ``scenario``."""
    counts: Sequence[int]
    """How many impacts it has."""
    firsts: Sequence[int]
    """Row of the columns for its first impact."""
    masses: FloatMatrix
    """[run, body], kg"""
    hills: FloatMatrix
    """Scratch: what the trace is to each body, see ``kernels.statistics.regimes``."""


@kernel
def fill_columns(
    world: World, log: Sequence[ImpactRow], runs: Runs, columns: Columns, around: float
) -> int:
    """Fill the columns of some runs of one system, which may differ in their masses.

    Parameters
    ----------
    world
        The system's records.
    log, runs
        Impacts, run by run.
    columns
        Filled in.
    around
        Length (m) of a closed trace with two bodies, which may meet on two sides; else 0.

    Returns
    -------
    Number of rows.
    """
    row = 0
    for run in range(len(runs.counts)):
        row = fill_run(world, log, row, runs, run, columns, around)
    return row


@kernel
def fill_run(
    world: World,
    log: Sequence[ImpactRow],
    row: int,
    runs: Runs,
    run: int,
    columns: Columns,
    around: float,
) -> int:
    """Fill the columns of one run, whose log begins with a row; returns the row after its last."""
    first = runs.firsts[run]
    if runs.counts[run] > 0:
        survey(world, runs.hills)
    for n in range(runs.counts[run]):
        impact = log[row]
        at = first + n
        _integer(columns, 0, at, runs.numbers[run])
        _integer(columns, 1, at, n + 1)
        since = math.nan
        if n > 0:
            before = log[row - 1]
            since = (impact.t - before.t) + (impact.t_low - before.t_low)
        _number(columns, 2, at, since)
        _fill_row(world, impact, runs, run, columns, at, around)
        row += 1
    return row


@kernel
def _number(columns: Columns, which: int, at: int, value: float) -> None:
    columns.numbers[columns.numbers_at[which], at] = value


@kernel
def _integer(columns: Columns, which: int, at: int, value: int) -> None:
    columns.integers[columns.integers_at[which], at] = value


@kernel
def _flag(columns: Columns, which: int, at: int, value: bool) -> None:
    columns.flags[columns.flags_at[which], at] = value


@kernel
def _fill_row(
    world: World,
    row: ImpactRow,
    runs: Runs,
    run: int,
    columns: Columns,
    at: int,
    around: float,
) -> None:
    """Fill what an impact's own row tells: first what belongs to the pair, then both bodies."""
    _number(columns, 0, at, row.t)
    _number(columns, 1, at, row.t_low)
    _number(columns, 3, at, row.loss)
    approach = row.normal_a * row.speed_a_pre - row.normal_b * row.speed_b_pre
    _number(columns, 5, at, approach)
    _number(columns, 6, at, row.normal_b * row.speed_b_post - row.normal_a * row.speed_a_post)
    _number(columns, 7, at, residual_gap(world, row))
    _integer(columns, 7, at, row.law)
    _flag(columns, 0, at, row.admissible == 1)
    _flag(columns, 1, at, row.substituted == 1)
    _flag(columns, 2, at, row.simultaneous == 1)
    _flag(columns, 4, at, row.contact == 1)
    # Two bodies on a closed trace are 1 and 2, whichever pair found the contact.
    end_a = 0
    if around > 0.0 and row.a == 1:
        end_a = 1
    mass_a, mass_b = runs.masses[run, row.a], runs.masses[run, row.b]
    end_b = 1 - end_a
    s_a, size_a, pull_a = _fill_body(
        world, columns, at, end_a, row.a, row.piece_a, row.a_s, row.a_c, mass_a,
        (row.speed_a_pre, row.speed_a_post), (row.head_a_pre, row.head_a_post),
    )  # fmt: skip
    s_b, size_b, pull_b = _fill_body(
        world, columns, at, end_b, row.b, row.piece_b, row.b_s, row.b_c, mass_b,
        (row.speed_b_pre, row.speed_b_post), (row.head_b_pre, row.head_b_post),
    )  # fmt: skip
    _fill_phases(
        world, runs.hills, columns, at, end_a, row.a, s_a, (row.head_a_pre, row.head_a_post)
    )
    _fill_phases(
        world, runs.hills, columns, at, end_b, row.b, s_b, (row.head_b_pre, row.head_b_post)
    )
    change = (
        row.speed_b_post - row.speed_b_pre if end_b == 1 else row.speed_a_post - row.speed_a_pre
    )
    mass = mass_b if end_b == 1 else mass_a
    _number(columns, _IMPULSE, at, mass * change if row.law == TRANSLATIONAL else math.nan)
    overlap = approach * approach / (2.0 * (pull_a + pull_b))
    _flag(columns, 3, at, overlap < _GRAZING_UNITS * _EPSILON * (size_a + size_b))
    if around > 0.0:
        ahead = (s_b - s_a if end_a == 0 else s_a - s_b) % around
        _integer(columns, 6, at, _side(row, ahead <= 0.5 * around))
    else:
        _integer(columns, 6, at, 0)


@kernel
def _side(row: ImpactRow, near: bool) -> int:
    """+1 where body 2 is met ahead of body 1, -1 where from behind."""
    if row.piece_a == row.piece_b:
        return 1 if row.a == 0 else -1
    return 1 if near else -1


@kernel
def _fill_body(
    world: World,
    columns: Columns,
    at: int,
    end: int,
    body: int,
    piece: int,
    s: float,
    c: float,
    mass: float,
    speeds: tuple[float, float],
    heads: tuple[float, float],
) -> tuple[float, float, float]:
    """Fill the columns of one body.

    Returns the arc length (m) of its contact point, the size of its centre's coordinates (m), and
    a bound on its acceleration (m/s^2).
    """
    data = world.pieces[piece]
    track = world.tracks[body * world.settings[0].pieces + piece]
    place = place_on(data, s, c)
    line = data.sign == 0.0
    arc_length = data.start_s + (place if line else data.radius * (place - data.angle_start))
    x, y = centre_position(data, track, s, c)
    _integer(columns, 2 + end, at, body + 1)
    _integer(columns, 4 + end, at, piece + 1)
    _number(columns, _ANGLE + end, at, math.nan if line else place)
    _number(columns, _S + end, at, arc_length)
    _number(columns, _X + end, at, x)
    _number(columns, _Y + end, at, y)
    radius = world.bodies[body].radius
    slides = world.bodies[body].kappa == 1.0
    weight = mass * world.settings[0].gravity
    for when in range(2):
        later = end + _AFTER * when
        speed = speeds[when]
        _number(columns, _RATE + later, at, math.nan if line else speed / track.path_radius)
        _number(columns, _OMEGA + later, at, math.nan if slides else speed / radius)
        _number(columns, _SPEED + later, at, speed)
        _number(columns, _ENERGY + later, at, weight * heads[when])
        kinetic = 0.5 * world.bodies[body].kappa * mass * speed * speed
        _number(columns, _KINETIC + later, at, kinetic)
    if end == 1:
        inertia = world.bodies[body].kappa * mass * radius
        _number(columns, 4, at, inertia * (speeds[1] - speeds[0]))
    central = 0.0 if line else speeds[0] * speeds[0] / track.path_radius
    return arc_length, abs(x) + abs(y), track.gravity_rate + central


@kernel
def _fill_phases(
    world: World,
    hills: FloatMatrix,
    columns: Columns,
    at: int,
    end: int,
    body: int,
    s: float,
    heads: tuple[float, float],
) -> None:
    """Fill regime and side of the figure eight of one body, before and after the impact."""
    for when in range(2):
        later = end + _AFTER * when
        _integer(columns, _REGIME + later, at, regime_of(world, hills, body, s, heads[when]))
        _integer(columns, _EIGHT + later, at, side_of_eight(world, hills, body, s, heads[when]))


@kernel
def place_on(piece: PieceData, s: float, c: float) -> float:
    """Angle phi or psi (rad) on an arc, distance from the left end (m) on a line."""
    if piece.sign == 0.0:
        return s
    half = math.atan2(-c, s) if piece.sign < 0.0 else math.atan2(s, c)
    return min(max(2.0 * half + piece.turn, piece.angle_start), piece.angle_end)
