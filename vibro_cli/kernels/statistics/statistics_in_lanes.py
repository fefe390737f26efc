"""What a summary gathers of flights between impacts, for several scenarios in lanes at once.

The sums of ``kernels.statistics.run_statistics`` for librations that one impact after the other
ends; what bounds
do not decide there is left to it: the lane fails.
"""

from __future__ import annotations

import math

from vibro_cli.compile.kernel import kernel
from vibro_cli.compile.lanes import Lanes, any_lane, both, choose, either, opposite
from vibro_cli.kernels.contact.libration_contact_lanes import BodyLanes, SwingLanes
from vibro_cli.kernels.flow.replay import CAUTION
from vibro_cli.kernels.statistics.run_statistics import BELOW, arc_force
from vibro_cli.kernels.structs import PieceData


@kernel
def range_in_lanes(
    swing: SwingLanes, duration: Lanes, s: Lanes, p: Lanes
) -> tuple[Lanes, Lanes, bool]:
    """Extremes of ``S^2`` over a flight that ends in a state; in which lanes they are not sure.

    How often a half period and its half fit into the flight is decided by bounds of the quarter
    period K: it is ``pi/2`` over a mean of 1 and k' (see ``kernels.flow.replay.half_period``).
    """
    start = swing.flow_s * swing.flow_s
    end = s * s
    low = min(start, end)
    high = max(start, end)
    argument = swing.frequency * duration
    root = math.sqrt(swing.root_complement)
    above = argument * ((1.0 + root) * (1.0 + root))
    below = argument * math.sqrt(2.0 * (1.0 + swing.root_complement) * root)
    none = above < 2.0 * math.pi * (1.0 - 2.0 * CAUTION)
    half = both(
        below > math.pi * (1.0 + 2.0 * CAUTION), above < 4.0 * math.pi * (1.0 - 2.0 * CAUTION)
    )
    whole = below > 2.0 * math.pi * (1.0 + 2.0 * CAUTION)
    turned = both(swing.flow_p * p <= 0.0, abs(swing.flow_p) > 0.0)
    high = choose(either(whole, turned), swing.parameter, high)
    inward = both(swing.flow_s * swing.flow_c * swing.flow_p < 0.0, half)
    low = choose(either(either(whole, swing.flow_s * s < 0.0), inward), 0.0, low)
    return low, high, opposite(either(either(none, half), whole))


@kernel
def force_in_lanes(body: BodyLanes, piece: PieceData, m: Lanes, low: Lanes, high: Lanes) -> Lanes:
    """Least normal force (N) of a flight of parameter ``m`` over a range of ``S^2``."""
    return min(arc_force(body, piece, m, low), arc_force(body, piece, m, high))


@kernel
def demand_in_lanes(
    body: BodyLanes, piece: PieceData, m: Lanes, low: Lanes, high: Lanes, most: Lanes
) -> Lanes:
    """Greatest demand of friction so far and of a flight over a range of ``S^2``."""
    most = max(most, _demand(body, piece, m, low, most))
    most = max(most, _demand(body, piece, m, high, most))
    # Where the demand is stationary (see kernels.statistics.run_statistics).
    b = 1.0 + 2.0 / body.kappa
    a = 4.0 * m / body.kappa - 2.0 / body.kappa
    if any_lane(abs(a) > b):
        stationary = 0.5 * (1.0 + b / a)
        within = both(both(abs(a) > b, low <= stationary), stationary <= high)
        there = _demand(body, piece, m, choose(within, stationary, low), most)
        most = max(most, choose(within, there, 0.0))
    return most


@kernel
def _demand(body: BodyLanes, piece: PieceData, m: Lanes, s2: Lanes, most: Lanes) -> Lanes:
    """Demand of friction where a flight passes ``S^2``, or 0 if that is below ``most``."""
    normal = arc_force(body, piece, m, s2)
    square = max(s2 * (1.0 - s2), 0.0)
    share = 1.0 - 1.0 / body.kappa
    pull = 2.0 * body.weight * share
    held = most * normal
    less = both(normal > 0.0, pull * pull * square <= BELOW * (held * held))
    if not any_lane(opposite(less)):
        return 0.0 * normal
    force = body.weight * (2.0 * math.sqrt(square)) * share
    demand = choose(normal > 0.0, force / normal, math.inf)
    demand = choose(force == 0.0, choose(normal >= 0.0, 0.0, math.inf), demand)
    return choose(less, 0.0, demand)
