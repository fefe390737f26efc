"""The tables: every column's name, type, unit, nullability and meaning, said once.

The parquet schemas, the checks before writing, `vibro schema tables` and the tables' reference in
README.md all come from this description.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Literal

SCHEMA_VERSION = "1"

ColumnType = Literal["float64", "int64", "bool", "string"]


@dataclass(frozen=True)
class Column:
    """One column; `nullable` says whether null may stand in it, `unit` is "" for a plain number."""

    name: str
    type: ColumnType
    unit: str
    description: str
    nullable: bool = False


@dataclass(frozen=True)
class Table:
    """A table: its name, what one row of it is, and its columns in order."""

    name: str
    row: str
    columns: tuple[Column, ...]

    @property
    def file(self) -> str:
        """The name of its file without the suffix: that of a system's table stands before it."""
        return self.name.rpartition(".")[2]

    @property
    def schema_id(self) -> str:
        """Name and version of the schema, as written into the files' metadata."""
        return f"{self.name}/{SCHEMA_VERSION}"


def number(name: str, unit: str, description: str, nullable: bool = False) -> Column:
    """A column of numbers with a unit."""
    return Column(name, "float64", unit, description, nullable)


def count(name: str, description: str, nullable: bool = False) -> Column:
    """A column of whole numbers."""
    return Column(name, "int64", "", description, nullable)


def flag(name: str, description: str) -> Column:
    """A column of truth values."""
    return Column(name, "bool", "", description)


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
_SIDE = count("side", "side on which the bodies meet: 1, or −1 when body 2 is met from behind")


def collisions(sided: bool = False) -> Table:
    """The table of impacts; `sided` for two bodies on a closed trace, which may meet two ways."""
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
        *_before_and_after("omega", "rad/s", "angular velocity about the contact point"),
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
        Column("law", "string", "", "impact law that gave the speeds after the impact"),
        flag("admissible", "whether the bodies separate after the law of the scenario"),
        flag("substituted", "whether the normal-impulse law stood in for an inadmissible impact"),
        flag("simultaneous", "whether other pairs collide at the same instant"),
        flag("grazing", "whether the contact cannot be told from a touch in double precision"),
        flag("contact", "whether lasting contact of the pair begins here"),
    ]
    return Table("collisions", "one impact of one pair", tuple(columns))


def events() -> Table:
    """The table of everything else that happens at an instant."""
    columns = (
        number("t", "s", "time of the event"),
        Column(
            "event",
            "string",
            "",
            "crossing, turning, contact_closed, contact_opened, wall, end, lift_off or slip",
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
        "largest coefficient of friction that rolling needs (null if no coefficient suffices)",
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


def summary(balls: int, system: str = "trace") -> Table:
    """The table of summaries of runs of a system with `balls` bodies."""
    if system != "trace":
        from vibro_cli.storage.system_schema import system_summary

        return system_summary(system, balls)
    states = [column for ball in range(1, balls + 1) for column in final_state(ball)]
    return Table("summary", "one run", (*_SUMMARY_HEAD, *states))


def reference() -> tuple[Table, ...]:
    """Every table with all columns it may have; the final state stands for any body `i`."""
    sample = Table("summary", "one run", (*_SUMMARY_HEAD, *final_state("i")))
    return (collisions(sided=True), events(), motion(), sample)


def table_named(name: str, column_names: Sequence[str], system: str = "trace") -> Table:
    """The table `name` of a system, as it must be for data with these columns.

    Raises `ValueError` for a name that is no table.
    """
    if system != "trace":
        from vibro_cli.storage.system_schema import system_table

        return system_table(system, name, column_names)
    if name == "collisions":
        return collisions(sided=_SIDE.name in column_names)
    if name == "summary":
        return summary(sum(column.startswith("arc_") for column in column_names))
    for table in (events(), motion()):
        if table.name == name:
            return table
    raise ValueError(f"there is no table {name!r}")


def as_json() -> dict[str, object]:
    """The description of all tables as plain values (`vibro schema tables`)."""
    return {
        table.schema_id: {
            "row": table.row,
            "columns": [
                {
                    "name": column.name,
                    "type": column.type,
                    "unit": column.unit,
                    "nullable": column.nullable,
                    "description": column.description,
                }
                for column in table.columns
            ],
        }
        for table in reference()
    }


def as_markdown() -> str:
    """The description of all tables as it stands in README.md."""
    return markdown_of(reference())


def markdown_of(tables: Iterable[Table]) -> str:
    """The description of tables as Markdown."""
    parts = []
    for table in tables:
        lines = [
            f"`{table.file}.parquet`: {table.row} in each row.",
            "",
            "| column | type | unit | null | meaning |",
            "|---|---|---|---|---|",
        ]
        for column in table.columns:
            null = "yes" if column.nullable else ""
            lines.append(
                f"| `{column.name}` | {column.type} | {column.unit} | {null} "
                f"| {column.description} |"
            )
        parts.append("\n".join(lines))
    return "\n\n".join(parts) + "\n"
