"""The columns of the table of impacts, from their log row by row; regimes and figure eights.

Single runs and grids share these kernels, so that their rows have the same bits. A body whose
energy is below that of hills on both sides oscillates; otherwise it progresses: without impacts it
would reach an end of the trace, or go round a closed one. Ends are those of the trace, with or
without a wall, as in portraits. A saddle with hills as high as itself on both sides has a figure
eight as its separatrix; below the saddle's energy a body is within one of its loops.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import product
from typing import NamedTuple

from vibro_cli.compile.kernel import BoolMatrix, FloatMatrix, IntMatrix, kernel
from vibro_cli.kernels.contact.contact_kinematics import centre_position
from vibro_cli.kernels.flow.rotating_flight import specific_potential
from vibro_cli.kernels.flow.rotating_flow import stiffness, torque
from vibro_cli.kernels.impact.laws import TRANSLATIONAL, is_graze, separation_speed
from vibro_cli.kernels.numerics.constants import EPSILON
from vibro_cli.kernels.statistics.run_statistics import residual_gap
from vibro_cli.kernels.world import ImpactRow, PieceData, TrackData, World, track_on

REGIMES = ("oscillating", "progressive")
EIGHTS = ("none", "left loop", "right loop", "on it", "outside")

# Rows of a body's hills and figure eights. Hills are in order from left to right, with their
# positions (arc length, m), heights (energy over weight, m), the greatest heights up to them and
# from them on, and their kinds. Figure eights have a saddle, the hills at which the separatrix
# turns back, and its height.
_PLACE, _HEIGHT, _LEFT, _RIGHT, _KIND = 0, 1, 2, 3, 4
_FROM, _SADDLE, _TO, _HEIGHT_OF_EIGHT, _COUNTS = 5, 6, 7, 8, 9
_END, _SLOPE, _AFTER_LEVEL, _CREST = 0.0, 1.0, 2.0, 3.0
"""Kinds of hills: an end of the trace, a junction on a slope, the right end of a level line, and a
crest within a piece, at a junction or at an end."""
ROWS = 10
"""Number of rows of the table of hills for each body; it has 3 columns for each piece, and 2."""

_EQUAL = 1.0e-12  # heights closer than this fraction count as equal
_NEAR = 1.0e-12  # positions closer than this fraction of the trace's length count as equal
_PI, _TAU = math.pi, math.tau


@kernel
def survey(world: World, hills: FloatMatrix) -> None:
    """Find the hills and figure eights of every body: ``ROWS`` rows for each."""
    for body in range(len(world.bodies)):
        count = _find_hills(world, body, hills)
        hills[body * ROWS + _COUNTS, 0] = float(count)
        hills[body * ROWS + _COUNTS, 1] = float(_find_eights(world, body, count, hills))


@kernel
def _find_hills(world: World, body: int, hills: FloatMatrix) -> int:
    """Store the hills of a body: ends of pieces, and crests inside; return their number."""
    settings = world.settings[0]
    kappa = world.bodies[body].kappa
    top = body * ROWS
    count = 0
    for number in range(len(world.pieces)):
        piece = world.pieces[number]
        track = track_on(world, body, number)
        if number == 0:
            s, c = _half_angle(piece, piece.angle_start)
            specific_energy = specific_potential(track, settings.gravity, kappa, s, c)
            count = _note(
                hills, top, count, _kind_of_end(world, body, -1), piece.start_s, specific_energy
            )
        crests, first, other = _crests(world, piece, track)
        for crest in range(crests):
            place = first if crest == 0 else other
            if _is_of_end(world, body, number, place):
                continue
            s, c = _half_angle(piece, place)
            specific_energy = specific_potential(track, settings.gravity, kappa, s, c)
            count = _note(hills, top, count, _CREST, _along(piece, place), specific_energy)
        s, c = _half_angle(piece, piece.angle_end)
        specific_energy = specific_potential(track, settings.gravity, kappa, s, c)
        kind = _kind_of_end(world, body, number)
        count = _note(hills, top, count, kind, _along(piece, piece.angle_end), specific_energy)
    for hill in range(count):
        back = count - 1 - hill
        height, other = hills[top + _HEIGHT, hill], hills[top + _HEIGHT, back]
        hills[top + _LEFT, hill] = (
            height if hill == 0 else max(hills[top + _LEFT, hill - 1], height)
        )
        hills[top + _RIGHT, back] = (
            other if hill == 0 else max(hills[top + _RIGHT, back + 1], other)
        )
    return count


@kernel
def _kind_of_end(world: World, body: int, number: int) -> float:
    """Return the kind of the right end of a piece; number -1 is the left end of the trace.

    It is a crest if the force is zero and the potential falls to both sides.
    """
    settings = world.settings[0]
    left, right = _sides(world, number)
    falls = True
    if left >= 0:
        piece = world.pieces[left]
        level = piece.sign == 0.0 and track_on(world, body, left).line_rise == 0.0
        if level and settings.turning_square == 0.0:
            return _AFTER_LEVEL
        falls = _falls_from(world, body, left, piece.angle_end)
    if right >= 0:
        falls = falls and _falls_from(world, body, right, world.pieces[right].angle_start)
    if falls:
        return _CREST
    return _END if left < 0 or right < 0 else _SLOPE


@kernel
def _sides(world: World, number: int) -> tuple[int, int]:
    """Return the pieces to the left and right of the right end of a piece, -1 if there is none."""
    last = len(world.pieces) - 1
    joined = world.settings[0].closed == 1
    left = number if number >= 0 or not joined else last
    right = number + 1 if number < last else (0 if joined else -1)
    return left, right


@kernel
def _falls_from(world: World, body: int, number: int, place: float) -> bool:
    """Return whether the force at a position on a piece is zero, and the potential falls there."""
    force, growth = _pull(world, body, number, place)
    falls: bool = growth > 0.0 and force <= _NEAR * _length(world) * growth
    return falls


@kernel
def _balances(world: World, body: int, number: int) -> bool:
    """Return whether the force is zero at the right end of a piece of a rotating trace."""
    near = _NEAR * _length(world)
    left, right = _sides(world, number)
    balances = world.settings[0].turning_square > 0.0
    if left >= 0:
        force, growth = _pull(world, body, left, world.pieces[left].angle_end)
        balances = balances and force <= near * abs(growth)
    if right >= 0:
        force, growth = _pull(world, body, right, world.pieces[right].angle_start)
        balances = balances and force <= near * abs(growth)
    return balances


@kernel
def _pull(world: World, body: int, number: int, place: float) -> tuple[float, float]:
    """Return the magnitude of the force on a piece, and its gradient; their ratio is in m."""
    piece = world.pieces[number]
    track = track_on(world, body, number)
    if piece.sign == 0.0:
        growth = track.line_growth * track.line_growth
        return abs(track.line_acceleration + growth * place), growth
    s, c = _half_angle(piece, place)
    force = abs(torque(track.tilt, track.spread, s, c))
    return force * piece.radius, stiffness(track.tilt, track.spread, s, c)


@kernel
def _length(world: World) -> float:
    """Return the length of the trace (m)."""
    piece = world.pieces[len(world.pieces) - 1]
    return _along(piece, piece.angle_end)


@kernel
def _is_of_end(world: World, body: int, number: int, place: float) -> bool:
    """Return whether a crest of a piece coincides up to rounding with a singular end of it."""
    piece = world.pieces[number]
    near = _NEAR * _length(world)
    s = _along(piece, place)
    if s - piece.start_s <= near and _is_singular(world, body, number - 1):
        return True
    right = _along(piece, piece.angle_end)
    return right - s <= near and _is_singular(world, body, number)


@kernel
def _is_singular(world: World, body: int, number: int) -> bool:
    """Return whether the right end of a piece is a saddle, or degenerate on a rotating trace."""
    return _kind_of_end(world, body, number) == _CREST or _balances(world, body, number)


@kernel
def _note(
    hills: FloatMatrix, top: int, count: int, kind: float, place: float, height: float
) -> int:
    hills[top + _PLACE, count] = place
    hills[top + _HEIGHT, count] = height
    hills[top + _KIND, count] = kind
    return count + 1


@kernel
def _along(piece: PieceData, place: float) -> float:
    """Return the arc length (m) at an angle on an arc, or at a distance on a line."""
    if piece.sign == 0.0:
        return piece.start_s + place
    return piece.start_s + piece.radius * (place - piece.angle_start)


@kernel
def _half_angle(piece: PieceData, place: float) -> tuple[float, float]:
    """Return ``(S, C)`` of an angle phi or psi; on a line the distance and 0."""
    if piece.sign == 0.0:
        return place, 0.0
    half = 0.5 * place + (0.5 * _PI if piece.sign < 0.0 else 0.0)
    return math.sin(half), math.cos(half)


@kernel
def _crests(world: World, piece: PieceData, track: TrackData) -> tuple[int, float, float]:
    """Return the number of crests within a piece, and the positions of the first and the last."""
    if piece.sign == 0.0:
        square = track.line_growth * track.line_growth
        if square == 0.0:
            return 0, 0.0, 0.0
        place = -track.line_acceleration / square
        return (1 if place > 0.0 and place < piece.length else 0), place, place
    if world.settings[0].turning_square == 0.0:
        # The top of a hump, or of a looping valley.
        top = _whole_angle(piece, 1.0, 0.0)
        near = 4.0 * EPSILON * max(1.0, abs(top))
        within = top > piece.angle_start + near and top < piece.angle_end - near
        return (1 if within else 0), top, top
    first = _whole_angle(piece, track.crest_s, track.crest_c)
    if track.crests < 2:
        return track.crests, first, first
    other = _whole_angle(piece, track.other_crest_s, track.other_crest_c)
    return 2, min(first, other), max(first, other)


@kernel
def _whole_angle(piece: PieceData, s: float, c: float) -> float:
    """Return the angle phi or psi (rad), from a piece's start on, for a half angle's (sin, cos)."""
    angle = 2.0 * (math.atan2(-c, s) if piece.sign < 0.0 else math.atan2(s, c))
    return angle + _TAU * math.ceil((piece.angle_start - angle) / _TAU)


@kernel
def _find_eights(world: World, body: int, count: int, hills: FloatMatrix) -> int:
    """Store the figure eights of a body, from left to right; return their number."""
    closed = world.settings[0].closed == 1
    top = body * ROWS
    found = 0
    around = hills[top + _PLACE, count - 1] - hills[top + _PLACE, 0]
    number = count - 1 if closed else count
    for hill in range(number):
        inner = closed or (hill != 0 and hill != number - 1)
        if not inner or hills[top + _KIND, hill] != _CREST:
            continue  # only a crest inside the trace is a saddle with two sides
        left = _barrier(world, hills, top, number, hill, -1)
        right = _barrier(world, hills, top, number, hill, 1)
        if left < 0 or right < 0:
            continue
        at = hills[top + _PLACE, hill]
        low, high = hills[top + _PLACE, left], hills[top + _PLACE, right]
        hills[top + _FROM, found] = low - (around if low >= at else 0.0)
        hills[top + _SADDLE, found] = at
        hills[top + _TO, found] = high + (around if high <= at else 0.0)
        hills[top + _HEIGHT_OF_EIGHT, found] = hills[top + _HEIGHT, hill]
        found += 1
    return found


@kernel
def _barrier(world: World, hills: FloatMatrix, top: int, number: int, hill: int, step: int) -> int:
    """Return the next hill to one side at which a saddle's separatrix turns back, or -1.

    The hill is at least as high as the saddle. -1 if the separatrix does not turn back, if it runs
    to another saddle of equal height, and if a level line takes the place of the centre.
    """
    closed = world.settings[0].closed == 1
    height = hills[top + _HEIGHT, hill]
    rounding = 4.0 * EPSILON * (abs(height) + hills[top + _PLACE, number - 1])
    at = hill
    falling = True
    for _ in range(number):
        if not closed and (at + step < 0 or at + step >= number):
            return -1
        before = at
        at = (at + step) % number
        if at == hill:
            return -1
        falling = falling and hills[top + _HEIGHT, at] <= hills[top + _HEIGHT, before] + rounding
        if falling and hills[top + _KIND, at if step > 0 else before] == _AFTER_LEVEL:
            return -1
        on_slope = hills[top + _KIND, at] == _SLOPE
        if hills[top + _HEIGHT, at] >= height - rounding and not on_slope:
            equal = abs(hills[top + _HEIGHT, at] - height) <= _EQUAL * height
            saddle = hills[top + _KIND, at] == _CREST or _is_level_end(world, at, number)
            return -1 if equal and saddle else at
    return -1


@kernel
def _is_level_end(world: World, hill: int, number: int) -> bool:
    """Return whether a hill is an end of an open trace at rest, on a level line: also singular."""
    settings = world.settings[0]
    if settings.closed == 1 or settings.turning_square > 0.0:
        return False
    if hill != 0 and hill != number - 1:
        return False
    piece = world.pieces[0 if hill == 0 else len(world.pieces) - 1]
    return piece.sign == 0.0 and piece.tangent_y == 0.0


@kernel
def regime_of(world: World, hills: FloatMatrix, body: int, s: float, specific_energy: float) -> int:
    """Return the index in ``REGIMES`` of a body at an arc length (m), by energy over weight (m)."""
    top = body * ROWS
    count = int(hills[top + _COUNTS, 0])
    if world.settings[0].closed == 1:
        return 0 if specific_energy < hills[top + _LEFT, count - 1] else 1
    hill = 0
    while hill + 2 < count and hills[top + _PLACE, hill + 1] <= s:
        hill += 1
    enclosed = (
        specific_energy < hills[top + _LEFT, hill]
        and specific_energy < hills[top + _RIGHT, hill + 1]
    )
    return 0 if enclosed else 1


@kernel
def side_of_eight(
    world: World, hills: FloatMatrix, body: int, s: float, specific_energy: float
) -> int:
    """Return the index in ``EIGHTS``, for the first figure eight from the left around the body."""
    top = body * ROWS
    count = int(hills[top + _COUNTS, 1])
    around = 0.0
    if world.settings[0].closed == 1:
        around = hills[top + _PLACE, int(hills[top + _COUNTS, 0]) - 1]
    for eight in range(count):
        place = s
        if place < hills[top + _FROM, eight]:
            place += around
        elif place > hills[top + _TO, eight]:
            place -= around
        if place < hills[top + _FROM, eight] or place > hills[top + _TO, eight]:
            continue
        height = hills[top + _HEIGHT_OF_EIGHT, eight]
        if abs(specific_energy - height) <= _EQUAL * height:
            return 3
        if specific_energy < height:
            return 1 if place < hills[top + _SADDLE, eight] else 2
    return 4 if count > 0 else 0


# An overlap of fewer units in the last place of the positions is rounding.
_GRAZING_UNITS = 16.0

ENDS = ("a", "b")
PLACES = ("angle", "s", "x", "y")
MOTIONS = ("rate", "omega", "speed", "energy")
PHASES = ("regime", "eight")

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
"""Columns of floats. The kernels find a column by its index here."""
INTEGERS = (
    *("scenario", "n", "ball_a", "ball_b", "arc_a", "arc_b", "side", "law"),
    *(f"{name}_{end}_{when}" for name, when, end in product(PHASES, ("pre", "post"), ENDS)),
)
"""Columns of integers, some of which are indices of words."""
FLAGS = ("admissible", "substituted", "simultaneous", "grazing", "contact")

_T, _T_LOW, _DT = (NUMBERS.index(name) for name in ("t", "t_low", "dt"))
_LOSS, _MOMENT, _IMPULSE, _GAP = (
    NUMBERS.index(name) for name in ("energy_loss", "impulse_moment", "impulse", "gap")
)
_APPROACH, _SEPARATION = (NUMBERS.index(f"{name}_speed") for name in ("approach", "separation"))
_RUN, _N, _SIDE, _LAW = (INTEGERS.index(name) for name in ("scenario", "n", "side", "law"))
_ADMISSIBLE, _SUBSTITUTED = (FLAGS.index(name) for name in ("admissible", "substituted"))
_SIMULTANEOUS, _GRAZING, _CONTACT = (
    FLAGS.index(name) for name in ("simultaneous", "grazing", "contact")
)
# Indices of the columns of body a; that of body b follows.
_BALL, _ARC = (INTEGERS.index(f"{name}_a") for name in ("ball", "arc"))
_ANGLE, _S, _X, _Y = (NUMBERS.index(f"{name}_a") for name in PLACES)
# The same for columns before the impact; those after it are two further on.
_RATE, _OMEGA, _SPEED, _ENERGY = (NUMBERS.index(f"{name}_a_pre") for name in MOTIONS)
_KINETIC = NUMBERS.index("kinetic_energy_a_pre")
_AFTER = 2
_REGIME, _EIGHT = (INTEGERS.index(f"{name}_a_pre") for name in PHASES)


class Columns(NamedTuple):
    """Arrays for the columns; columns that are not requested share one."""

    numbers: FloatMatrix
    """[column, row], float64"""
    integers: IntMatrix
    """[column, row], int64"""
    flags: BoolMatrix
    """[column, row], bool"""
    numbers_at: Sequence[int]
    """Index in ``numbers`` of each of :data:`NUMBERS`; likewise the other two."""
    integers_at: Sequence[int]
    flags_at: Sequence[int]


class Runs(NamedTuple):
    """The runs of a log, in its order."""

    numbers: Sequence[int]
    """Number of each run, for the column ``scenario``."""
    counts: Sequence[int]
    """Number of impacts of each run."""
    firsts: Sequence[int]
    """Row of the columns for the first impact of each run."""
    masses: FloatMatrix
    """[run, body], kg"""
    hills: FloatMatrix
    """Scratch: the hills and figure eights of each body, see :func:`survey`."""


@kernel
def fill_columns(
    world: World, log: Sequence[ImpactRow], runs: Runs, columns: Columns, around: float
) -> int:
    """Fill the columns of some runs of one system, which may differ in their masses.

    The log has the impacts run by run. ``around`` is the length (m) of a closed trace with two
    bodies, which may meet on two sides, otherwise 0. Return the number of rows.
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
    """Fill the columns of one run, from ``row`` of the log on; return the row after its last."""
    first = runs.firsts[run]
    if runs.counts[run] > 0:
        survey(world, runs.hills)
    for n in range(runs.counts[run]):
        impact = log[row]
        at = first + n
        _integer(columns, _RUN, at, runs.numbers[run])
        _integer(columns, _N, at, n + 1)
        since = math.nan
        if n > 0:
            before = log[row - 1]
            since = (impact.t - before.t) + (impact.t_low - before.t_low)
        _number(columns, _DT, at, since)
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
    """Fill the columns of a single row of the log: those of the pair, then of both bodies."""
    approach = _fill_pair(world, row, columns, at)
    # On a closed trace with two bodies, a is always body 1, whichever pair found the contact.
    end_a = 1 if around > 0.0 and row.a == 1 else 0
    end_b = 1 - end_a
    s_a, size_a, pull_a = _fill_body(
        world, runs, run, columns, at, end_a, (row.a, row.piece_a, row.a_s, row.a_c),
        (row.speed_a_pre, row.speed_a_post, row.specific_energy_a_pre, row.specific_energy_a_post),
    )  # fmt: skip
    s_b, size_b, pull_b = _fill_body(
        world, runs, run, columns, at, end_b, (row.b, row.piece_b, row.b_s, row.b_c),
        (row.speed_b_pre, row.speed_b_post, row.specific_energy_b_pre, row.specific_energy_b_post),
    )  # fmt: skip
    impulse = runs.masses[run, row.a] * (row.speed_a_post - row.speed_a_pre)
    if end_b == 1:
        impulse = runs.masses[run, row.b] * (row.speed_b_post - row.speed_b_pre)
    _number(columns, _IMPULSE, at, impulse if row.law == TRANSLATIONAL else math.nan)
    rounding = _GRAZING_UNITS * EPSILON * (size_a + size_b)
    _flag(columns, _GRAZING, at, is_graze(approach, pull_a + pull_b, rounding))
    side = 0
    if around > 0.0:
        ahead = (s_b - s_a if end_a == 0 else s_a - s_b) % around
        # +1 if body 1 meets body 2 ahead of it, -1 if behind it.
        met_ahead = row.a == 0 if row.piece_a == row.piece_b else ahead <= 0.5 * around
        side = 1 if met_ahead else -1
    _integer(columns, _SIDE, at, side)


