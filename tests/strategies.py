"""Random scenes for property tests: traces of one to seven pieces with one to six bodies.

All examples are drawn without a random seed (``derandomize``), so that a run of the tests repeats.
The long form draws many more of each (about an hour on one core):
``VIBRO_EXAMPLES=5000 python -m pytest tests/systems/trace/test_properties.py``, and the same with
``tests/systems/trace/test_drawn_properties.py``.
"""

from __future__ import annotations

import math
import os
from typing import Any

from hypothesis import settings
from hypothesis import strategies as st

from vibro_cli.assemble import build_system
from vibro_cli.mechanics.system import TraceSystem
from vibro_cli.scenario import ScenarioError, scenario_of
from vibro_cli.stress.drawing import draw

_WANTED = os.environ.get("VIBRO_EXAMPLES")
EXAMPLES = int(_WANTED or 60)
SETTINGS = settings(deadline=None, derandomize=True, max_examples=EXAMPLES)
# For tests in which every example is many runs.
FEWER = settings(SETTINGS, max_examples=EXAMPLES if _WANTED else 20)

KINDS = ("ball", "disk", "hoop", "particle", "hollow_ball")


@st.composite
def traces(draw: st.DrawFn, pieces: int = 7) -> dict[str, Any]:
    """A trace that begins and ends with a wall of a valley, so that bodies stay on it."""
    count = draw(st.integers(1, pieces))
    slope = draw(st.floats(-2.2, -1.2).map(_short))
    arcs: list[dict[str, Any]] = []
    start = slope
    for number in range(count):
        last = number == count - 1
        if last:
            arcs.append(_arc("valley", draw, draw(st.floats(1.2, 2.2).map(_short))))
        elif number == 0:
            arcs.append(_arc("valley", draw, draw(st.floats(-0.8, 0.8).map(_short))))
        elif draw(st.booleans()) and arcs[-1]["shape"] != "line" and abs(slope) < 0.8:
            arcs.append({"shape": "line", "length": draw(st.floats(0.2, 1.5).map(_short))})
        else:
            end = draw(st.floats(-0.9, 0.9).map(_short))
            if abs(end - slope) < 0.15:
                end = slope + (0.3 if slope < 0.0 else -0.3)
            arcs.append(_arc("valley" if end > slope else "hump", draw, end))
        slope = arcs[-1].get("end_slope", slope)
    return {"start_slope": start, "arcs": arcs}


def _short(value: float) -> float:
    """A number of few digits: shrunk examples stay readable."""
    return round(value, 4)


def _arc(shape: str, draw: st.DrawFn, end_slope: float) -> dict[str, Any]:
    radius = draw(st.floats(0.6, 2.0).map(_short))
    return {"shape": shape, "radius": radius, "end_slope": end_slope}


@st.composite
def scenarios(
    draw: st.DrawFn,
    pieces: int = 7,
    bodies: int = 6,
    law: str | None = None,
    k: float | None = None,
    collisions: int = 25,
) -> dict[str, Any]:
    """Draw a scenario as a document; not every one of them is mechanically possible."""
    trace = draw(traces(pieces))
    count = draw(st.integers(1, bodies))
    slots = sorted(draw(st.lists(st.integers(2, 37), min_size=count, max_size=count, unique=True)))
    balls = [_ball(draw, trace, slot / 40.0) for slot in slots]
    document: dict[str, Any] = {
        "gravity": 9.81,
        "trace": trace,
        "balls": balls,
        "stop": {"time": 6.0, "collisions": collisions},
    }
    if count > 1:
        document["collision"] = {
            "law": law or draw(st.sampled_from(["normal-impulse", "hedrih", "translational"])),
            "k": draw(coefficients()) if k is None else k,
            "inadmissible": "normal-impulse",
        }
    return document


# Of scenes of the stress suite's generator: closed traces, walls, touching starts, turning.
NUMBERS = st.integers(0, 10**6)


def drawn(number: int) -> dict[str, Any]:
    """Draw the scene of a number."""
    return draw(2, number)


def coefficients() -> st.SearchStrategy[float]:
    """Coefficients of restitution: ordinary ones, and those at the ends and hard by them."""
    ends = st.sampled_from([0.0, 1e-300, 0.05, 1.0 - 2.0**-53, 1.0])
    return st.one_of(st.floats(0.3, 1.0).map(_short), ends)


def _ball(draw: st.DrawFn, trace: dict[str, Any], share: float) -> dict[str, Any]:
    """Draw a body at a fraction of the number of pieces."""
    arcs = trace["arcs"]
    number = min(int(share * len(arcs)), len(arcs) - 1)
    inside = share * len(arcs) - number
    arc = arcs[number]
    ball: dict[str, Any] = {
        "body": draw(st.sampled_from(KINDS)),
        "radius": draw(st.sampled_from([0.04, 0.05, 0.05, 0.07])),
        "mass": draw(st.floats(0.2, 4.0).map(_short)),
        "arc": number + 1,
        "speed": draw(st.floats(-1.5, 1.5).map(_short)),
    }
    if arc["shape"] == "line":
        ball["position"] = inside * arc["length"]
        return ball
    before = [other["end_slope"] for other in arcs[:number] if "end_slope" in other]
    slopes = (before[-1] if before else trace["start_slope"], arc["end_slope"])
    sign = 1.0 if arc["shape"] == "valley" else -1.0
    ball["angle"] = sign * (slopes[0] + inside * (slopes[1] - slopes[0]))
    return ball


def possible(document: dict[str, Any]) -> TraceSystem | None:
    """Return the system of a document, None if the mechanics refuse it."""
    try:
        return build_system(scenario_of(document))
    except ScenarioError:
        return None


def mirrored(document: dict[str, Any]) -> dict[str, Any]:
    """Return the mirror image: right for left."""
    arcs = document["trace"]["arcs"]
    slopes = [document["trace"]["start_slope"]]
    for arc in arcs:
        slopes.append(arc.get("end_slope", slopes[-1]))
    turned = []
    for arc, start in zip(reversed(arcs), reversed(slopes[:-1]), strict=True):
        turned.append({**arc, "end_slope": -start} if "end_slope" in arc else dict(arc))
    balls = []
    for ball in reversed(document["balls"]):
        image = {**ball, "arc": len(arcs) + 1 - ball["arc"], "speed": -ball["speed"]}
        if "angle" in ball:
            image["angle"] = -ball["angle"]
        else:
            image["position"] = arcs[ball["arc"] - 1]["length"] - ball["position"]
        balls.append(image)
    return {
        **document,
        "trace": {"start_slope": -slopes[-1], "arcs": turned},
        "balls": balls,
    }


def close(value: float, other: float, tolerance: float) -> bool:
    """Whether two numbers agree, nan with nan."""
    return math.isclose(value, other, rel_tol=0.0, abs_tol=tolerance) or value != value != other
