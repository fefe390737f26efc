"""What a summary says of a run on a turning trace: energies, normal forces, friction.

On an arc both forces are trigonometric polynomials of degree 2 in the angle, on a line linear in
the place. Friction is that along the trace: what holds a body in the trace's plane against the
Coriolis force ``2 m Omega v cos(alpha)`` is taken to be smooth. The kernels stand in for those of
``simulation.tally`` and ``simulation.tally_contact``.
"""

from __future__ import annotations

import math

from vibro_cli.mechanics.flow import group_of_body
from vibro_cli.mechanics.records import BodyData, Flight, TrackData
from vibro_cli.mechanics.turning_fall import press_harmonics, pull_harmonics, scaled
from vibro_cli.mechanics.turning_flight import potential_head
from vibro_cli.mechanics.turning_flow import TURNING_LINE, pull_of
from vibro_cli.mechanics.turning_passage import half_way, time_on_line, turn_on_line
from vibro_cli.numerics.engine import kernel
from vibro_cli.numerics.harmonics import Harmonics, greatest_quotient, least_value, turned
from vibro_cli.numerics.quartic import period_of, squared_rate
from vibro_cli.numerics.trigonometry import sine_cosine
from vibro_cli.simulation.recall import recall_flight
from vibro_cli.simulation.tally import Outcome
from vibro_cli.simulation.tally_contact import (
    HALF_COSINES,
    HALF_SINES,
    friction_demand,
    member_force,
    row_of,
)
from vibro_cli.simulation.world import FlightRow, World

# The first of the five angles at which the forces of a group are fitted.
FIRST = 3


@kernel
def energy_of_row(world: World, row: FlightRow, s: float, c: float, p: float) -> float:
    """Energy (J) of a body; carried on a free flight, from the state in lasting contact."""
    body = world.bodies[row.body]
    if row.grouped == 0:
        return body.weight * row.head
    gravity = world.settings[0].gravity
    track = world.tracks[row.body * world.settings[0].pieces + row.piece]
    speed = track.speed_factor * p
    kinetic = 0.5 * body.kappa * speed * speed / gravity
    return body.weight * (potential_head(track, gravity, body.kappa, s, c) + kinetic)


@kernel
def arc_share(track: TrackData, kappa: float, s: float, c: float, squared: float) -> float:
    """``N/(m g)``, up to the sign of the arc, of a body at ``(S, C)`` with ``P^2 = squared``."""
    sine = 2.0 * s * c
    cosine = (c - s) * (c + s)
    return cosine + sine * (track.tilt + track.spread * sine) + 4.0 / kappa * squared


@kernel
def half_range(
    flight: Flight, end: tuple[float, float, float], duration: float
) -> tuple[float, float]:
    """Half the angles (rad) from its start that a flight on an arc takes in."""
    end_s, end_c, end_p = end
    half = math.atan2(
        end_s * flight.flow_c - end_c * flight.flow_s, end_c * flight.flow_c + end_s * flight.flow_s
    )
    low = min(half, 0.0)
    high = max(half, 0.0)
    if flight.at_rest == 1 or flight.turns_over == 1:
        return low, high
    start_p = flight.flow_p if flight.flow_p != 0.0 else flight.quartic_3
    whole = flight.frequency * duration >= period_of(flight)
    # With equal directions at both ends it has turned twice, or gone straight on.
    twice = whole or (start_p * end_p > 0.0 and half * start_p <= 0.0)
    if twice or (start_p > 0.0 and end_p <= 0.0):
        high = max(high, half_way(flight, 1.0))
    if twice or (start_p < 0.0 and end_p >= 0.0):
        low = min(low, -half_way(flight, -1.0))
    return low, high


@kernel
def tally_alone(
    world: World,
    number: int,
    duration: float,
    end: tuple[float, float, float],
    outcome: Outcome,
    scratch: Flight,
) -> None:
    """Count in the normal forces and the demand of friction of a flight of a body by itself."""
    row = world.log[number]
    body = world.bodies[row.body]
    track = world.tracks[row.body * world.settings[0].pieces + row.piece]
    recall_flight(world, row, number, scratch)
    end_s, _, end_p = end
    if track.path_radius == 0.0:
        _tally_on_line(body, track, row.s, outcome)
        _tally_on_line(body, track, end_s, outcome)
        if row.p * end_p < 0.0:
            _tally_on_line(body, track, row.s + turn_on_line(scratch), outcome)
        return
    low, high = half_range(scratch, end, duration)
    sign = world.pieces[row.piece].sign
    least = math.inf
    for place in range(track.extreme_count + 2):
        half = low if place == 0 else high
        if place > 1:
            # Where it is extreme whatever the energy.
            s = track.extremes[2 * place - 4]
            c = track.extremes[2 * place - 3]
            half = math.atan2(s * row.c - c * row.s, c * row.c + s * row.s)
        if low <= half <= high:
            s, c = sine_cosine(half)
            rate = squared_rate(scratch, s, c)
            s, c = row.s * c + row.c * s, row.c * c - row.s * s
            least = min(least, sign * arc_share(track, body.kappa, s, c, rate))
    outcome.least_force = min(outcome.least_force, body.weight * least)
    most = track.most_angular / (track.frequency * track.frequency) * (1.0 - 1.0 / body.kappa)
    if most == 0.0 or outcome.most_demand * least >= most:
        # What is known is more than all that this flight can need.
        return
    if least <= 0.0:
        outcome.most_demand = math.inf
        return
    press = scaled(sign, press_harmonics(scratch, track.tilt, track.spread, body.kappa))
    pull = scaled(1.0 - 1.0 / body.kappa, pull_harmonics(scratch))
    outcome.most_demand = _greatest(pull, press, 2.0 * low, 2.0 * high, outcome.most_demand)


