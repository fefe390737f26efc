"""How each body arrives at the end of each of its flights, and the derivative of the flight."""

from __future__ import annotations

from collections.abc import Sequence

from vibro_cli.compile.kernel import FloatMatrix, IntMatrix, kernel, struct
from vibro_cli.kernels.flow.flow import acceleration_at
from vibro_cli.kernels.flow.replay import recall_flight
from vibro_cli.kernels.numerics.error_free import time_between
from vibro_cli.kernels.structs import Flight
from vibro_cli.kernels.tangent.flight_jacobian import flight_jacobian
from vibro_cli.kernels.world import START, World


@struct
class Arrival:
    """The end of one flight."""

    age: float  # its duration, s
    speed: float  # of the centre along its path, m/s
    acceleration: float  # along the path, m/s^2
    way_way: float  # derivative of way and speed to those at the start (m, m/s)
    way_speed: float
    speed_way: float
    speed_speed: float


@kernel
def find_arrivals(
    world: World,
    arrivals: Sequence[Arrival],
    current: IntMatrix,
    series: FloatMatrix,
    scratch: Sequence[Flight],
) -> None:
    """Fill in how the body of each row of the log of a whole run arrived at its start.

    Parameters
    ----------
    world
        With all rows of a run in its logs.
    arrivals
        As many as rows of the log; those of rows that no flight of the body ends at stay.
    current, series, scratch
        ``[0, body]``, a series and a flight to work with.
    """
    flight = scratch[0]
    for number in range(world.clock[0].flight_rows):
        row = world.log[number]
        if row.cause != START:
            arrival = arrivals[number]
            last = current[0, row.body]
            before = world.log[last]
            track = world.tracks[row.body * world.settings[0].pieces + before.piece]
            recall_flight(world, before, last, flight)
            age = time_between(row.t, row.t_low, before.t, before.t_low)
            one, two, three, four = flight_jacobian(flight, age, series)
            arrival.age = age
            arrival.speed = track.speed_factor * row.before_p
            arrival.acceleration = acceleration_at(
                flight, track.path_radius, age, row.before_s, row.before_c
            )
            arrival.way_way = one
            arrival.way_speed = two
            arrival.speed_way = three
            arrival.speed_speed = four
        current[0, row.body] = number
