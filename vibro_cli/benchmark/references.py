"""Times of the first impacts of every scene in high precision, kept beside this module.

They come from ``stress.oracles.reference_solver``, a Taylor integration in 50 digits fed with the
very doubles that the methods get.
"""

from __future__ import annotations

import json
from importlib.resources import files
from typing import Any

from vibro_cli.benchmark.scenes import Scene

DIGITS = 40


class ReferenceOutdated(Exception):
    """A reference is not there, or is of another scene; the message says how to renew it."""


def file_name(scene: Scene) -> str:
    """Name of a scene's file of references."""
    return f"{scene.name}.json"


def read(scene: Scene) -> list[str]:
    """Return the times (s) of the first impacts of a scene as decimals of ``DIGITS`` digits.

    Raises
    ------
    ReferenceOutdated
        If there is no reference of just this scene.
    """
    path = files("vibro_cli.benchmark") / "references" / file_name(scene)
    try:
        found = json.loads(path.read_text(encoding="utf-8"))
    except FileNotFoundError:
        found = {}
    if found.get("scenario") != json.loads(json.dumps(scene.document)):
        raise ReferenceOutdated(
            f"{path}: found no reference of the scene {scene.name!r} as it is; expected what "
            "`vibro bench --references DIR` writes"
        )
    times: list[str] = found["times"]
    return times


def compute(scene: Scene) -> dict[str, Any]:
    """Return the content of a scene's file, computed anew; needs mpmath."""
    from vibro_cli.simulation.run import simulate_system
    from vibro_cli.stress.oracles.reference_solver import Twin, happenings_of
    from vibro_cli.stress.oracles.scene import scene_of_system
    from vibro_cli.stress.oracles.taylor import mp

    run = simulate_system(scene.system, None, scene.compared, "python")
    impacts = Twin(scene_of_system(scene.system)).follow(happenings_of(run))
    return {
        "scenario": scene.document,
        "unit": "s",
        "digits": DIGITS,
        "times": [mp.nstr(impact.t, DIGITS) for impact in impacts],
    }


def errors(times: list[float], exact: list[str]) -> list[float]:
    """Relative errors of times, formed in exact fractions and rounded once."""
    from fractions import Fraction

    pairs = zip(times, exact, strict=False)
    return [float(abs(Fraction(time) - Fraction(true)) / Fraction(true)) for time, true in pairs]


def difference(scene: Scene, content: dict[str, Any]) -> str:
    """Say in words how a content computed anew differs from the reference in use."""
    from fractions import Fraction

    try:
        used = read(scene)
    except ReferenceOutdated:
        return "no reference in use"
    pairs = zip(used, content["times"], strict=True)
    worst = max(float(abs(Fraction(a) - Fraction(b)) / Fraction(b)) for a, b in pairs)
    return f"{len(used)} times, greatest relative difference {worst:.1e}"
