"""The tables of a run on a trace: every column's name, type, unit, nullability and meaning."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from vibro_cli.kernels.statistics.regimes import EIGHTS, REGIMES
from vibro_cli.systems.columns import (
    GROWTH,
    IMPULSE,
    KINETIC,
    LAW,
    Column,
    Table,
    converging,
    converging_table,
    count,
    exponents,
    flag,
    number,
    phases,
    word,
)
from vibro_cli.systems.trace.events import NAMES


def _pair(prefix: str, suffix: str, unit: str, text: str, nullable: bool = False) -> list[Column]:
    """The same quantity of both bodies of an impact."""
    return [
        number(f"{prefix}_{body}{suffix}", unit, f"{text} of body {body}", nullable)
        for body in ("a", "b")
    ]


def _before_and_after(
    prefix: str, unit: str, text: str, nullable: bool = False
) -> Iterable[Column]:
    """The same quantity of both bodies, before and after the impact."""
    yield from _pair(prefix, "_pre", unit, f"{text}, before the impact,", nullable)
    yield from _pair(prefix, "_post", unit, f"{text}, after the impact,", nullable)


_ANGLE = "angle on its arc (φ in a valley, ψ on a hump; null on a line)"
_RATE = "rate of that angle (φ̇ or ψ̇; null on a line)"
_ENERGY = (
    "kinetic and potential energy (potential from the lowest place its centre can have on the "
    "trace)"
)
_VALUE = (
    "turning: the angle there in rad (on a line the position in m); wall: the speed before in "
    "m/s; contact_closed: how long the bounces before it lasted in s; slip: the coefficient of "
    "friction; lift_off: the normal force in N; else null"
)
_PHASES = (
    (
        "regime",
        "oscillating, or progressive: it would come to an end of the trace, or round a closed one",
        REGIMES,
    ),
    (
        "eight",
        "side of the first figure eight from the left it is within: left loop, right loop, on it, "
        "or outside of all (none: there is no figure eight)",
        EIGHTS,
    ),
)
_OMEGA = "angular velocity about the contact point (null for a particle, which slides)"
_SIDE = count("side", "side on which the bodies meet: 1, or −1 when body 2 is met from behind")


def collisions(sided: bool = False, grown: bool = False) -> Table:
    """The table of impacts; `sided` for two bodies on a closed trace, which may meet two ways.

    `grown` with the growth of small changes.
    """
    columns = [
        count("n", "number of the impact, from 1"),
        number("t", "s", "time of the impact, the nearest double"),
        number("t_low", "s", "what t lacks: t + t_low is the time in two doubles"),
        number("dt", "s", "time since the previous row (null in the first)", nullable=True),
        count("ball_a", "left body of the pair, from 1"),
        count("ball_b", "right body of the pair, from 1 (1 across the seam of a closed trace)"),
        *([_SIDE] if sided else []),
        count("arc_a", "piece of the trace body a is on, from 1"),
        count("arc_b", "piece of the trace body b is on, from 1"),
        *_pair("angle", "", "rad", _ANGLE, nullable=True),
        *_pair("s", "", "m", "arc length from the trace's left end to the contact point"),
        number("x_a", "m", "horizontal place of the centre of body a"),
        number("y_a", "m", "height of the centre of body a"),
        number("x_b", "m", "horizontal place of the centre of body b"),
        number("y_b", "m", "height of the centre of body b"),
        *_before_and_after("rate", "rad/s", _RATE, nullable=True),
        *_before_and_after("omega", "rad/s", _OMEGA, nullable=True),
        *_before_and_after("speed", "m/s", "signed speed of the centre"),
        *_before_and_after("energy", "J", _ENERGY),
        number(
            "energy_loss",
            "J",
            "energy lost in the impact; where contact begins, in all further bounces too",
        ),
        number("impulse_moment", "N m s", "J_Pb (ω_b⁺ − ω_b⁻), the moment of the impulse"),
        number("approach_speed", "m/s", "speed of approach along the line of centres, before"),
        number("separation_speed", "m/s", "speed of separation along the line of centres, after"),
        number("gap", "m", "distance of the surfaces left at that time"),
        LAW,
        flag("admissible", "whether the bodies separate after the law of the scenario"),
        flag("substituted", "whether the normal-impulse law stood in for an inadmissible impact"),
        flag(
            "simultaneous",
            "whether other pairs collide at the same instant, or the row stands for all that would",
        ),
        flag("grazing", "whether the contact cannot be told from a touch in double precision"),
        flag("contact", "whether lasting contact of the pair begins here"),
        *_before_and_after("kinetic_energy", "J", KINETIC),
        number("impulse", "N s", IMPULSE, nullable=True),
        *(phase for prefix, text, words in _PHASES for phase in phases(prefix, text, words)),
        *(GROWTH if grown else ()),
    ]
    return Table("collisions", "one impact of one pair", tuple(columns))


def events() -> Table:
    """The table of everything else that happens at an instant."""
    columns = (
        number("t", "s", "time of the event"),
        word(
            "event",
            "crossing, turning, contact_closed, contact_opened, wall, end, lift_off or slip",
            NAMES,
        ),
        count("ball", "body it happens to, from 1", nullable=True),
        count("other", "other body of the pair, from 1", nullable=True),
        count("arc_from", "piece of the trace before the event, from 1", nullable=True),
        count("arc_to", "piece of the trace after the event, from 1", nullable=True),
        number("s", "m", "arc length from the trace's left end to the contact point", True),
        number("speed", "m/s", "signed speed of the body's centre after the event", True),
        number("value", "", _VALUE, True),
    )
    return Table("events", "one event other than an impact", columns)


def motion() -> Table:
    """The table of the sampled motion."""
    columns = (
        number("t", "s", "time"),
        count("ball", "body, from 1"),
        count("arc", "piece of the trace the body is on, from 1"),
        number("angle", "rad", _ANGLE, nullable=True),
        number("s", "m", "arc length from the trace's left end to the contact point"),
        number("x", "m", "horizontal place of the centre"),
        number("y", "m", "height of the centre"),
        number("speed", "m/s", "signed speed of the centre"),
        number("energy", "J", _ENERGY),
    )
    return Table("motion", "one body at one sampled time", columns)


_SUMMARY_HEAD = (
    Column("status", "string", "", "ok, invalid (the scenario is not possible) or failed"),
    Column("reason", "string", "", "why the status is not ok", nullable=True),
    Column(
        "end_cause",
        "string",
        "",
        "time, collisions, no_more_collisions, inadmissible, end_of_trace, lift_off or rest",
        nullable=True,
    ),
    number("end_time", "s", "time at which the run ended", True),
    number("quiet_from", "s", "time since when no further impact was possible", True),
    count("collisions", "number of impacts", True),
    count("crossings", "number of junctions crossed (a seam counts as one)", True),
    count("contacts", "number of lasting contacts begun", True),
    number("first_collision_time", "s", "time of the first impact", True),
    number("last_collision_time", "s", "time of the last impact", True),
    number("energy_start", "J", "energy of all bodies at the start", True),
    number("energy_end", "J", "energy of all bodies at the end", True),
    number(
        "energy_drift",
        "",
        "relative change of the energy, where it should be kept (else null)",
        True,
    ),
    number("energy_correction", "J", "sum of the corrections that keep the energy, absolute", True),
    number("max_gap", "m", "largest distance of the surfaces left at an impact", True),
    number("min_normal_force", "N", "smallest normal force of the trace on any body", True),
    number(
        "max_friction_demand",
        "",
        "largest coefficient of friction that rolling needs (null if none suffices, or "
        "nothing rolls)",
        True,
    ),
)


def final_state(ball: int | str) -> tuple[Column, ...]:
    """The columns of a body's final state; `ball` counts from 1."""
    return (
        count(f"arc_{ball}", f"piece of the trace body {ball} ends on, from 1", True),
        number(f"angle_{ball}", "rad", f"final angle of body {ball} (null on a line)", True),
        number(f"s_{ball}", "m", f"final arc length of the contact point of body {ball}", True),
        number(f"speed_{ball}", "m/s", f"final signed speed of the centre of body {ball}", True),
    )


def summary(balls: int, grown: bool = False) -> Table:
    """The table of summaries of runs with `balls` bodies; `grown` with exponents."""
    states = [column for ball in range(1, balls + 1) for column in final_state(ball)]
    if grown:
        states += exponents(2 * balls)
    return Table("summary", "one run", (*_SUMMARY_HEAD, *states))


def tables() -> tuple[Table, ...]:
    """Every table with all columns it may have; the final state stands for any body `i`."""
    columns = (*_SUMMARY_HEAD, *final_state("i"), *exponents("i"))
    sample = Table("summary", "one run", columns)
    return (collisions(sided=True, grown=True), events(), motion(), sample, converging("i"))


def table_named(name: str, column_names: Sequence[str]) -> Table | None:
    """The table `name`, as it must be for data with these columns; None for one that is not."""
    if name == "collisions":
        grown = GROWTH[0].name in column_names
        return collisions(sided=_SIDE.name in column_names, grown=grown)
    if name == "summary":
        balls = sum(column.startswith("arc_") for column in column_names)
        return summary(balls, grown="lyapunov_1" in column_names)
    if name == "exponents":
        return converging_table(column_names)
    return {"events": events(), "motion": motion()}.get(name)
