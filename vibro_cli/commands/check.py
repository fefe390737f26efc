"""`vibro check`: validate scenarios and show what was understood."""

import math
from collections.abc import Iterable, Iterator, Sequence
from functools import partial
from typing import TYPE_CHECKING, Annotated, Any, cast

import typer

from vibro_cli.commands.boundary import DONE, MISUSED, CommandError, say
from vibro_cli.commands.checking_systems import body_line, described, lines_of, understood_of
from vibro_cli.commands.options import FailFast, Overrides, Quiet, Scenarios, Task
from vibro_cli.commands.streams import json_text

if TYPE_CHECKING:
    from vibro_cli.build import AnySystem
    from vibro_cli.mechanics.system import System
    from vibro_cli.mechanics.trace import Piece
    from vibro_cli.scenario import Scenario
    from vibro_cli.scenario.systems import AnyScenario


def check(
    scenarios: Scenarios,
    overrides: Overrides = [],  # noqa: B006 (typer copies it)
    as_json: Annotated[bool, typer.Option("--json", help="Print it as JSON, a line each.")] = False,
    fail_fast: FailFast = False,
    quiet: Quiet = False,
) -> Task:
    """Validate scenarios and show what was understood."""
    return partial(_check_all, scenarios, overrides, as_json, fail_fast, quiet)


def _check_all(
    sources: Sequence[str],
    overrides: Sequence[str],
    as_json: bool,
    fail_fast: bool,
    quiet: bool,
) -> int:
    """Show what was understood of each scenario, or what is wrong with it, in their order."""
    from vibro_cli.commands.loading import check_standard_input, load_any

    check_standard_input(sources)
    code = DONE
    for source in sources:
        try:
            found, lines = _understood(*load_any(source, overrides))
        except CommandError as error:
            if as_json:
                refusal = {"source": source, "valid": False, "problems": error.problems}
                print(json_text(refusal))
            if fail_fast or len(sources) == 1:
                raise
            say(str(error), "error", problems=error.problems)
            code = MISUSED
            continue
        if as_json:
            print(json_text(found))
        elif not quiet:
            print("\n".join(lines))
    return code


def _understood(
    scenario: "AnyScenario", system: "AnySystem"
) -> tuple[dict[str, Any], Iterable[str]]:
    """What a scenario means, as plain values and as lines of text."""
    if scenario.system != "trace":
        found = understood_of(scenario, system)
        return found, lines_of(found)
    found = understood(scenario, cast("System", system))
    return found, _lines(found)


def understood(scenario: "Scenario", system: "System") -> dict[str, Any]:
    """What a scenario means, as plain values: given values, defaults and what follows from them."""
    from vibro_cli.mechanics.caveats import mechanics_warnings

    return {
        "name": scenario.name,
        "valid": True,
        "scenario": scenario.resolved(),
        "trace": {
            "length": system.trace.length,
            "closed": system.trace.closed,
            "pieces": [_piece(piece) for piece in system.trace.pieces],
        },
        "bodies": list(_bodies(system)),
        "pairs": list(_pairs(system)),
        "law": system.law,
        "inadmissible": system.inadmissible,
        "surface": system.surface,
        "warnings": list(mechanics_warnings(system, scenario.stop.time)),
    }


def _piece(piece: "Piece") -> dict[str, Any]:
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


def _bodies(system: "System") -> Iterator[dict[str, Any]]:
    for ball, (body, state) in enumerate(zip(system.bodies, system.initial, strict=True), 1):
        on_line = system.trace.pieces[state.piece].shape == "line"
        yield {
            **described(ball, body),
            "arc": state.piece + 1,
            "position" if on_line else "angle": state.position,
            "speed": state.speed,
        }


def _pairs(system: "System") -> Iterator[dict[str, Any]]:
    """The neighbours with their coefficients of restitution; on a closed trace the seam's last."""
    number = len(system.bodies)
    for left, k in enumerate(system.restitution):
        right = (left + 1) % number
        yield {"ball_a": left + 1, "ball_b": right + 1, "k": k}


def _lines(found: dict[str, Any]) -> Iterator[str]:
    """What was understood, as text."""
    scenario, trace = found["scenario"], found["trace"]
    kind = "closed" if trace["closed"] else "open"
    yield f"{found['name']}: valid"
    yield f"  gravity {scenario['gravity']:g} m/s²; {kind} {found['surface']} trace of " + (
        f"length {trace['length']:.6g} m"
    )
    yield from map(_piece_line, trace["pieces"])
    yield from map(_moving_line, found["bodies"])
    for pair in found["pairs"]:
        yield f"  pair {pair['ball_a']}-{pair['ball_b']}  k = {pair['k']:g}"
    yield f"  law {found['law']}; inadmissible impacts: {found['inadmissible']}"
    yield f"  stop {_settings(scenario['stop'])}"
    if not trace["closed"]:
        yield f"  ends {_settings(scenario['ends'])}"
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


def _settings(settings: dict[str, Any]) -> str:
    """The settings of a section that are set, on one line."""
    return ", ".join(f"{key} = {value}" for key, value in settings.items() if value is not None)
