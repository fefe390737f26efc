"""The numbers of a run's summary, gathered from its logs for single runs and grids alike.

On an arc ``N/(m g) = sign(cos f + (4/kappa) P^2)`` is linear in ``S^2`` (f = phi in a valley, psi
+ pi on a hump, whose sign is -1), so its extremes over a flight lie at the extremes of ``S^2``. The
friction demand of rolling, ``|F|/N`` with ``F = m g sin(alpha)(1 - 1/kappa)``, is stationary also
where ``cos f = -B/A``, ``N/m = A + B cos f``. A sliding body (kappa = 1) needs no friction,
whatever its normal force.

For a group on one arc the normal force is ``a + b cos f + c sin f`` in the angle of its pendulum
(``kernels.cluster.trace_forces``), so its extremes are exact. On a line it is constant; on a short
segment across pieces its extremes are those of a parabola.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

from vibro_cli.compile.kernel import any_lane, kernel, struct
from vibro_cli.kernels.cluster.trace_forces import (
    AT_TIME,
    bodies_of,
    extreme_on_segment,
    fit_forces,
    is_pendulum,
    note_forces,
    set_forces,
)
from vibro_cli.kernels.contact.contact_kinematics import centre_position
from vibro_cli.kernels.flow.flow import (
    POLYNOMIAL,
    energy_of_row,
    flow,
    group_of_body,
    half_period,
    replay_flight,
)
from vibro_cli.kernels.flow.rotating_flow import TURNING_LINE, time_on_line, turn_on_line
from vibro_cli.kernels.numerics.constants import NEVER
from vibro_cli.kernels.world import (
    RUNNING,
    WALL,
    BodyData,
    BodyForces,
    Flight,
    FlightRow,
    ImpactRow,
    PieceData,
    World,
    number_along,
    track_on,
)

# A square smaller than another one by this factor is so regardless of rounding.
BELOW = 1.0 - 1.0e-12


@struct
class Outcome:
    """The numbers of a run's summary."""

    end_cause: int
    end_t: float  # s
    end_t_low: float
    quiet_from: float  # s
    collisions: int
    crossings: int
    contacts: int
    impacts: int  # carried out, so without inadmissible ones at which the run ended
    walls: int
    first_t: float  # of all impacts, s
    last_t: float
    correction: float  # J
    max_gap: float  # at all impacts, m
    least_force: float  # N
    most_demand: float  # greatest friction demand
    kept: int  # number of rows of impacts that were kept


@struct
class FinalState:
    """State of a body at the end of a run, and its energies at the start and the end."""

    start_energy: float  # J
    end_energy: float
    piece: int
    s: float
    c: float
    p: float
    latest: int  # scratch: the row of its last flight


class Results(NamedTuple):
    """Results of runs."""

    outcomes: Sequence[Outcome]  # one for each run
    finals: Sequence[FinalState]  # one for each body, run by run
    impacts: Sequence[ImpactRow]  # of all runs, if they are kept
    scratch: Sequence[Flight]  # one


@kernel
def update_statistics(
    world: World,
    known: int,
    cause: int,
    end_t: float,
    end_t_low: float,
    results: Results,
    number: int,
) -> None:
    """Fill in the outcome of a run, and the final state of every body.

    The logs hold all rows of the run, or of one part of it. For the first part ``known`` is 0. For
    later parts it is the number of bodies: the log then begins with the present flight of every
    body, and the outcome includes the parts before. ``cause`` is ``RUNNING``, or why the run ended,
    at ``end_t`` (two doubles, s). ``number`` is the index of the run in ``results``.
    """
    clock = world.clock[0]
    bodies = world.settings[0].bodies
    first_final = number * bodies
    outcome = results.outcomes[number]
    finals = results.finals
    flight = results.scratch[0]
    if known == 0:
        _begin(outcome)
    _update_impact_statistics(world, outcome)
    for ball in range(bodies):
        finals[first_final + ball].latest = ball if known > 0 else -1
    _update_flight_statistics(world, known, outcome, finals, first_final, flight)
    if cause == RUNNING:
        return
    outcome.end_cause = cause
    outcome.end_t = end_t
    outcome.end_t_low = end_t_low
    outcome.quiet_from = clock.quiet_from
    outcome.collisions = clock.collisions
    outcome.crossings = clock.crossings
    outcome.contacts = clock.contacts
    outcome.correction = clock.energy_correction
    for ball in range(bodies):
        _finish(world, outcome, finals[first_final + ball], flight)


