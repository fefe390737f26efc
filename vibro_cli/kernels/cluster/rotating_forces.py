"""What a rotating trace bears of bodies on one motion, alone or in contact.

On an arc normal force and friction are trigonometric polynomials of degree 2 in the angle from the
start of the motion, on a line they are linear in the way from there. The kernels stand in for those
of ``kernels.cluster.trace_forces``.
"""

from __future__ import annotations

from vibro_cli.compile.kernel import Series, kernel
from vibro_cli.kernels.cluster.trace_forces import (
    AT_WAY,
    HALF_COSINES,
    HALF_SINES,
    bodies_of,
    set_forces,
)
from vibro_cli.kernels.flow.flow import POLYNOMIAL
from vibro_cli.kernels.flow.replay import recall_flight
from vibro_cli.kernels.flow.rotating_flow import TURNING_LINE, pull_of
from vibro_cli.kernels.flow.rotating_line import press_harmonics, pull_harmonics, scaled
from vibro_cli.kernels.numerics.trigonometric_polynomial import Harmonics
from vibro_cli.kernels.numerics.weierstrass_motion import squared_rate
from vibro_cli.kernels.structs import BodyForces, Flight
from vibro_cli.kernels.world import World

# The first of the five angles at which the forces of a group are fitted.
FIRST = 3


@kernel
def pendulum_at(flight: Flight, sine: float, cosine: float) -> tuple[float, float, float, float]:
    """``(S, C)``, ``f''`` and ``f'^2`` of a group half an angle from its start."""
    s = flight.flow_s * cosine + flight.flow_c * sine
    c = flight.flow_c * cosine - flight.flow_s * sine
    w2 = flight.frequency * flight.frequency
    square = 4.0 * w2 * squared_rate(flight, sine, cosine)
    return s, c, w2 * pull_of(flight, s, c), square


@kernel
def fit_forces(world: World, number: int, scratch: Flight) -> None:
    """Set the forces of every body of a motion as functions of its angle, or its way on a line."""
    row = world.log[number]
    recall_flight(world, row, number, scratch)
    if scratch.at_rest == 1 or scratch.form == POLYNOMIAL:
        return
    if scratch.form == TURNING_LINE:
        _fit_on_line(world, number, scratch)
    elif row.grouped == 1:
        _fit_group(world, number, scratch)
    else:
        body = world.bodies[row.body]
        track = world.tracks[row.body * world.settings[0].pieces + row.piece]
        one = world.forces[world.settings[0].bodies]
        press = press_harmonics(scratch, track.tilt, track.spread, body.kappa)
        put(one.press, scaled(body.weight * world.pieces[row.piece].sign, press))
        pull = pull_harmonics(scratch)
        put(one.drag, scaled(body.weight * (1.0 - 1.0 / body.kappa), pull))


@kernel
def put(series: Series, h: Harmonics) -> None:
    """Keep the coefficients of a function."""
    series[0], series[1], series[2], series[3], series[4] = h


@kernel
def kept(series: Series) -> Harmonics:
    """Return them."""
    return series[0], series[1], series[2], series[3], series[4]


@kernel
def _fit_group(world: World, number: int, scratch: Flight) -> None:
    """From the forces at five angles."""
    row = world.log[number]
    first, count, base = bodies_of(world, row)
    for place in range(count):
        put(world.forces[base + place].press, (0.0, 0.0, 0.0, 0.0, 0.0))
    for angle in range(FIRST, FIRST + 5):
        set_forces(world, number, angle, 0.0, scratch)
        s = HALF_SINES[angle]
        c = HALF_COSINES[angle]
        for place in range(count):
            _add_angle(world.forces[base + place], 2.0 * s * c, (c - s) * (c + s))
    recall_flight(world, row, number, scratch)
    pull = pull_harmonics(scratch)
    for place in range(count):
        ball = (first + place) % world.settings[0].bodies
        body = world.bodies[ball]
        rho = world.tracks[ball * world.settings[0].pieces + row.piece].path_radius
        w2 = scratch.frequency * scratch.frequency
        put(
            world.forces[base + place].drag, scaled((body.kappa - 1.0) * body.mass * rho * w2, pull)
        )


@kernel
def _add_angle(one: BodyForces, sine: float, cosine: float) -> None:
    """Count in the normal force at one of the fitted angles."""
    normal = one.normal
    one.press[0] += 0.2 * normal
    one.press[1] += 0.4 * normal * cosine
    one.press[2] += 0.4 * normal * sine
    one.press[3] += 0.4 * normal * ((cosine - sine) * (cosine + sine))
    one.press[4] += 0.4 * normal * (2.0 * sine * cosine)


@kernel
def _fit_on_line(world: World, number: int, scratch: Flight) -> None:
    """From the forces at the start and a metre on: both are linear in the way."""
    row = world.log[number]
    first, count, base = bodies_of(world, row)
    for at in range(2):
        set_forces(world, number, AT_WAY, 1.0 - at, scratch)
        for place in range(count):
            one = world.forces[base + place]
            body = world.bodies[(first + place) % world.settings[0].bodies]
            force = (body.kappa - 1.0) * body.mass * one.acceleration
            one.press[1] = one.normal if at == 0 else one.press[1] - one.normal
            one.press[0] = one.normal
            one.drag[1] = force if at == 0 else one.drag[1] - force
            one.drag[0] = force