@kernel
def _fill_pair(world: World, row: ImpactRow, columns: Columns, at: int) -> float:
    """Fill the columns of the pair; return its approach speed (m/s)."""
    approach = row.normal_a * row.speed_a_pre - row.normal_b * row.speed_b_pre
    _number(columns, _T, at, row.t)
    _number(columns, _T_LOW, at, row.t_low)
    _number(columns, _LOSS, at, row.loss)
    _number(columns, _APPROACH, at, approach)
    parting = separation_speed(row.normal_a, row.normal_b, row.speed_a_post, row.speed_b_post)
    _number(columns, _SEPARATION, at, parting)
    _number(columns, _GAP, at, residual_gap(world, row))
    _integer(columns, _LAW, at, row.law)
    _flag(columns, _ADMISSIBLE, at, row.admissible == 1)
    _flag(columns, _SUBSTITUTED, at, row.substituted == 1)
    _flag(columns, _SIMULTANEOUS, at, row.simultaneous == 1)
    _flag(columns, _CONTACT, at, row.contact == 1)
    return approach


@kernel
def _fill_body(
    world: World,
    runs: Runs,
    run: int,
    columns: Columns,
    at: int,
    end: int,
    place: tuple[int, int, float, float],
    motion: tuple[float, float, float, float],
) -> tuple[float, float, float]:
    """Fill the columns of one body: its position, and its motion before and after the impact.

    ``place`` is the body, its piece and ``(S, C)``; ``motion`` its speeds (m/s) before and after,
    and its energies over weight (m). Return the arc length (m) of its contact point, the size of
    its centre's coordinates (m), and a bound of its acceleration (m/s^2).
    """
    number, piece, _, _ = place
    body = world.bodies[number]
    track = track_on(world, number, piece)
    line = world.pieces[piece].sign == 0.0
    slides = body.kappa == 1.0
    mass = runs.masses[run, number]
    weight = mass * world.settings[0].gravity
    arc_length, size = _fill_place(world, columns, at, end, place)
    for when in range(2):
        later = end + _AFTER * when
        speed = motion[0] if when == 0 else motion[1]
        specific_energy = motion[2] if when == 0 else motion[3]
        _number(columns, _RATE + later, at, math.nan if line else speed / track.path_radius)
        _number(columns, _OMEGA + later, at, math.nan if slides else speed / body.radius)
        _number(columns, _SPEED + later, at, speed)
        _number(columns, _ENERGY + later, at, weight * specific_energy)
        _number(columns, _KINETIC + later, at, 0.5 * body.kappa * mass * speed * speed)
        regime = regime_of(world, runs.hills, number, arc_length, specific_energy)
        _integer(columns, _REGIME + later, at, regime)
        eight = side_of_eight(world, runs.hills, number, arc_length, specific_energy)
        _integer(columns, _EIGHT + later, at, eight)
    if end == 1:
        inertia = body.kappa * mass * body.radius
        _number(columns, _MOMENT, at, inertia * (motion[1] - motion[0]))
    central = 0.0 if line else motion[0] * motion[0] / track.path_radius
    return arc_length, size, track.gravity_rate + central