@kernel
def _begin(outcome: Outcome) -> None:
    outcome.impacts = 0
    outcome.walls = 0
    outcome.first_t = NEVER
    outcome.last_t = NEVER
    outcome.max_gap = 0.0
    outcome.least_force = NEVER
    outcome.most_demand = 0.0


@kernel
def _update_impact_statistics(world: World, outcome: Outcome) -> None:
    count = world.clock[0].impact_rows
    if count > 0:
        if outcome.first_t == NEVER:
            outcome.first_t = world.impacts[0].t
        outcome.last_t = world.impacts[count - 1].t
    for number in range(count):
        row = world.impacts[number]
        if row.admissible == 1 or row.substituted == 1:
            outcome.impacts += 1
        gap = residual_gap(world, row)
        outcome.max_gap = max(outcome.max_gap, abs(gap))


@kernel
def residual_gap(world: World, row: ImpactRow) -> float:
    """Return the gap (m) left in the states of an impact, computed without cancellation."""
    track_a = track_on(world, row.a, row.piece_a)
    track_b = track_on(world, row.b, row.piece_b)
    radius_a = world.bodies[row.a].radius
    radius_b = world.bodies[row.b].radius
    reach = radius_a + radius_b
    if row.piece_a != row.piece_b:
        ax, ay = centre_position(world.pieces[row.piece_a], track_a, row.a_s, row.a_c)
        bx, by = centre_position(world.pieces[row.piece_b], track_b, row.b_s, row.b_c)
        dx = bx - ax
        dy = by - ay
        return math.sqrt(dx * dx + dy * dy) - reach
    if track_a.path_radius == 0.0:
        along = row.b_s - row.a_s
        distance = 2.0 * math.sqrt(radius_a * radius_b)
        return (along - distance) * (along + distance) / (2.0 * reach)
    product = track_a.path_radius * track_b.path_radius
    return gap_on_arc(product, radius_a, radius_b, row.a_s, row.a_c, row.b_s, row.b_c)


@kernel
def gap_on_arc(
    product: float,
    radius_a: float,
    radius_b: float,
    a_s: float,
    a_c: float,
    b_s: float,
    b_c: float,
) -> float:
    """Return the gap (m) of two bodies on one arc, where ``product`` is ``rho_a rho_b``.

    ``d^2 - (r_a + r_b)^2 = 4 rho_a rho_b sin((delta - beta)/2) sin((delta + beta)/2)``.
    """
    half_sine = math.sqrt(radius_a * radius_b / product)
    short = min(half_sine, 1.0)
    half_cosine = math.sqrt(1.0 - short * short)
    delta = abs(b_s * a_c - b_c * a_s)
    cosine = abs(b_c * a_c + b_s * a_s)
    less = delta * half_cosine - cosine * half_sine
    more = delta * half_cosine + cosine * half_sine
    return 2.0 * product * less * more / (radius_a + radius_b)


@kernel
def _update_flight_statistics(
    world: World,
    known: int,
    outcome: Outcome,
    finals: Sequence[FinalState],
    first_final: int,
    scratch: Flight,
) -> None:
    """Tally the forces of every flight that has ended, and set the energies at the start."""
    for number in range(known, world.clock[0].flight_rows):
        row = world.log[number]
        final = finals[first_final + row.body]
        if row.cause == WALL:
            outcome.walls += 1
        if final.latest < 0:
            final.start_energy = energy_of_row(world, row, row.s, row.c, row.p)
        else:
            before = world.log[final.latest]
            duration = (row.t - before.t) + (row.t_low - before.t_low)
            end = (row.before_s, row.before_c, row.before_p)
            # Of several launches at one instant, only the last one has a duration.
            if duration > 0.0:
                _update_force_statistics(world, final.latest, duration, end, outcome, scratch)
        final.latest = number