@kernel
def _greatest(top: Harmonics, below: Harmonics, low: float, high: float, known: float) -> float:
    """The greatest ``|top|/below`` between two angles (rad), or ``known`` if that is greater."""
    sine, cosine = sine_cosine(low)
    return greatest_quotient(
        turned(top, sine, cosine), turned(below, sine, cosine), high - low, known
    )


@kernel
def _tally_on_line(body: BodyData, track: TrackData, s: float, outcome: Outcome) -> None:
    """Count in the forces at a place (m) of a line: both are linear between its ends."""
    normal = body.weight * (track.line_press + track.line_press_growth * s)
    pull = track.line_acceleration + track.line_growth * track.line_growth * s
    demand = friction_demand((body.kappa - 1.0) * body.mass * abs(pull), normal)
    outcome.least_force = min(outcome.least_force, normal)
    outcome.most_demand = max(outcome.most_demand, demand)


@kernel
def pendulum_range(
    world: World, number: int, duration: float, end: tuple[float, float, float], flight: Flight
) -> tuple[float, float]:
    """Least and greatest angle (rad) from its start that a group takes in."""
    end_s, end_c, end_p = end
    s, c = group_of_body(flight, end_s, end_c)
    low, high = half_range(flight, (s, c, end_p / flight.rate_ratio), duration)
    return 2.0 * low, 2.0 * high


@kernel
def pendulum_at(flight: Flight, sine: float, cosine: float) -> tuple[float, float, float, float]:
    """``(S, C)``, ``f''`` and ``f'^2`` of a group half an angle from its start."""
    s = flight.flow_s * cosine + flight.flow_c * sine
    c = flight.flow_c * cosine - flight.flow_s * sine
    w2 = flight.frequency * flight.frequency
    square = 4.0 * w2 * squared_rate(flight, sine, cosine)
    return s, c, w2 * pull_of(flight, s, c), square


@kernel
def member_of_pendulum(
    world: World, number: int, last: int, member: int, low: float, high: float, scratch: Flight
) -> tuple[float, float]:
    """Extremes on one arc, from the normal force fitted at five angles."""
    a = 0.0
    b = 0.0
    c = 0.0
    d = 0.0
    e = 0.0
    for angle in range(FIRST, FIRST + 5):
        normal, _ = member_force(world, number, last, member, angle, 0.0, scratch)
        s = HALF_SINES[angle]
        k = HALF_COSINES[angle]
        sine = 2.0 * s * k
        cosine = (k - s) * (k + s)
        a += 0.2 * normal
        b += 0.4 * normal * cosine
        c += 0.4 * normal * sine
        d += 0.4 * normal * ((cosine - sine) * (cosine + sine))
        e += 0.4 * normal * (2.0 * sine * cosine)
    index = row_of(world, number, last, member)
    row = world.log[index]
    body = world.bodies[row.body]
    track = world.tracks[row.body * world.settings[0].pieces + row.piece]
    recall_flight(world, row, index, scratch)
    sine, cosine = sine_cosine(low)
    least = least_value(turned((a, b, c, d, e), sine, cosine), high - low)
    if body.kappa == 1.0:
        return least, 0.0
    if least <= 0.0:
        return least, math.inf
    w2 = scratch.frequency * scratch.frequency
    size = (body.kappa - 1.0) * body.mass * track.path_radius * w2
    drag = scaled(size, pull_harmonics(scratch))
    return least, _greatest(drag, (a, b, c, d, e), low, high, 0.0)


@kernel
def turning_time_on_line(flight: Flight, duration: float) -> float:
    """Time (s) within a motion at which a group on a line turns back, or 0."""
    if flight.form != TURNING_LINE or flight.at_rest == 1 or flight.flow_p == 0.0:
        return 0.0
    way = turn_on_line(flight)
    if way * flight.flow_p <= 0.0:
        return 0.0
    after = time_on_line(flight, way, 0.0)
    return after if after < duration else 0.0
