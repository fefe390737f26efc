"""Describe a scenario of a trace as plain values and as lines of text (`vibro check`)."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any

from vibro_cli.analysis.paper_formulas import starting_swing, stays
from vibro_cli.mechanics.reachability import contact_angle
from vibro_cli.mechanics.system import TraceSystem
from vibro_cli.mechanics.trace import Piece
from vibro_cli.scenario.fields import settings
from vibro_cli.scenario.models import Scenario
from vibro_cli.systems.describe import body_line, described


def quantities_of(system: TraceSystem) -> dict[str, Any]:
    """Return the trace, the bodies and their contacts, with quantities derived from them."""
    return {
        "trace": {
            "length": system.trace.length,
            "closed": system.trace.closed,
            "pieces": [_piece(piece) for piece in system.trace.pieces],
        },
        "surface": system.surface,
        "bodies": list(_bodies(system)),
        "pairs": list(_pairs(system)),
    }


def _piece(piece: Piece) -> dict[str, Any]:
    return {
        "arc": piece.index + 1,
        "shape": piece.shape,
        "radius": piece.radius if math.isfinite(piece.radius) else None,
        "start_slope": piece.start_slope,
        "end_slope": piece.end_slope,
        "length": piece.length,
        "start": list(piece.start),
        "end": list(piece.end),
    }


def _bodies(system: TraceSystem) -> Iterator[dict[str, Any]]:
    for ball, (body, state) in enumerate(zip(system.bodies, system.initial, strict=True), 1):
        on_line = system.trace.pieces[state.piece].shape == "line"
        yield {
            **described(ball, body),
            "arc": state.piece + 1,
            "position" if on_line else "angle": state.position,
            "speed": state.speed,
            "swing": _swing(system, ball),
        }


def _swing(system: TraceSystem, ball: int) -> dict[str, Any] | None:
    """Return the papers' constants of a body's first swing; None outside a valley at rest.

    The period is None if the swing leaves its arc (`stays` is false) or is on the separatrix.
    """
    swing = starting_swing(system, ball)
    if swing is None:
        return None
    piece = system.trace.pieces[system.initial[ball - 1].piece]
    circle = system.trace.closed and len(system.trace.pieces) == 1
    on_arc = stays(swing, piece, circle)
    period = swing.period if on_arc else math.inf
    return {
        "omega_squared": swing.square,
        "modulus": swing.modulus if math.isfinite(swing.modulus) else None,
        "small_period": swing.small_period,
        "period": period if math.isfinite(period) else None,
        "stays": on_arc,
    }


def _pairs(system: TraceSystem) -> Iterator[dict[str, Any]]:
    """Yield the pairs with their coefficients of restitution, that across a seam last."""
    number = len(system.bodies)
    for left, k in enumerate(system.restitution):
        right = (left + 1) % number
        yield {
            "ball_a": left + 1,
            "ball_b": right + 1,
            "k": k,
            "contacts": list(_contacts(system, left, right)),
        }


def _contacts(system: TraceSystem, left: int, right: int) -> Iterator[dict[str, float]]:
    """Yield the separation of two touching bodies on each piece, and the papers' ratios on arcs."""
    one, other = (system.bodies[number].radius for number in (left, right))
    for piece in system.trace.pieces:
        arc, apart = piece.index + 1, contact_angle(piece, one, other)
        if piece.is_line:
            yield {"arc": arc, "distance": apart}
        else:
            ratios = {"lambda_1": piece.radius / one, "lambda_2": other / one}
            yield {"arc": arc, "beta": apart, **ratios}


def understood_lines(found: dict[str, Any]) -> Iterator[str]:
    """Yield the result of `understood` as lines of text."""
    scenario, trace = found["scenario"], found["trace"]
    kind = "closed" if trace["closed"] else "open"
    yield f"{found['name']}: valid"
    yield f"  gravity {scenario['gravity']:g} m/s²; {kind} {found['surface']} trace of " + (
        f"length {trace['length']:.6g} m"
    )
    yield from map(_piece_line, trace["pieces"])
    if "turning" in scenario["trace"]:
        turning = settings(Scenario, scenario["trace"]["turning"], ("trace", "turning"))
        yield f"  turns about a vertical axis: {turning}"
    for body in found["bodies"]:
        yield _moving_line(body)
        if body["swing"] is not None:
            yield _swing_line(body["swing"])
    for pair in found["pairs"]:
        yield f"  pair {pair['ball_a']}-{pair['ball_b']}  k = {pair['k']:g}"
        yield from map(_contact_line, pair["contacts"])
    if found["pairs"]:
        yield f"  law {found['law']}; inadmissible impacts: {found['inadmissible']}"
    yield f"  stop {settings(Scenario, scenario['stop'], ('stop',))}"
    if not trace["closed"]:
        yield f"  ends {settings(Scenario, scenario['ends'], ('ends',))}"
    for warning in found["warnings"]:
        yield f"  warning: {warning}"


def _piece_line(piece: dict[str, Any]) -> str:
    slopes = [f"{math.degrees(piece[key]):.6g}°" for key in ("start_slope", "end_slope")]
    radius = "" if piece["radius"] is None else f"R = {piece['radius']:g} m, "
    end = "({:.6g}, {:.6g}) m".format(*piece["end"])
    return (
        f"  arc {piece['arc']}  {piece['shape']:6}  {radius}slope {slopes[0]} to {slopes[1]}, "
        f"length {piece['length']:.6g} m, ends at {end}"
    )


def _moving_line(body: dict[str, Any]) -> str:
    if "angle" in body:
        place = f"angle {math.degrees(body['angle']):.6g}°"
    else:
        place = f"position {body['position']:.6g} m"
    return f"{body_line(body)}; arc {body['arc']}, {place}, speed {body['speed']:.6g} m/s"


def _swing_line(swing: dict[str, Any]) -> str:
    """Return the constants of a swing as text: B (50)-(51), small and actual period."""
    modulus, period = swing["modulus"], swing["period"]
    own = "none, as it leaves its arc"
    if swing["stays"]:
        own = "infinite, on the separatrix" if period is None else f"{period:.9g} s"
    shown = "∞" if modulus is None else f"{modulus:.9g}"
    return (
        f"          ω² = 2g/κρ = {swing['omega_squared']:.9g} 1/s², elliptic modulus {shown}; "
        f"period of small oscillations {swing['small_period']:.9g} s, of this motion {own}"
    )


def _contact_line(contact: dict[str, float]) -> str:
    """Return the separation of two touching bodies on a piece as text: A (6), B (48)-(49)."""
    if "beta" not in contact:
        return f"          arc {contact['arc']}  in contact {contact['distance']:.9g} m apart"
    return (
        f"          arc {contact['arc']}  β = {contact['beta']:.9g} rad, "
        f"λ₁ = R/r₁ = {contact['lambda_1']:.6g}, λ₂ = r₂/r₁ = {contact['lambda_2']:.6g}"
    )