@kernel
def _finish(world: World, outcome: Outcome, final: FinalState, scratch: Flight) -> None:
    """Tally the forces of a body's last flight, and set its state and energy at the end."""
    row = world.log[final.latest]
    duration = (outcome.end_t - row.t) + (outcome.end_t_low - row.t_low)
    replay_flight(world, row, final.latest, scratch)
    s, c, p = flow(scratch, duration)
    final.piece = row.piece
    final.s = s
    final.c = c
    final.p = p
    final.end_energy = energy_of_row(world, row, s, c, p)
    _update_force_statistics(world, final.latest, duration, (s, c, p), outcome, scratch)


@kernel
def _update_force_statistics(
    world: World,
    number: int,
    duration: float,
    end: tuple[float, float, float],
    outcome: Outcome,
    scratch: Flight,
) -> None:
    """Tally the normal forces and the friction demand of one flight.

    A group in lasting contact is tallied with the flight of its first body.
    """
    row = world.log[number]
    if row.grouped == 1 or row.at_rest == 1:
        first, _, _ = bodies_of(world, row)
        if first == row.body:
            known = (outcome.least_force, outcome.most_demand)
            least, demand = group_extremes(world, number, duration, end, known, scratch)
            outcome.least_force = least
            outcome.most_demand = demand
        return
    update_statistics_alone(world, number, duration, end, outcome, scratch)


@kernel
def update_statistics_alone(
    world: World,
    number: int,
    duration: float,
    end: tuple[float, float, float],
    outcome: Outcome,
    scratch: Flight,
) -> None:
    """Tally the normal forces and the friction demand of a flight of a body alone."""
    row = world.log[number]
    body = world.bodies[row.body]
    piece = world.pieces[row.piece]
    track = track_on(world, row.body, row.piece)
    if track.path_radius == 0.0:
        outcome.least_force = min(outcome.least_force, body.weight * piece.tangent_x)
        if body.kappa > 1.0:
            demand = friction_demand(
                body.weight * abs(piece.tangent_y) * (1.0 - 1.0 / body.kappa),
                body.weight * piece.tangent_x,
            )
            outcome.most_demand = max(outcome.most_demand, demand)
        return
    low, high = _range(row, track.frequency, duration, end)
    outcome.least_force, outcome.most_demand = arc_extremes(
        body, piece, row.parameter, low, high, outcome.least_force, outcome.most_demand
    )


@kernel
def arc_extremes(
    body: BodyData, piece: PieceData, m: float, low: float, high: float, least: float, most: float
) -> tuple[float, float]:
    """Return the least normal force (N) and greatest demand, updated by a flight on an arc.

    ``least`` and ``most`` are the former values. The flight has the parameter ``m``, and ``S^2``
    from ``low`` to ``high``; all may be lanes.
    """
    least = min(least, min(arc_force(body, piece, m, low), arc_force(body, piece, m, high)))
    most = max(most, _arc_demand(body, piece, m, low, most))
    most = max(most, _arc_demand(body, piece, m, high, most))
    # N/(m g) = sign (A + B cos f) with S^2 = (1 - cos f)/2.
    b = 1.0 + 2.0 / body.kappa
    a = 4.0 * m / body.kappa - 2.0 / body.kappa
    if any_lane(abs(a) > b):
        stationary = 0.5 * (1.0 + b / a)
        within = abs(a) > b and low <= stationary and stationary <= high
        there = _arc_demand(body, piece, m, stationary if within else low, most)
        most = max(most, there if within else 0.0)
    return least, most


@kernel
def _range(
    row: FlightRow, frequency: float, duration: float, final: tuple[float, float, float]
) -> tuple[float, float]:
    """Return the extremes of ``S^2`` over a flight on an arc."""
    end_s, end_c, end_p = final
    start = row.s * row.s
    end = end_s * end_s
    low = min(start, end)
    high = max(start, end)
    libration = row.complementary_modulus >= 0.0
    half = half_period(row, frequency, duration)
    whole = duration >= half
    moving = row.at_rest == 0
    if libration:
        reversed_ = row.p * end_p <= 0.0 and row.p != 0.0
        if moving and (whole or reversed_):
            high = row.parameter
    elif whole or row.c * end_c < 0.0:
        high = 1.0
    # The bottom: passed when S changes sign, or between two turning points.
    inward = row.s * row.c * row.p < 0.0
    again = libration and moving and inward and duration >= 0.5 * half
    if row.s * end_s < 0.0 or (moving and whole) or again:
        low = 0.0
    return low, high


