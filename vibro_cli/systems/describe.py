"""Describe a scenario as plain values and as lines of text (`vibro check`)."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from typing import Any

from vibro_cli.mechanics.system import Body

Settings = Callable[[Mapping[str, Any], tuple[str | int, ...]], str]
BodyLines = Callable[[dict[str, Any]], Iterator[str]]


def understood(scenario: Any, system: Any, warnings: tuple[str, ...]) -> dict[str, Any]:
    """Return the given values of a scenario, its defaults and quantities derived from them."""
    return {
        "name": scenario.name,
        "valid": True,
        "scenario": scenario.resolved(),
        "bodies": [described(ball, body) for ball, body in enumerate(system.bodies, 1)],
        "law": system.law,
        "inadmissible": system.inadmissible,
        "warnings": list(warnings),
    }


def described(ball: int, body: Body) -> dict[str, Any]:
    """Return the properties of a body that any system has."""
    return {
        "ball": ball,
        "body": body.kind,
        "radius": body.radius,
        "mass": body.mass,
        "kappa": body.kappa,
        "rolling_inertia": body.rolling_inertia,
    }


def body_line(body: dict[str, Any]) -> str:
    """Return the properties of a body as a line of text."""
    return (
        f"  ball {body['ball']}  {body['body']}, r = {body['radius']:g} m, "
        f"m = {body['mass']:.6g} kg, κ = {body['kappa']:.6g}, "
        f"J_P = {body['rolling_inertia']:.6g} kg m²"
    )


def lines_of(found: dict[str, Any], settings: Settings, body_lines: BodyLines) -> Iterator[str]:
    """Yield the result of `understood` as lines of text.

    `settings` formats the values of a table at a path; `body_lines` adds lines on a body.
    """
    scenario = found["scenario"]
    yield f"{found['name']}: valid"
    yield f"  system {scenario['system']}"
    for table, values in own_settings(scenario).items():
        path = (table,) if table else ()
        yield "  " + f"{table} {settings(values, path)}".lstrip()
    for body, given in zip(found["bodies"], scenario["balls"], strict=True):
        start = {key: value for key, value in given.items() if key not in _OF_THE_BODY}
        yield f"{body_line(body)}; {settings(start, ('balls', 0))}"
        yield from body_lines(body)
    if "law" in scenario["collision"]:
        yield f"  law {found['law']}; inadmissible impacts: {found['inadmissible']}"
    if "k" in scenario["collision"]:
        k = scenario["collision"]["k"]
        yield f"  k = {', '.join(f'{one:g}' for one in (k if isinstance(k, list) else [k]))}"
    yield f"  stop {settings(scenario['stop'], ('stop',))}"
    for warning in found["warnings"]:
        yield f"  warning: {warning}"


def own_settings(scenario: Mapping[str, Any]) -> dict[str, Mapping[str, Any]]:
    """Return the tables that only scenarios of this system have, with their values.

    Keys outside tables, if any, come first, under an empty name.
    """
    own = {key: value for key, value in scenario.items() if key not in _OF_EVERY_SYSTEM}
    tables = {key: value for key, value in own.items() if isinstance(value, Mapping)}
    outside = {key: value for key, value in own.items() if key not in tables}
    return ({"": outside} if outside else {}) | tables


# Keys that have lines of their own, or that do not affect the motion.
_OF_EVERY_SYSTEM = ("name", "system", "balls", "collision", "stop", "output", "analysis")
_OF_THE_BODY = ("body", "radius", "mass", "density", "inertia_ratio", "thickness")
