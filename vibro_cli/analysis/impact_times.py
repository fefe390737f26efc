"""Derivatives of the times of impacts with respect to numbers of a scenario, for a trace at rest.

The system is evaluated with numbers that carry their derivatives (``numerics.elementwise``). The
kernel of ``kernels.tangent.impact_times`` follows them from event to event; no finite differences
are used.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vibro_cli.analysis.event_words import impact_word
from vibro_cli.assemble import body_of, speed_of, system_of, trace_of
from vibro_cli.compile.kernel import NO_OVERRIDES
from vibro_cli.errors import VibroError
from vibro_cli.kernels.impact.laws import LAW_NAMES, weight_and_response
from vibro_cli.kernels.numerics.double_double import time_between
from vibro_cli.kernels.tangent.frame import SERIES_ROWS, TERMS
from vibro_cli.kernels.tangent.impact_times import (
    Arrival,
    Changes,
    MotionChange,
    TrackChange,
    differentiate_impacts,
)
from vibro_cli.kernels.world import (
    CAUSE_NAMES,
    COLLISION,
    CONTACT_CLOSED,
    CONTACT_OPENED,
    CROSSING,
    END_NAMES,
    SEGMENT,
    START,
    WALL,
    Flight,
)
from vibro_cli.mechanics.initial_conditions import wall_position
from vibro_cli.mechanics.system import Body, InitialState, TraceSystem
from vibro_cli.mechanics.trace import Piece, sine_cosine
from vibro_cli.numerics.elementwise import Dual, Floats, change_of, value_of
from vibro_cli.scenario.models import Scenario
from vibro_cli.scenario.problems import KeyPath, ScenarioError, path_text, suggestion
from vibro_cli.systems.driver import body_record, called, with_logs, zeros
from vibro_cli.systems.request import Limits
from vibro_cli.systems.run import begun
from vibro_cli.systems.trace import SYSTEM
from vibro_cli.systems.trace.system_template import changed
from vibro_cli.systems.trace.world import make_world

_OF_CONTACTS = (CONTACT_CLOSED, CONTACT_OPENED)
_FAULTS = (
    "",
    "bodies in lasting contact ({cause}) at {t:.9g} s",
    "several impacts at one instant or lasting contact at {t:.9g} s",
    "bodies that only touch at {t:.9g} s",
    "body {body} only touches a wall at {t:.9g} s",
)
_ONE_SIDED = (
    "{name}: derivatives differ on either side of the junction at which body {body} is at {t:.9g} s"
)


class NoDerivative(VibroError, ValueError):
    """Times of impacts have no derivative, or none is known; the message says why."""


@dataclass(frozen=True)
class ImpactTimes:
    """The requested impacts of a motion."""

    t: Floats
    """[impact] times (s)."""
    pairs: NDArray[np.int64]
    """[impact, 2] numbers of the bodies, from 1"""
    word: tuple[str, ...]
    """Events up to the last impact, see `event_words`."""
    end_cause: str
    derivative: Floats
    """[impact, number] of their times (s) with respect to the numbers, in SI units."""


def number_at(scenario: Scenario, path: KeyPath, other: str = "") -> float:
    """Return the number that a scenario has at a path.

    `other` is a name that the caller accepts besides the paths of the scenario. Raises
    `NoDerivative` if there is none (the message names the nearest key), or if there are unequal
    ones.
    """
    found: Any = scenario
    try:
        for part in path:
            found = found[part] if isinstance(part, int) else getattr(found, part)
    except (AttributeError, IndexError, TypeError):
        found = None
        try:
            scenario.replace({path_text(path): 1.0})
        except ScenarioError as error:
            problem = error.problems[0]
            message = f"{path_text(path)}: found {problem.found}, expected {problem.expected}"
            if other and len(path) == 1:
                message += f", or {other}{suggestion(path_text(path), [other])}"
            raise NoDerivative(message) from error
    if isinstance(found, tuple) and found and isinstance(found[0], float):
        if len(set(found)) > 1:
            name = path_text(path)
            raise NoDerivative(
                f"{name}: found {len(found)} unequal numbers, expected one, such as {name}[1]"
            )
        found = found[0]
    if isinstance(found, bool) or not isinstance(found, float):
        raise NoDerivative(
            f"{path_text(path)}: found no number, expected one given in the scenario"
        )
    return found


def differentiated(scenario: Scenario, paths: Sequence[KeyPath]) -> TraceSystem:
    """Return the system of a scenario with derivatives with respect to the numbers at `paths`."""
    unit = np.eye(len(paths))
    values = {
        path: Dual(number_at(scenario, path), unit[n]) for n, path in enumerate(paths)
    }  # fmt: skip
    known = changed(scenario, values)
    trace = trace_of(known)
    bodies = tuple(map(body_of, known.balls))
    initial = []
    for number, (ball, body) in enumerate(zip(known.balls, bodies, strict=True), 1):
        if ball.touching is not None:
            raise NoDerivative(f"balls[{number}].touching: found a body that starts in contact")
        piece = trace.pieces[ball.arc - 1]
        place: Any = ball.position if piece.is_line else ball.angle
        initial.append(InitialState(piece.index, place, speed_of(ball, body, piece)))
    return system_of(known, trace, bodies, tuple(initial), None)


def impact_times(
    scenario: Scenario,
    system: TraceSystem,
    paths: Sequence[KeyPath],
    count: int,
    stop_time: float | None,
) -> ImpactTimes:
    """Return the first impacts of a motion, and the derivatives of their times.

    The times are differentiated with respect to the numbers at the paths. `count` is the number of
    impacts, `stop_time` the time (s) at which the motion stops in any case, if there is one. Raises
    `NoDerivative` for lasting contact, simultaneous impacts of one body with others or a wall,
    grazing contacts, impacts under `normal-impulse` at a jump of curvature, and a rotating trace.
    """
    if system.turning is not None:
        raise NoDerivative("found a trace that turns, expected one at rest")
    varied = _as_begun(differentiated(scenario, paths), system)
    stretch, _ = begun(SYSTEM, system, Limits(stop_time, count)).whole()
    log, impacts = stretch.logs["log"], stretch.logs["impacts"]
    own = make_world(system)
    world = with_logs(SYSTEM.loop, own, stretch.engine, stretch.logs, stretch.clock)
    events = _events_of(log, impacts)
    made = impacts[: np.count_nonzero(events[:, 2] >= 0)]
    changes = _changes_of(varied, log, (len(made), len(paths)))
    called(differentiate_impacts, NO_OVERRIDES, world, events, changes, len(paths))
    for number in np.flatnonzero(changes.one_sided)[:1]:
        row = log[changes.one_sided[0, number] - 1]
        name, body = path_text(paths[number]), row["body"] + 1
        raise NoDerivative(_ONE_SIDED.format(name=name, body=body, t=row["t"]))
    return ImpactTimes(
        t=made["t"].copy(),  # a view would keep all logs in memory
        pairs=np.stack([made["a"], made["b"]], axis=1) + 1,
        word=_word_of(log, events),
        end_cause=END_NAMES[stretch.cause],
        derivative=changes.times,
    )


def _as_begun(varied: TraceSystem, system: TraceSystem) -> TraceSystem:
    """Return a system with derivatives whose bodies are on the pieces of their first flights.

    From a junction a body may begin on the piece beside the one that the scenario names.
    """
    pieces, initial = varied.trace.pieces, []
    for start, first, body in zip(varied.initial, system.initial, varied.bodies, strict=True):
        if start.piece != first.piece:
            one, other = pieces[start.piece], pieces[first.piece]
            place = value_of(start.position)
            right = abs(place - value_of(one.angle_end)) < abs(place - value_of(one.angle_start))
            gone = start.position - (one.angle_end if right else one.angle_start)
            ratio = one.path_scale(body.radius) / other.path_scale(body.radius)
            entry = other.angle_start if right else other.angle_end
            start = replace(start, piece=first.piece, position=entry + gone * ratio)
        initial.append(start)
    return replace(varied, initial=tuple(initial))


def _events_of(log: Any, impacts: Any) -> NDArray[np.int64]:
    """Return the events of a whole run, as ``differentiate_impacts`` takes them.

    Raises `NoDerivative` at the first one that has no derivative.
    """
    cause, body, t = log["cause"], log["body"], log["t"]
    # An impact of two free bodies adds a row for each of them, in either order.
    colliding = np.flatnonzero(cause == COLLISION)
    made = impacts[: len(colliding) // 2]
    struck = np.stack([made["a"], made["b"]], axis=1)
    pairs = colliding[: struck.size].reshape(struck.shape)
    first = pairs[:, 0]
    pairs = np.where(body[pairs] == struck, pairs, pairs[:, ::-1])
    fits = (body[pairs] == struck) & (made["contact"] == 0)[:, None]
    for name in ("t", "t_low"):
        fits &= log[name][pairs] == made[name][:, None]
    ended = _has_flown(log)
    fits &= ended[pairs]
    closing = made["normal_a"] * made["speed_a_pre"] - made["normal_b"] * made["speed_b_pre"]
    alone, touches = (np.zeros(len(log), dtype=bool) for _ in range(2))
    alone[pairs] = np.all(fits, axis=1, keepdims=True)
    touches[pairs] = ~(closing > 0.0)[:, None]
    ends = np.isin(cause, (CROSSING, WALL))
    conditions = [
        (cause != START) & ((log["grouped"] != 0) | np.isin(cause, _OF_CONTACTS)),
        ((cause == COLLISION) & ~alone) | ((cause == WALL) & ~ended) | (cause == SEGMENT),
        touches,
        (cause == WALL) & (log["before_p"] == 0.0),
    ]
    faults = np.select(conditions, range(1, len(_FAULTS)))
    if np.any(faults):
        row = np.flatnonzero(faults)[0]
        words = CAUSE_NAMES[cause[row]].replace("_", " ")
        raise NoDerivative(_FAULTS[faults[row]].format(cause=words, body=body[row] + 1, t=t[row]))
    left = np.flatnonzero(ends)
    events = np.full((len(made) + len(left), 3), -1)
    events[: len(made), :2], events[: len(made), 2] = pairs, np.arange(len(made))
    events[len(made) :, 0] = left
    return events[np.argsort(np.concatenate([first, left]))]


def _has_flown(log: Any) -> NDArray[np.bool_]:
    """Return whether time has passed since the impact of a body before each row of the log.

    Also true for the first impact after the start. Crossings of junctions do not count.
    """
    order = np.argsort(log["body"], kind="stable")  # flights of one body follow one another
    cause, t, low = (log[name][order] for name in ("cause", "t", "t_low"))
    last = np.maximum.accumulate(np.where(cause == CROSSING, 0, np.arange(len(order))))
    before = np.roll(last, 1)
    found = np.empty(len(order), dtype=np.bool_)
    found[order] = (time_between(t, low, t[before], low[before]) > 0.0) | (cause[before] == START)
    return found


def _word_of(log: Any, events: NDArray[np.int64]) -> tuple[str, ...]:
    """Return the events in words, see `ImpactTimes`."""
    first, other, impact = events.T
    bodies = int(np.max(log["body"])) + 1
    numbers = range(1, bodies + 1)
    table = np.array(
        [
            [*(impact_word(one, two) for two in numbers), *(f"{one}{tail}" for tail in "|><")]
            for one in numbers
        ],
        dtype=object,
    )
    conditions = [impact >= 0, log["cause"][first] == WALL, log["before_p"][first] > 0.0]
    tail = np.select(conditions, [log["body"][other], bodies, bodies + 1], bodies + 2)
    return tuple(table[log["body"][first], tail])


def _structs(kind: type, rows: Sequence[Mapping[str, Any]], size: int) -> Any:
    """Return derivatives with respect to `size` numbers, those of the first number first."""
    found = zeros(size * len(rows), kind)
    for n, row in enumerate(rows):
        for name, number in row.items():
            found[name][n :: len(rows)] = change_of(number, size)
    return found


def _matrix(numbers: Sequence[Any], size: int) -> Floats:
    return np.array([change_of(one, size) for one in numbers])


def _changes_of(varied: TraceSystem, log: Any, shape: tuple[int, int]) -> Changes:
    """Return the derivatives of a system; `shape` is that of the derivatives of its times."""
    size, bodies = shape[1], varied.bodies
    current = np.zeros((1, len(bodies)), dtype=np.int64)
    begun = np.flatnonzero(log["cause"] == START)
    current[0, log["body"][begun]] = begun
    records = [body_record(body) for body in bodies]
    restitution = [varied.restitution_of(pair) for pair in range(len(bodies))]  # at most
    walls = [0.0 if one is None else one.restitution for one in (varied.left_end, varied.right_end)]
    tracks = [_of_track(varied, body, piece) for body in bodies for piece in varied.trace.pieces]
    laws = range(len(LAW_NAMES))
    weights = [weight_and_response(law, one, 1.0) for law in laws for one in records]
    starts = [{"place": one.position, "speed": one.speed} for one in varied.initial]
    return Changes(
        tracks=_structs(TrackChange, tracks, size),
        weight=_matrix([q / value_of(q) for q, _ in weights], size),
        response=_matrix([h / value_of(h) for _, h in weights], size),
        radius=_matrix([body.radius for body in bodies], size),
        restitution=_matrix(restitution, size),
        walls=_matrix(walls, size),
        motion=_structs(MotionChange, starts, size),
        current=current,
        arrivals=zeros(2, Arrival),
        flight=zeros(1, Flight),
        series=np.zeros((SERIES_ROWS, TERMS + 1)),
        times=np.zeros(shape),
        one_sided=np.zeros((1, size), dtype=np.int64),
    )


def _of_track(system: TraceSystem, body: Body, piece: Piece) -> dict[str, Any]:
    """Return the numbers of ``TrackChange``, with their derivatives."""
    ends: list[Any] = [piece.angle_start, piece.angle_end]
    if piece.index == 0 and system.left_end is not None:
        ends[0] = wall_position(piece, body.radius, False)
    if piece is system.trace.pieces[-1] and system.right_end is not None:
        ends[1] = wall_position(piece, body.radius, True)
    found: dict[str, Any] = {"left": ends[0], "right": ends[1]}
    if piece.is_line:
        x, y = piece.body_centre(0.0, body.radius)
        fall = sine_cosine(piece.start_slope)[0]
        pace = -system.gravity / body.kappa * fall
        return found | {"x": x, "y": y, "slope": piece.start_slope, "pace": pace}
    x, y = piece.centre
    rho = piece.path_radius(body.radius)
    w = body.natural_rate(system.gravity, rho)
    return found | {"x": x, "y": y, "path_radius": rho, "pace": w / value_of(w)}
