"""Flights from their rows in the log, as the kernels of the flow take them."""

from __future__ import annotations

import math
from collections.abc import Sequence

from vibro_cli.compile.kernel import SERIES_LENGTH, kernel, struct
from vibro_cli.kernels.flow.flow import LINE, POLYNOMIAL, flow
from vibro_cli.kernels.numerics.elliptic import quarter_period, set_theta_constants
from vibro_cli.kernels.world import NEVER, Flight, FlightRow, TrackData, World

# Share by which a bound on a half period is lowered, so that rounding cannot make it pass over one.
CAUTION = 1.0e-9


@struct
class Sample:
    """One body at one time."""

    row: int  # of the log
    after: float  # from the start of that flight, s
    s: float
    c: float
    p: float
    energy: float  # J


@kernel
def recall_flight(world: World, row: FlightRow, number: int, flight: Flight) -> None:
    """Set up a flight from its row, the ``number``-th of the log, so that its flow can be asked."""
    track = world.tracks[row.body * world.settings[0].pieces + row.piece]
    flight.piece = row.piece
    flight.s = row.s
    flight.c = row.c
    flight.p = row.p
    flight.at_rest = row.at_rest
    flight.grouped = row.grouped
    flight.form = 0
    flight.own_frequency = track.frequency
    flight.frequency = track.frequency
    flight.flow_s = row.s
    flight.flow_c = row.c
    flight.flow_p = row.p
    if row.grouped == 1:
        recall_group(world, row, number, flight)
        if flight.form == POLYNOMIAL:
            flight.half_curvature = 0.5 / track.path_radius if track.path_radius > 0.0 else 0.0
            return
    recall_flow(track, row, flight)


@kernel
def recall_flow(track: TrackData, row: FlightRow, flight: Flight) -> None:
    """Set the form and the constants of a flow in closed form."""
    if track.path_radius == 0.0:
        flight.form = LINE
        if row.grouped == 0:
            flight.line_acceleration = track.line_acceleration
        return
    set_theta_constants(flight, row.parameter, row.root_complement)


@kernel
def recall_group(world: World, row: FlightRow, number: int, flight: Flight) -> None:
    """Fill in what a flight in lasting contact has beyond its own state."""
    flight.flow_s = row.flow_s
    flight.flow_c = row.flow_c
    flight.flow_p = row.flow_p
    flight.shift_s = row.shift_s
    flight.shift_c = row.shift_c
    flight.rate_ratio = row.rate_ratio
    flight.frequency = row.frequency
    flight.line_acceleration = row.line_acceleration
    flight.segment = row.segment
    # Rows of segments are in order of their flights.
    low = 0
    high = world.clock[0].segment_rows
    while low < high:
        middle = (low + high) // 2
        if world.segments[middle].flight < number:
            low = middle + 1
        else:
            high = middle
    if low < world.clock[0].segment_rows and world.segments[low].flight == number:
        # Without an end in time it is no segment: what the row has is of a closed form.
        if flight.segment < NEVER:
            flight.form = POLYNOMIAL
        for k in range(SERIES_LENGTH):
            flight.series[k] = world.segments[low].series[k]


@kernel
def half_period(row: FlightRow, frequency: float, duration: float) -> float:
    """Half the period (s) of a flight's full orbit, or a time that stands for it.

    It is asked for to be compared, as a whole and by half, with the duration: where bounds decide
    that, one of them or infinity is returned.
    """
    # K >= pi/2, and K/sqrt(m) for a rotation.
    argument = frequency * duration
    least = 0.5 * math.pi * (1.0 - CAUTION) / math.sqrt(max(row.parameter, 1.0))
    if argument < least:
        return NEVER
    if row.root_complement > 0.0:
        # K = pi/2 over the mean of 1 and k' that is between their arithmetic and geometric ones;
        # here those of (1 + k')/2 and sqrt k'.
        root = math.sqrt(row.root_complement)
        least = (2.0 * math.pi) * (1.0 - CAUTION) / ((1.0 + root) * (1.0 + root))
        if argument < least:
            return NEVER
        if argument < 2.0 * least:
            mean = math.sqrt(2.0 * (1.0 + row.root_complement) * root)
            if argument > math.pi * (1.0 + CAUTION) / mean:
                return 2.0 * least / frequency
    return 2.0 * quarter_period(row.parameter, row.root_complement) / frequency


@kernel
def energy_of_row(world: World, row: FlightRow, s: float, c: float, p: float) -> float:
    """Energy (J) of a body; carried on a free flight, from the state in lasting contact."""
    body = world.bodies[row.body]
    if row.grouped == 0:
        return body.weight * row.head
    track = world.tracks[row.body * world.settings[0].pieces + row.piece]
    rise = track.line_rise * s if track.path_radius == 0.0 else 2.0 * track.path_radius * s * s
    speed = track.speed_factor * p
    kinetic = 0.5 * body.kappa * speed * speed / world.settings[0].gravity
    return body.weight * (track.bottom + rise + kinetic)


@kernel
def sample_flights(
    world: World, samples: Sequence[Sample], count: int, scratch: Sequence[Flight]
) -> None:
    """Fill in states; it takes least time if those of a flight stand together."""
    flight = scratch[0]
    row = -1
    for number in range(count):
        sample = samples[number]
        if sample.row != row:
            row = sample.row
            recall_flight(world, world.log[row], row, flight)
        sample.s, sample.c, sample.p = flow(flight, sample.after)
        sample.energy = energy_of_row(world, world.log[row], sample.s, sample.c, sample.p)