@kernel
def arc_force(body: BodyData, piece: PieceData, m: float, s2: float) -> float:
    """Return the normal force (N) of a free flight of parameter ``m`` at ``S^2`` on an arc."""
    return body.weight * piece.sign * ((1.0 + 4.0 * m / body.kappa) - (2.0 + 4.0 / body.kappa) * s2)


@kernel
def _arc_demand(body: BodyData, piece: PieceData, m: float, s2: float, most: float) -> float:
    """Return the friction demand of a free flight at ``S^2``, or 0 if it is below ``most``.

    Squares are compared first, which saves a root and a quotient.
    """
    normal = arc_force(body, piece, m, s2)
    square = max(s2 * (1.0 - s2), 0.0)
    share = 1.0 - 1.0 / body.kappa
    pull = 2.0 * body.weight * share
    held = most * normal
    less = normal > 0.0 and pull * pull * square <= BELOW * (held * held)
    less = less or share == 0.0
    if not any_lane(not less):
        return 0.0 * normal
    force = body.weight * (2.0 * math.sqrt(square)) * share
    none_suffices = math.inf
    demand = force / normal if normal > 0.0 else none_suffices
    if_free = 0.0 if normal >= 0.0 else none_suffices
    return 0.0 if less else if_free if force == 0.0 else demand


TURN = 2.0 * math.pi


@kernel
def friction_demand(force: float, normal: float) -> float:
    """Return the coefficient of friction that a friction force needs; infinite for N <= 0."""
    if force == 0.0:
        return 0.0 if normal >= 0.0 else math.inf
    return force / normal if normal > 0.0 else math.inf


@kernel
def group_extremes(
    world: World,
    number: int,
    duration: float,
    end: tuple[float, float, float],
    known: tuple[float, float],
    scratch: Flight,
) -> tuple[float, float]:
    """Return the least normal force (N) and greatest demand, updated by a group's motion.

    ``known`` has the former values. ``number`` is the row of the flight of the first body, whose
    state after the duration (s) is ``end``; a body at rest is a group of one.
    """
    row = world.log[number]
    replay_flight(world, row, number, scratch)
    least, demand = known
    if not is_pendulum(scratch):
        segment = scratch.form == POLYNOMIAL and row.at_rest == 0
        middle = 0.5 * duration if segment else _turning_time(scratch, duration)
        for part in range(3):
            t = 0.0 if part == 0 else (middle if part == 1 else duration)
            if part == 0 or t > 0.0:
                set_forces(world, number, AT_TIME, t, scratch)
                note_forces(world, number, part)
                least, demand = _counted_in(world, row, least, demand)
        if segment:
            return _within_segment(world, number, duration, (least, demand), scratch)
        return least, demand
    low, high = pendulum_range(world, number, duration, end, scratch)
    fit_forces(world, number, scratch)
    for place in range(row.group_count):
        normal, needed = extremes_on_arc(world.forces[place], low, high)
        least = min(least, normal)
        demand = max(demand, needed)
    return least, demand


@kernel
def _within_segment(
    world: World, number: int, duration: float, known: tuple[float, float], scratch: Flight
) -> tuple[float, float]:
    """Tally the forces inside a segment where they may exceed the known extremes."""
    row = world.log[number]
    least, demand = known
    for place in range(row.group_count):
        for side in range(-1, 2):
            weight = 1.0 if side == 0 else demand
            if weight == math.inf:
                continue  # no demand is greater
            share, value = extreme_on_segment(world.forces[place], float(side), weight)
            if share > 0.0 and value > (-least if side == 0 else 0.0):
                set_forces(world, number, AT_TIME, share * duration, scratch)
                least, demand = _counted_in(world, row, least, demand)
    return least, demand


