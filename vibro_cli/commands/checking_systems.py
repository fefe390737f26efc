"""What `vibro check` tells of scenarios of systems other than the trace."""

from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from vibro_cli.build import AnySystem
    from vibro_cli.mechanics.body import Body
    from vibro_cli.scenario.systems import AnyScenario


def understood_of(scenario: "AnyScenario", system: "AnySystem") -> dict[str, Any]:
    """What a scenario means, as plain values: given values, defaults and what follows from them."""
    from vibro_cli.build import warnings_of

    return {
        "name": scenario.name,
        "valid": True,
        "scenario": scenario.resolved(),
        "bodies": [described(ball, body) for ball, body in enumerate(system.bodies, 1)],
        "law": system.law,
        "inadmissible": system.inadmissible,
        "warnings": list(warnings_of(scenario, system)),
    }


def described(ball: int, body: "Body") -> dict[str, Any]:
    """What a body is, whatever it rolls on."""
    return {
        "ball": ball,
        "body": body.kind,
        "radius": body.radius,
        "mass": body.mass,
        "kappa": body.kappa,
        "rolling_inertia": body.rolling_inertia,
    }


def body_line(body: dict[str, Any]) -> str:
    """What a body is, as text."""
    return (
        f"  ball {body['ball']}  {body['body']}, r = {body['radius']:g} m, "
        f"m = {body['mass']:.6g} kg, κ = {body['kappa']:.6g}, "
        f"J_P = {body['rolling_inertia']:.6g} kg m²"
    )


def lines_of(found: dict[str, Any]) -> Iterator[str]:
    """What was understood, as text."""
    scenario = found["scenario"]
    yield f"{found['name']}: valid"
    yield f"  system {scenario['system']}"
    if "wall" in scenario:
        yield f"  wall {_settings(scenario['wall'])}"
    for body, given in zip(found["bodies"], scenario["balls"], strict=True):
        start = {key: value for key, value in given.items() if key not in _OF_THE_BODY}
        yield f"{body_line(body)}; {_settings(start)}"
    yield f"  law {found['law']}; inadmissible impacts: {found['inadmissible']}"
    if "k" in scenario["collision"]:
        yield f"  k = {scenario['collision']['k']}"
    yield f"  stop {_settings(scenario['stop'])}"
    for warning in found["warnings"]:
        yield f"  warning: {warning}"


_OF_THE_BODY = ("body", "radius", "mass", "density", "inertia_ratio", "thickness")


def _settings(settings: dict[str, Any]) -> str:
    """The settings of a table, on one line; those of a table within it in parentheses."""
    return ", ".join(
        f"{key} ({_settings(value)})" if isinstance(value, dict) else f"{key} = {value}"
        for key, value in settings.items()
    )
