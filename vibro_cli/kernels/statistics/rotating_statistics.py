"""What a summary says of a run on a turning trace: energies, normal forces, friction.

On an arc both forces are trigonometric polynomials of degree 2 in the angle, on a line linear in
the place. Friction is that along the trace: what holds a body in the trace's plane against the
Coriolis force ``2 m Omega v cos(alpha)`` is taken to be smooth. The kernels stand in for those of
``kernels.statistics.run_statistics`` and ``kernels.statistics.run_statistics``.
"""

from __future__ import annotations

import math

from vibro_cli.compile.kernel import kernel
from vibro_cli.kernels.cluster.rotating_clusters import kept
from vibro_cli.kernels.flow.flow import group_of_body
from vibro_cli.kernels.flow.replay import recall_flight
from vibro_cli.kernels.flow.rotating_flight import (
    potential,
    press_harmonics,
    pull_harmonics,
    scaled,
)
from vibro_cli.kernels.flow.rotating_flow import (
    TURNING_LINE,
    half_range,
    time_on_line,
    turn_on_line,
)
from vibro_cli.kernels.numerics.elliptic import sine_cosine
from vibro_cli.kernels.numerics.trigonometric_polynomial import (
    Harmonics,
    greatest_quotient,
    harmonic_size,
    least_value,
    turned,
)
from vibro_cli.kernels.numerics.weierstrass_motion import squared_rate
from vibro_cli.kernels.statistics.run_statistics import Outcome, friction_demand
from vibro_cli.kernels.world import BodyData, BodyForces, Flight, FlightRow, TrackData, World

# Where bounds leave this share of a body's weight, no rounding leads beyond them.
CAUTION = 1.0e-6


@kernel
def arc_share(track: TrackData, kappa: float, s: float, c: float, squared: float) -> float:
    """``N/(m g)``, up to the sign of the arc, of a body at ``(S, C)`` with ``P^2 = squared``."""
    sine = 2.0 * s * c
    cosine = (c - s) * (c + s)
    return cosine + sine * (track.tilt + track.spread * sine) + 4.0 / kappa * squared


@kernel
def least_share(track: TrackData, sign: float, kappa: float, energy: float) -> float:
    """Bound from below of ``N/(m g)`` all over an arc, of a flight with ``P^2 + potential``."""
    least = track.least_press + sign * (4.0 / kappa) * energy
    return max(least, track.least_still) if sign > 0.0 else least


@kernel
def _tells_nothing(
    body: BodyData, sign: float, track: TrackData, row: FlightRow, most: float, outcome: Outcome
) -> bool:
    """Tell whether a flight on an arc has surely neither less force nor more demand than known."""
    energy = row.p * row.p + potential(track, row.s, row.c)
    least = least_share(track, sign, body.kappa, energy)
    least -= CAUTION * (1.0 + abs(track.tilt) + track.spread + 4.0 * abs(energy))
    if body.weight * least < outcome.least_force:
        return False
    return most == 0.0 or outcome.most_demand == math.inf or outcome.most_demand * least >= most


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
    sign = world.pieces[row.piece].sign
    most = 0.0
    if sign != 0.0:
        most = track.most_angular / (track.frequency * track.frequency) * (1.0 - 1.0 / body.kappa)
        if _tells_nothing(body, sign, track, row, most, outcome):
            return
    recall_flight(world, row, number, scratch)
    end_s, _, end_p = end
    if track.path_radius == 0.0:
        _tally_on_line(body, track, row.s, outcome)
        _tally_on_line(body, track, end_s, outcome)
        if row.p * end_p < 0.0:
            _tally_on_line(body, track, row.s + turn_on_line(scratch), outcome)
        return
    low, high = half_range(scratch, end, duration)
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
def extremes_on_arc(one: BodyForces, low: float, high: float) -> tuple[float, float]:
    """Extremes of the normal force (N) and the demand of friction between two angles (rad)."""
    press = kept(one.press)
    drag = kept(one.drag)
    sine, cosine = sine_cosine(low)
    least = least_value(turned(press, sine, cosine), high - low)
    if harmonic_size(drag) == 0.0:
        return least, 0.0
    if least <= 0.0:
        return least, math.inf
    return least, _greatest(drag, press, low, high, 0.0)


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
