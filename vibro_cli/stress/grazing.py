"""Flights that just touch or just do not: made at the instant of grazing and followed backwards.

At that instant the gap is ``-overshoot R``, its rate zero and its second derivative positive. The
backward motion is in plain doubles (short Taylor steps of the pendulum equation), which places a
flight within some 1e-15 R of what was meant; what then truly happens the judge decides.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from vibro_cli.compile.native import compiled
from vibro_cli.mechanics.trace import Piece
from vibro_cli.stress.flights import GRAVITY, LEAST_GAP, Family, States, centres_of, distances
from vibro_cli.stress.kernels import ORDER, follow_all

_HALVINGS = 70
_CHECKS = 8  # instants of the way back at which the bodies must be on their pieces
_SMALLEST, _LARGEST = -13.0, -2.0  # powers of ten of the overshoot, in radii of the arc


def _follow_body(family: Family, ball: int, states: States, times: Any) -> tuple[Any, Any]:
    """Places and speeds of one body after the given times (negative: before)."""
    piece, body = family.pieces[ball], family.system.bodies[ball]
    places, speeds = states.places[:, ball].copy(), states.speeds[:, ball].copy()
    if piece.is_line:
        pull = -GRAVITY / body.kappa * math.sin(piece.start_slope)
        return places + times * (speeds + 0.5 * pull * times), speeds + pull * times
    rho = piece.path_radius(body.radius)
    rates = speeds / rho
    w = math.sqrt(GRAVITY / (body.kappa * rho))
    compiled(follow_all)(piece.sign, w, places, rates, times, np.zeros((3, ORDER + 2)))
    return places, rates * rho


def _slopes(piece: Piece, places: Any) -> Any:
    return np.full(len(places), piece.start_slope) if piece.is_line else piece.sign * places


def _place_beside(family: Family, places: Any, distance: Any) -> tuple[Any, Any]:
    """Places of the right body at the given distances of the centres, and where there is one."""
    first, last = family.pieces
    low = places.copy() if first is last else np.full(len(places), last.angle_start)
    high = np.full(len(places), last.angle_end)
    if first is last and not last.is_line:
        high = np.minimum(high, places + math.pi)

    def apart(candidates: Any) -> Any:
        return distances(family, States(np.stack([places, candidates], axis=1), 0.0, 0.0))

    found = (apart(low) < distance) & (apart(high) > distance)
    for _ in range(_HALVINGS):
        middle = 0.5 * (low + high)
        near = apart(middle) < distance
        low, high = np.where(near, middle, low), np.where(near, high, middle)
    return 0.5 * (low + high), found


def _second_derivative(family: Family, states: States) -> tuple[Any, Any]:
    """Speed of the right body at which the gap has no rate, and the gap's second derivative."""
    centres = centres_of(family, states)
    dx, dy = (centres[1][axis] - centres[0][axis] for axis in range(2))
    tangents = []
    for ball, piece in enumerate(family.pieces):
        slopes = _slopes(piece, states.places[:, ball])
        tangents.append((np.cos(slopes), np.sin(slopes)))
    along = [dx * tx + dy * ty for tx, ty in tangents]
    speed_a = states.speeds[:, 0]
    speed_b = speed_a * along[0] / along[1]
    second = np.zeros(len(dx))
    for side, ball, speed in ((-1.0, 0, speed_a), (1.0, 1, speed_b)):
        piece, body = family.pieces[ball], family.system.bodies[ball]
        tx, ty = tangents[ball]
        central = 0.0 if piece.is_line else piece.sign * speed**2 / piece.path_radius(body.radius)
        pull = -GRAVITY / body.kappa * ty
        second += side * (dx * (pull * tx - central * ty) + dy * (pull * ty + central * tx))
    across_x = speed_b * tangents[1][0] - speed_a * tangents[0][0]
    across_y = speed_b * tangents[1][1] - speed_a * tangents[0][1]
    return speed_b, second + across_x**2 + across_y**2


def near_grazing(rng: np.random.Generator, family: Family, tries: int) -> tuple[States, Any]:
    """Flights of a family close to grazing, and their overshoots (m; negative: they stay apart).

    Returns fewer than ``tries``: where bodies would leave their pieces or press there are none.
    """
    first, last = family.pieces
    sizes = [piece.length if piece.is_line else piece.radius for piece in (first, last)]
    powers = rng.uniform(_SMALLEST, _LARGEST, tries)
    # Every fourth a whole power of ten, both ends among them.
    powers = np.where(rng.random(tries) < 0.25, np.round(powers), powers)
    overshoot = min(sizes) * 10.0**powers
    overshoot *= rng.choice([-1.0, 1.0], tries)
    touch = sum(body.radius for body in family.system.bodies)
    low = first.angle_start
    if first is not last:
        reach = 4.0 * touch / (1.0 if first.is_line else first.radius)
        low = max(low, first.angle_end - reach)
    places = np.zeros((tries, 2))
    places[:, 0] = rng.uniform(low, first.angle_end, tries)
    places[:, 1], found = _place_beside(family, places[:, 0], touch - overshoot)
    speeds = np.zeros((tries, 2))
    speeds[:, 0] = rng.normal(0.0, 1.0, tries) * math.sqrt(GRAVITY * min(sizes))
    backwards = math.sqrt(max(sizes) / GRAVITY) * 10.0 ** rng.uniform(-1.5, 0.3, tries)
    states, overshoot = States(places, speeds, backwards).part(found), overshoot[found]
    states.speeds[:, 1], second = _second_derivative(family, states)
    chosen = (second > 1.0e-3 * GRAVITY * touch) & (abs(states.speeds[:, 1]) < 20.0)
    return _go_back(family, states.part(chosen), overshoot[chosen])


def _go_back(family: Family, states: States, overshoot: Any) -> tuple[States, Any]:
    """The states before grazing, of those that come from within their pieces and from apart."""
    inside = np.ones(len(overshoot), dtype=bool)
    step = -states.horizon / _CHECKS
    before = States(states.places.copy(), states.speeds.copy(), 2.0 * states.horizon)
    for _ in range(_CHECKS):
        for ball, piece in enumerate(family.pieces):
            places, speeds = _follow_body(family, ball, before, step)
            before.places[:, ball], before.speeds[:, ball] = places, speeds
            inside &= (places > piece.angle_start) & (places < piece.angle_end)
    touch = sum(body.radius for body in family.system.bodies)
    if family.pieces[0] is family.pieces[1]:
        inside &= before.places[:, 0] < before.places[:, 1]
    inside &= distances(family, before) > touch * (1.0 + LEAST_GAP)
    return before.part(inside), overshoot[inside]
