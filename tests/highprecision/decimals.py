"""A scene in high precision from the decimals of a scenario, which stand for decimal numbers."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from vibro_cli.stress.oracles.scene import KAPPA, Body, Real, Scene, chain, mp


def scene_of_decimals(scenario: Mapping[str, Any]) -> Scene:
    """The scene of a reference file, whose decimals stand for decimal numbers."""
    trace = scenario["trace"]
    shapes = [
        (arc["shape"], _decimal(arc.get("radius", arc.get("length"))),
         _decimal(arc["end_slope"]) if "end_slope" in arc else None)
        for arc in trace["arcs"]
    ]  # fmt: skip
    pieces = chain(_decimal(trace["start_slope"]), shapes)
    bodies = tuple(_body(ball) for ball in scenario["balls"])
    starts = []
    for ball, body in zip(scenario["balls"], bodies, strict=True):
        piece = pieces[ball["arc"] - 1]
        if piece.sign:
            path = piece.size - piece.sign * body.radius
            speed = _decimal(ball["rate"]) * path
            starts.append((ball["arc"] - 1, _decimal(ball["angle"]), speed))
        else:
            starts.append((ball["arc"] - 1, _decimal(ball["position"]), _decimal(ball["speed"])))
    pairs = max(len(bodies) - (0 if trace["closed"] and len(bodies) > 2 else 1), 1)
    return Scene(
        gravity=_decimal(scenario["gravity"]),
        pieces=pieces,
        closed=trace["closed"],
        bodies=bodies,
        starts=tuple(starts),
        restitution=(_decimal(scenario["collision"]["k"]),) * pairs,
        walls=(None, None),
    )


def _decimal(value: float | str) -> Real:
    """A number as it is written; degrees become radians."""
    text = value if isinstance(value, str) else repr(value)
    if text.endswith(" deg"):
        return mp.mpf(text.removesuffix(" deg")) * mp.pi / 180
    return mp.mpf(text)


def _body(ball: Mapping[str, Any]) -> Body:
    radius = _decimal(ball["radius"])
    if "mass" in ball:
        mass = _decimal(ball["mass"])
    else:
        mass = mp.mpf(4) / 3 * mp.pi * radius**3 * _decimal(ball["density"])
    return Body(radius, mass, KAPPA[ball["body"]])
