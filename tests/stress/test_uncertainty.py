"""What the rounding of positions leaves open of instants, speeds and the order of impacts."""

from __future__ import annotations

import math

import pytest

from vibro_cli.stress.digits import (
    contact_uncertainty,
    first_uncertain_order,
    first_uncertain_separation,
    uncertain_instants,
)
from vibro_cli.stress.oracles.oracle import Bounce, Event, History
from vibro_cli.stress.oracles.scene import mp

SIZE = 4.0
EPSILON = 2.0**-52


def bounce(t: float, after: float, bodies: tuple[int, ...] = (0, 1)) -> Bounce:
    return Bounce(mp.mpf(t), bodies, mp.mpf(-1), mp.mpf(after), along=True)


def test_bounces_lower_than_the_rounding_of_places_leave_an_instant_open() -> None:
    closed = Event(mp.mpf(1), "contact_closed", 0, 1)
    # Of one pair they have a sum; with another one they have none, as far as they are lower.
    alone = History([closed], [bounce(1 - 1e-8, 1e-8), bounce(1, 0.0)])
    assert contact_uncertainty(alone, closed, SIZE) == 0.0
    beside = [bounce(0.5, 1.0), bounce(1 - 1e-8, 1e-8), bounce(1, 0.0, (1, 2)), bounce(1, 0.0)]
    row = History([closed], [bounce(0.4, 1.0, (1, 2)), *beside])
    assert contact_uncertainty(row, closed, SIZE) == pytest.approx(1e-8, rel=1e-6)
    # Nor at the start, where others may touch the pair.
    start = Event(mp.mpf(1e-8), "contact_closed", 0, 1)
    assert (
        contact_uncertainty(History([start], [bounce(0, 1e-8), bounce(1e-8, 0.0)]), start, SIZE)
        == 1e-8
    )
    # An impact with a speed is known up to the rounding of the way that it takes.
    hit = History([closed], [bounce(1, 0.0)])
    assert contact_uncertainty(hit, closed, SIZE) == pytest.approx(64 * EPSILON, rel=1e-6)


def test_an_impact_of_bodies_drawn_together_is_known_up_to_a_last_place() -> None:
    # Apart at 1 m/s, and together again at 1 m/s half a second later: 4 m/s² draw them.
    history = History([], [bounce(0.0, 1.0), bounce(0.5, 1.0), bounce(0.75, 0.5, (1, 2))])
    (left,) = uncertain_instants(history, SIZE, 9.81)
    assert left.t == 0.5
    assert left.time == pytest.approx(4.0 * EPSILON, rel=1e-12)
    assert left.speed == pytest.approx(16.0 * EPSILON, rel=1e-12)
    assert left.until == math.inf
    # It is gone where their contact closes.
    closed = Event(mp.mpf(2), "contact_closed", 0, 1)
    lasting = uncertain_instants(History([closed], history.bounces), SIZE, 9.81)
    assert [one.until for one in lasting if one.t == 0.5] == [2.0]


def test_lost_bounces_leave_open_what_gravity_does_meanwhile() -> None:
    lost = [bounce(1.0, 1e-8), bounce(1.0 + 1e-8, 1e-9, (1, 2)), bounce(1.0 + 2e-8, 1e-9)]
    after = [bounce(1.0 + 3e-8, 1.0, (1, 2)), bounce(2.0, 1.0)]
    history = History([], [bounce(0.5, 1.0, (1, 2)), *lost, *after])
    (left,) = (
        one for one in uncertain_instants(history, SIZE, 10.0) if one.speed == 40.0 * one.time
    )
    assert left.t == 1.0 + 1e-8
    assert left.time == pytest.approx(1e-8, rel=1e-6)


def test_a_body_hit_from_two_sides_at_once_leaves_their_order_open() -> None:
    way = 16.0 * EPSILON * SIZE
    hits = [bounce(0.5, 1.0), bounce(1.0, 1.0, (1, 2)), bounce(1.0 + 0.5 * way, 1.0)]
    assert first_uncertain_order(History([], hits), SIZE) == 1.0
    assert first_uncertain_order(History([], hits[:2]), SIZE) == math.inf
    # Simultaneous impacts of one instant, and bodies that are not involved.
    joint = [bounce(1.0, 1.0), bounce(1.0, 1.0, (1, 2))]
    apart = [bounce(1.0, 1.0), bounce(1.0 + 0.5 * way, 1.0, (2, 3))]
    assert first_uncertain_order(History([], joint), SIZE) == math.inf
    assert first_uncertain_order(History([], apart), SIZE) == math.inf


def test_contact_without_force_may_as_well_have_lasted() -> None:
    opened, closed = (
        Event(mp.mpf(t), f"contact_{kind}", 0, 1) for t, kind in ((1, "opened"), (1.5, "closed"))
    )
    alone = History([opened, closed], [])
    assert (
        contact_uncertainty(alone, opened, SIZE) == contact_uncertainty(alone, closed, SIZE) == 0.5
    )
    # Bodies that meet again with an impact have been apart.
    met = Event(mp.mpf(1.5), "impact", 0, 1)
    assert (
        contact_uncertainty(History([opened, met, closed], [bounce(1.5, 0.0)]), closed, SIZE)
        < 1e-12
    )


def test_motion_that_a_law_grows_out_of_bounces_lost_in_rounding_may_as_well_be_none() -> None:
    growing = [
        Bounce(mp.mpf(1.0 + t), (0, 1), mp.mpf(-v), mp.mpf(2.0 * v), along=False)
        for t, v in ((0.0, 1e-13), (1e-13, 2e-13), (3e-13, 4e-13), (7e-13, 1.0), (0.5, 2.0))
    ]
    assert first_uncertain_separation(History([], growing), SIZE) == float(growing[3].t)
    # Not if the law acts along the line of centres, nor if no bounce was lost.
    along = [one._replace(along=True) for one in growing]
    assert first_uncertain_separation(History([], along), SIZE) == math.inf
    assert first_uncertain_separation(History([], growing[3:]), SIZE) == math.inf
