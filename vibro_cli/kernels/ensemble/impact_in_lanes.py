"""The next impact of two swings on one arc, for several scenarios in lanes at once.

The operations of ``kernels.events.event_handlers`` and ``kernels.flow.begin_flight`` for an impact
between librations
that are not near a crest or an end of the arc, and whose bounces are not small, without jumps.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

from vibro_cli.compile.kernel import kernel, struct
from vibro_cli.compile.lanes import Lanes, both, choose, either, opposite
from vibro_cli.kernels.contact.libration_contact_lanes import (
    BodyLanes,
    SwingLanes,
    contact_in_lanes,
)
from vibro_cli.kernels.flow.begin_flight import LEAST_SIZE, projected
from vibro_cli.kernels.flow.flight import (
    CREST_NEIGHBOURHOOD,
    head_on_arc,
    most_of_swings,
    size_of_root,
    widest_pull,
)
from vibro_cli.kernels.impact.chattering import SMALL_BOUNCE
from vibro_cli.kernels.impact.event_log import do_part
from vibro_cli.kernels.impact.laws import impact_of_pair
from vibro_cli.kernels.numerics.elliptic import PARAMETER_SPLIT, set_librations
from vibro_cli.kernels.numerics.error_free import add_to_time, time_between
from vibro_cli.kernels.statistics.run_statistics import gap_on_arc, half_angle_on_arc
from vibro_cli.kernels.statistics.statistics_in_lanes import (
    demand_in_lanes,
    force_in_lanes,
    range_in_lanes,
)
from vibro_cli.kernels.structs import TrackData
from vibro_cli.kernels.world import World


@struct
class RunLanes:
    """The run in every lane, fields as of ``Clock``, ``Settings`` and ``Outcome``."""

    piece: int  # the arc
    t: Lanes  # of the last impact, when both flights began
    t_low: Lanes
    restitution: Lanes
    stop_t: Lanes
    stop_collisions: Lanes
    collisions: Lanes
    impacts: Lanes  # made in the lane
    energy_correction: Lanes
    max_gap: Lanes
    least_force: Lanes
    most_demand: Lanes
    failed: Lanes  # 1: the next impact is not one for lanes


@struct
class LaneSlot:
    """The run that a lane works on."""

    point: int  # -1: none
    crossings: int  # so far, and lasting contacts
    contacts: int


class LaneGroup(NamedTuple):
    """What a group of lanes works on."""

    runs: Sequence[RunLanes]  # one
    bodies: Sequence[BodyLanes]  # two
    swings: Sequence[SwingLanes]  # two
    slots: Sequence[LaneSlot]  # one for each lane


@kernel
def next_impact(world: World, group: LaneGroup) -> bool:
    """Go on to the next impact in every lane; one that fails stays where it is.

    Returns
    -------
    Which lanes have failed or are at their last impact.
    """
    run = group.runs[0]
    a = group.swings[0]
    b = group.swings[1]
    track_a = world.tracks[run.piece]
    track_b = world.tracks[world.settings[0].pieces + run.piece]
    set_librations(a, a.parameter, a.root_complement, b, b.parameter, b.root_complement)
    if a.frequency != b.frequency:
        a.angular_bound = widest_pull(a.frequency, a.parameter)
        b.angular_bound = widest_pull(b.frequency, b.parameter)
    h, failed = contact_in_lanes(a, b, world.contacts[run.piece])
    t, t_low = add_to_time(run.t, run.t_low, h)
    failed = either(failed, time_between(t, t_low, run.stop_t, 0.0) >= 0.0)
    failed = either(failed, _project(a))
    failed = either(failed, _project(b))
    excess, lost = _collide(world, group)
    failed = either(failed, lost)
    failed = either(failed, either(_is_other(a, track_a), _is_other(b, track_b)))
    duration = (t - run.t) + (t_low - run.t_low)
    failed = either(failed, _count(world, group, duration, failed))
    run.t = choose(failed, run.t, t)
    run.t_low = choose(failed, run.t_low, t_low)
    done = choose(failed, 0.0, 1.0)
    run.failed = 1.0 - done
    run.collisions += done
    run.impacts += done
    run.energy_correction += choose(failed, 0.0, abs(excess))
    _take(a, failed)
    _take(b, failed)
    return either(failed, run.collisions >= run.stop_collisions)


@kernel
def _project(swing: SwingLanes) -> bool:
    """Project the state of contact (see ``kernels.flow.begin_flight.project``); where that
    fails."""
    s = swing.contact_s
    c = swing.contact_c
    p = swing.contact_p
    scale = 1.5 - 0.5 * (s * s + c * c)
    s *= scale
    c *= scale
    sc = s * c
    size = p * p + sc * sc
    s, c, p = projected(swing, s, c, p, sc, size)
    swing.contact_s = s
    swing.contact_c = c
    swing.contact_p = p
    return size < LEAST_SIZE


@kernel
def _collide(world: World, group: LaneGroup) -> tuple[Lanes, bool]:
    """Carry out the impact: states, energies and parameters after it.

    Returns
    -------
    What the energy lacked before it was shared (J), and in which lanes the impact is of another
    kind.
    """
    settings = world.settings[0]
    run = group.runs[0]
    a = group.swings[0]
    b = group.swings[1]
    body_a = group.bodies[0]
    body_b = group.bodies[1]
    contact = world.contacts[run.piece]
    track_a = world.tracks[run.piece]
    track_b = world.tracks[settings.pieces + run.piece]
    speed_a = track_a.speed_factor * a.contact_p
    speed_b = track_b.speed_factor * b.contact_p
    wa, wb, loss = impact_of_pair(
        settings.law, run.restitution, body_a, body_b,
        contact.normal_a, contact.normal_b, speed_a, speed_b,
    )  # fmt: skip
    size = abs(speed_a) + abs(speed_b)
    parts = do_part(contact.normal_a, contact.normal_b, wa, wb, size)
    u = contact.normal_b * wb - contact.normal_a * wa
    small = u * u <= SMALL_BOUNCE * settings.gravity * world.pairs[0].distance
    a.next_p = wa / track_a.speed_factor
    b.next_p = wb / track_b.speed_factor
    total = body_a.weight * a.head + body_b.weight * b.head - loss
    head_a = head_on_arc(track_a, a.contact_s, a.contact_c, a.next_p)
    head_b = head_on_arc(track_b, b.contact_s, b.contact_c, b.next_p)
    energy_a = body_a.weight * head_a
    energy_b = body_b.weight * head_b
    less = energy_a < energy_b
    # The body with less energy takes it from its state, the other one the rest.
    head = (total - choose(less, energy_a, energy_b)) / choose(less, body_b.weight, body_a.weight)
    a.next_head = choose(less, head_a, head)
    b.next_head = choose(less, head, head_b)
    m, root = _energy_of_state(a, b, less)
    rest, rest_root = _energy_of_head(track_a, track_b, less, head)
    a.next_m = choose(less, m, rest)
    b.next_m = choose(less, rest, m)
    a.next_root = choose(less, root, rest_root)
    b.next_root = choose(less, rest_root, root)
    sure = both(parts, either(less, energy_b < energy_a))
    return total - (energy_a + energy_b), either(small, opposite(sure))


@kernel
def _energy_of_state(a: SwingLanes, b: SwingLanes, of_a: bool) -> tuple[Lanes, Lanes]:
    """Parameter, and root of its complement, of one body in its state after the impact."""
    s = choose(of_a, a.contact_s, b.contact_s)
    c = choose(of_a, a.contact_c, b.contact_c)
    p = choose(of_a, a.next_p, b.next_p)
    root = size_of_root(c, p)
    return s * s + p * p, choose(abs(p) < abs(c), root, -1.0)


@kernel
def _energy_of_head(
    track_a: TrackData, track_b: TrackData, of_b: bool, head: Lanes
) -> tuple[Lanes, Lanes]:
    """Parameter, and root of its complement, of one body with an energy."""
    twice = choose(of_b, track_b.twice_radius, track_a.twice_radius)
    complement = (choose(of_b, track_b.top, track_a.top) - head) / twice
    m = max((head - choose(of_b, track_b.bottom, track_a.bottom)) / twice, 0.0)
    root = math.sqrt(abs(complement))
    return choose(complement < 0.5, 1.0 - complement, m), choose(complement > 0.0, root, -1.0)


@kernel
def _is_other(swing: SwingLanes, track: TrackData) -> bool:
    """Tell where the next flight is no libration far from a crest and the ends of the arc."""
    crest = swing.contact_c * swing.contact_c + swing.next_p * swing.next_p < CREST_NEIGHBOURHOOD
    most = min(PARAMETER_SPLIT, most_of_swings(track))
    swings = both(both(swing.next_m > 0.0, swing.next_m < most), swing.next_root > 0.0)
    return either(crest, opposite(swings))


@kernel
def _count(world: World, group: LaneGroup, duration: Lanes, failed: bool) -> bool:
    """Count in the flights that end, and the gap of the impact; where that is not sure."""
    run = group.runs[0]
    a = group.swings[0]
    b = group.swings[1]
    body_a = group.bodies[0]
    body_b = group.bodies[1]
    piece = world.pieces[run.piece]
    low_a, high_a, open_a = range_in_lanes(a, duration, a.contact_s, a.contact_p)
    low_b, high_b, open_b = range_in_lanes(b, duration, b.contact_s, b.contact_p)
    failed = either(failed, either(open_a, open_b))
    force = min(
        force_in_lanes(body_a, piece, a.parameter, low_a, high_a),
        force_in_lanes(body_b, piece, b.parameter, low_b, high_b),
    )
    run.least_force = choose(failed, run.least_force, min(run.least_force, force))
    most = demand_in_lanes(body_a, piece, a.parameter, low_a, high_a, run.most_demand)
    most = demand_in_lanes(body_b, piece, b.parameter, low_b, high_b, most)
    run.most_demand = choose(failed, run.most_demand, most)
    rho_a = world.tracks[run.piece].path_radius
    rho_b = world.tracks[world.settings[0].pieces + run.piece].path_radius
    sine, cosine = half_angle_on_arc(rho_a * rho_b, body_a.radius, body_b.radius)
    gap = gap_on_arc(
        rho_a * rho_b, body_a.radius + body_b.radius,
        a.contact_s, a.contact_c, b.contact_s, b.contact_c, sine, cosine,
    )  # fmt: skip
    run.max_gap = choose(failed, run.max_gap, max(run.max_gap, abs(gap)))
    return failed


@kernel
def _take(swing: SwingLanes, failed: bool) -> None:
    """Begin the next flight, but for the lanes that have failed."""
    swing.flow_s = choose(failed, swing.flow_s, swing.contact_s)
    swing.flow_c = choose(failed, swing.flow_c, swing.contact_c)
    swing.flow_p = choose(failed, swing.flow_p, swing.next_p)
    swing.head = choose(failed, swing.head, swing.next_head)
    swing.parameter = choose(failed, swing.parameter, swing.next_m)
    swing.root_complement = choose(failed, swing.root_complement, swing.next_root)