@kernel
def _counted_in(world: World, row: FlightRow, least: float, demand: float) -> tuple[float, float]:
    """Tally the forces on the bodies of a motion at one instant."""
    first, count, base = bodies_of(world, row)
    for place in range(count):
        one = world.forces[base + place]
        least = min(least, one.normal)
        if world.bodies[number_along(world, first, place)].kappa > 1.0:
            demand = max(demand, friction_demand(one.friction, one.normal))
    return least, demand


@kernel
def _turning_time(flight: Flight, duration: float) -> float:
    """Return the time (s) at which a group on a line of a rotating trace turns back, or 0.

    Its forces are extreme there and at both ends; on a trace at rest they are constant on a line.
    """
    if flight.form != TURNING_LINE or flight.at_rest == 1 or flight.flow_p == 0.0:
        return 0.0
    way = turn_on_line(flight)
    if way * flight.flow_p <= 0.0:
        return 0.0
    after = time_on_line(flight, way, 0.0)
    return after if after < duration else 0.0


@kernel
def extremes_on_arc(one: BodyForces, low: float, high: float) -> tuple[float, float]:
    """Return the least normal force (N) and greatest friction demand between two angles (rad)."""
    a = one.normal_terms[0]
    b = one.normal_terms[1]
    c = one.normal_terms[2]
    q = one.friction_terms[2]
    least, demand = _at_angle(a, b, c, q, low, math.inf, 0.0)
    least, demand = _at_angle(a, b, c, q, high, least, demand)
    lowest = _turned(math.atan2(c, b) + math.pi, low)
    if lowest <= high:
        least, demand = _at_angle(a, b, c, q, lowest, least, demand)
    if abs(a) > abs(b):
        steepest = math.acos(-b / a)
        for sign in range(2):
            f = _turned(steepest if sign == 0 else -steepest, low)
            if f <= high:
                least, demand = _at_angle(a, b, c, q, f, least, demand)
    return least, demand


@kernel
def _at_angle(
    a: float, b: float, c: float, q: float, f: float, least: float, demand: float
) -> tuple[float, float]:
    """Tally the forces at one angle of the pendulum."""
    normal = a + b * math.cos(f) + c * math.sin(f)
    needed = friction_demand(abs(q * math.sin(f)), normal) if q != 0.0 else 0.0
    return min(least, normal), max(demand, needed)


@kernel
def _turned(angle: float, low: float) -> float:
    """Return the first angle from ``low`` on that equals ``angle`` up to whole turns."""
    return angle + TURN * math.ceil((low - angle) / TURN)


@kernel
def pendulum_range(
    world: World, number: int, duration: float, end: tuple[float, float, float], flight: Flight
) -> tuple[float, float]:
    """Return the least and greatest angle (rad) of a group's pendulum during a motion."""
    end_s, end_c, end_p = end
    s = flight.flow_s
    c = flight.flow_c
    p = flight.flow_p
    start = 2.0 * math.atan2(s, c)
    stop_s, stop_c = group_of_body(flight, end_s, end_c)
    stop = 2.0 * math.atan2(stop_s, stop_c)
    if p == 0.0:
        # From rest the pendulum moves downwards.
        p = -s * c
    # Both angles are known up to two turns: take the end on the side to which the pendulum moves.
    if flight.complementary_modulus < 0.0:
        if (stop - start) * p < 0.0:
            stop += math.copysign(2.0 * TURN, p)
        return min(start, stop), max(start, stop)
    if abs(stop - start) > TURN:
        stop += math.copysign(2.0 * TURN, start)
    low = min(start, stop)
    high = max(start, stop)
    if flight.at_rest == 1:
        return low, high
    turn = 2.0 * math.atan2(math.sqrt(flight.parameter), flight.complementary_modulus)
    centre = 0.0 if c > 0.0 else math.copysign(TURN, s)
    half = half_period(world.log[number], flight.frequency, duration)
    twice = duration >= half and p * end_p > 0.0
    if duration >= 2.0 * half or twice or (p > 0.0 and end_p < 0.0):
        high = centre + turn
    if duration >= 2.0 * half or twice or (p < 0.0 and end_p > 0.0):
        low = centre - turn
    return low, high
