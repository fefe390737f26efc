"""What kind of phase portrait a body has, and how it changes with a number of the scenario.

The kind is told by the singular points and by what their separatrices do.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

from vibro_cli.analysis.landscape import Landscape
from vibro_cli.analysis.singular import (
    CENTRE,
    DEGENERATE,
    SADDLE,
    SingularPoint,
    Trigger,
    singular_points,
    triggers,
)

_SAME = 1e-13
"""Energies closer than this share of the highest are told as equal."""
_LETTER = {CENTRE: "C", SADDLE: "S", DEGENERATE: "D"}


@dataclass(frozen=True)
class Portrait:
    """The structure of the phase portrait of one body on the whole trace."""

    landscape: Landscape
    points: tuple[SingularPoint, ...]
    """From left to right."""
    names: tuple[str, ...]
    """Names of the points: C1, S1, C2, …, each kind counted from the left."""
    triggers: tuple[Trigger, ...]

    @property
    def type(self) -> str:
        """The type in words: equal for portraits that can be deformed into one another."""
        kinds = ", ".join(point.kind for point in self.points) or "no singular point"
        orbits = ", ".join(trigger.orbit for trigger in self.triggers)
        return f"{kinds}; {orbits}" if orbits else kinds

    def name(self, point: SingularPoint) -> str:
        """Return the name of one of the points."""
        return self.names[self.points.index(point)]

    def height(self, energy: float) -> float:
        """Return E/(m g) (m): how high above its lowest place the body can come to rest.

        On a trace that turns, the effective potential as a height above its least value.
        """
        weight = self.landscape.body.mass * self.landscape.gravity
        return energy / weight if weight else 0.0


def portrait_of(landscape: Landscape) -> Portrait:
    """Return the structure of the phase portrait of a body, in closed form (D)."""
    points = singular_points(landscape)
    counts = dict.fromkeys(_LETTER, 0)
    names = []
    for point in points:
        counts[point.kind] += 1
        names.append(f"{_LETTER[point.kind]}{counts[point.kind]}")
    return Portrait(landscape, points, tuple(names), triggers(landscape))


def condition(portrait: Portrait, trigger: Trigger) -> str:
    """Return in words what makes the separatrix of a trigger what it is.

    The figure eight exists while the barrier on either side is at least as high as the saddle,
    (R − r)(1 − cos θ_end) ≥ (R + R₀)(1 − cos J) on three arcs (D).
    """
    left, right = (_barrier(portrait, m) for m in (trigger.margin_left, trigger.margin_right))
    saddle = portrait.name(trigger.saddle)
    return (
        f"barriers {_signed(left)} (left) and {_signed(right)} (right) of {saddle}; "
        "a figure eight needs both ≥ 0"
    )


def _barrier(portrait: Portrait, margin: float) -> float:
    """Return a barrier as a height (m); 0 where saddles are equal but for rounding."""
    highest = max(abs(point.energy) for point in portrait.points)
    return portrait.height(margin) if abs(margin) > _SAME * highest else 0.0


def _signed(height: float) -> str:
    return f"{height:+.4g} m".replace("-", "−")


def as_record(portrait: Portrait) -> dict[str, Any]:
    """Return the structure as plain values: the body, its singular points and its triggers."""
    body = portrait.landscape.body
    return {
        "body": body.kind,
        "radius": body.radius,
        "mass": body.mass,
        "kappa": body.kappa,
        "type": portrait.type,
        "points": [
            _point(portrait, name, point)
            for name, point in zip(portrait.names, portrait.points, strict=True)
        ],
        "triggers": [_trigger(portrait, trigger) for trigger in portrait.triggers],
    }


def _point(portrait: Portrait, name: str, point: SingularPoint) -> dict[str, Any]:
    piece = portrait.landscape.trace.pieces[point.piece]
    x, y = piece.body_center(point.position, portrait.landscape.body.radius)
    inner = piece.angle_start < point.position < piece.angle_end and not piece.is_line
    return {
        "name": name,
        "kind": point.kind,
        "arc": piece.index + 1,
        "angle": None if piece.is_line else point.position,
        "s": point.s,
        "extent": point.extent,
        "x": x,
        "y": y,
        "slope": point.slope,
        "energy": point.energy,
        "height": portrait.height(point.energy),
        # frequency about a centre, exponent of a saddle; at a junction it has two
        "natural_rate": rate_near(portrait.landscape, point) if inner else None,
    }


def rate_near(landscape: Landscape, point: SingularPoint) -> float:
    """Return the frequency about a centre of an arc, or the exponent of a saddle (1/s).

    w = √(g/κρ); on a trace that turns w √|V″| in units of the potential V of the arc.
    """
    piece = landscape.trace.pieces[point.piece]
    w = landscape.natural_rate(piece)
    if landscape.turning is None:
        return w
    offset = 0.0 if piece.sign > 0.0 else math.pi
    return w * math.sqrt(abs(landscape.pull(piece).stiffness(point.position + offset)))


def _trigger(portrait: Portrait, trigger: Trigger) -> dict[str, Any]:
    names = [portrait.name(p) for p in (trigger.left, trigger.saddle, trigger.right)]
    return {
        "points": "-".join(names),
        "orbit": trigger.orbit,
        "condition": condition(portrait, trigger),
        "energy": trigger.saddle.energy,
        "margin_left": trigger.margin_left,
        "margin_right": trigger.margin_right,
        "turning_left": trigger.turning_left,
        "turning_right": trigger.turning_right,
    }


IMPOSSIBLE = "impossible"
"""Type of a member that is no valid scenario."""
_EVENT = 1e-9
"""Changes closer than this fraction of the parameter are one."""


@dataclass(frozen=True)
class Change:
    """Where the type of the portrait changes."""

    low: float
    """Largest value found with the type before."""
    high: float
    """Least value found with the type after: the next double, or, where the types between are those
    of the change itself (equal energies, a degenerate point), the end of these."""
    before: str
    after: str


def changes(type_of: Callable[[float], str], values: Sequence[float]) -> tuple[Change, ...]:
    """Return where the type changes between neighbouring values, each place found by bisection.

    `type_of` gives the type at a parameter value, `IMPOSSIBLE` where there is none; `values` rise.
    Between two values with different types one change is found, even if there are several.
    """
    types = [type_of(value) for value in values]
    found: list[Change] = []
    for (low, before), (high, after) in pairwise(zip(values, types, strict=True)):
        if before != after:
            found += _bisected(type_of, (low, before), (high, after))
    return _events(found)


def _events(found: Sequence[Change]) -> tuple[Change, ...]:
    """Return changes with those as one between which there is no room for a type of its own.

    A type that takes equal energies, or vanishing ones, is found where they are so to rounding.
    """
    joined: list[Change] = []
    for change in found:
        last = joined[-1] if joined else None
        near = last is not None and change.high - last.low <= _EVENT * max(
            abs(last.low), abs(change.high)
        )
        if last is not None and near and last.after == change.before != last.before:
            joined[-1] = Change(last.low, change.high, last.before, change.after)
        else:
            joined.append(change)
    return tuple(joined)


def _bisected(
    type_of: Callable[[float], str], left: tuple[float, str], right: tuple[float, str]
) -> list[Change]:
    """Return the change next to the left value, and what may still come to the right of it."""
    (low, before), (high, after) = left, right
    while low < (middle := 0.5 * (low + high)) < high:
        kind = type_of(middle)
        if kind == before:
            low = middle
        else:
            high, after = middle, kind
    change = Change(low, high, before, after)
    if after == right[1]:
        return [change]
    return [change, *_bisected(type_of, (high, after), right)]