@kernel
def _fill_place(
    world: World, columns: Columns, at: int, end: int, place: tuple[int, int, float, float]
) -> tuple[float, float]:
    """Fill the columns of a body's position; return its arc length and coordinates' size (m)."""
    body, number, s, c = place
    piece = world.pieces[number]
    along = place_on(piece, s, c)
    arc_length = _along(piece, along)
    x, y = centre_position(piece, track_on(world, body, number), s, c)
    _integer(columns, _BALL + end, at, body + 1)
    _integer(columns, _ARC + end, at, number + 1)
    _number(columns, _ANGLE + end, at, math.nan if piece.sign == 0.0 else along)
    _number(columns, _S + end, at, arc_length)
    _number(columns, _X + end, at, x)
    _number(columns, _Y + end, at, y)
    return arc_length, abs(x) + abs(y)


@kernel
def place_on(piece: PieceData, s: float, c: float) -> float:
    """Return the angle phi or psi (rad) on an arc, or the distance (m) from a line's left end."""
    if piece.sign == 0.0:
        return s
    half = math.atan2(-c, s) if piece.sign < 0.0 else math.atan2(s, c)
    angle = 2.0 * half + piece.turn
    # The half angle is known up to whole turns: at the ends of a circle rounding may add one.
    beyond = angle - 0.5 * (piece.angle_start + piece.angle_end)
    if abs(beyond) > 2.0 * math.pi:
        angle -= math.copysign(4.0 * math.pi, beyond)
    return min(max(angle, piece.angle_start), piece.angle_end)
