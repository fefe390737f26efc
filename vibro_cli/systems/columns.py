"""Tables and their columns, each declared once: name, type, unit, nullability, meaning, value.

The Parquet schemas, the checks before writing, `vibro schema tables` and the reference of tables in
docs/ are derived from these declarations, and so are the data of columns that have a ``value``.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace
from typing import Any, Literal

from vibro_cli.kernels.impact.laws import LAW_NAMES
from vibro_cli.kernels.numerics.constants import LATEST
from vibro_cli.systems.contract import Columns

SCHEMA_VERSION = "1"

COUNTED = {"collisions": "impacts", "bounces": "impacts on the wall"}
"""Counts of impacts in a run's clock and summary, with their nouns."""
MOST_EXPONENTS = 256
"""Greatest number of impacts of a run up to which exponents are stored."""
END_CAUSES = {
    "time": "the stop time was reached",
    "collisions": "the requested number of impacts was reached",
    "no_more_collisions": "no further impact is possible",
    "inadmissible": "under the impact law two bodies would pass through one another",
    "end_of_trace": "a body reached an end of the trace",
    "lift_off": "a body lifted off the trace",
    "rest": "all bodies are at rest",
    "bounces": "the requested number of impacts on the wall was reached",
    "wall_contact": "a ball began to roll along the wall, which is not solved",
    "accumulation": "infinitely many impacts accumulated in finite time, which is not solved",
}
"""Meanings of the causes that end a run."""


def end_in_words(cause: str, time: float | None) -> str:
    """Return the cause of an end at a time (s) in words."""
    if cause == "time" and time == LATEST:
        return "the bodies move on for ever; without stop.time a run is followed until then"
    return END_CAUSES.get(cause, cause)


ColumnType = Literal["float64", "int64", "bool", "string"]
Value = Callable[[Any], Any]


@dataclass(frozen=True)
class Column:
    """A column of a table; `nullable` allows null, `unit` is "" for a dimensionless number."""

    name: str
    type: ColumnType
    unit: str
    description: str
    nullable: bool = False
    words: tuple[str, ...] = ()
    """Words that the integer codes of the column stand for, from 0."""
    value: Value | None = field(default=None, compare=False)
    """Computes the column from the source of the rows; None if a kernel fills the column."""


@dataclass(frozen=True)
class Table:
    """A table: its name, the meaning of a row, and its columns in order."""

    name: str
    row: str
    columns: tuple[Column, ...]

    @property
    def file(self) -> str:
        """Name of its file without the suffix: the part of the name after the last dot."""
        return self.name.rpartition(".")[2]

    @property
    def schema_id(self) -> str:
        """Name and version of the schema, as stored in the metadata of files."""
        return f"{self.name}/{SCHEMA_VERSION}"

    def filled(self, source: Any) -> Columns:
        """Return the columns that have a ``value``, computed from a source."""
        return {column.name: column.value(source) for column in self.columns if column.value}

    def in_words(self, columns: Columns) -> Columns:
        """Return columns with integer codes replaced by the words that they stand for."""
        import numpy as np

        words = {column.name: column.words for column in self.columns if column.words}
        return columns | {
            name: np.array(words[name], dtype=object)[values]
            for name, values in columns.items()
            if name in words
        }


def made(impacts: Any) -> Any:
    """Return which impacts of two bodies took place; at the others the run ended instead."""
    import numpy as np

    flags = (np.asarray(impacts[name], dtype=np.bool_) for name in ("admissible", "substituted"))
    return np.logical_or(*flags)


def number(
    name: str, unit: str, description: str, nullable: bool = False, value: Value | None = None
) -> Column:
    """Return a column of floating-point numbers with a unit."""
    return Column(name, "float64", unit, description, nullable, value=value)


def count(
    name: str, description: str, nullable: bool = False, value: Value | None = None
) -> Column:
    """Return a column of integers."""
    return Column(name, "int64", "", description, nullable, value=value)


def flag(name: str, description: str, value: Value | None = None) -> Column:
    """Return a column of booleans."""
    return Column(name, "bool", "", description, value=value)


def word(
    name: str,
    description: str,
    words: tuple[str, ...] = (),
    nullable: bool = False,
    value: Value | None = None,
) -> Column:
    """Return a column of words; if `words` are given, its values are their integer codes."""
    return Column(name, "string", "", description, nullable, words, value)


def of_log(name: str) -> Value:
    """Return the ``value`` of a column that is a field of the log."""
    return lambda rows: rows[name]


def of_last(name: str, ball: int | str) -> Value:
    """Return the ``value`` of a summary's column: a body's entry in the final motion table."""
    return lambda totals: totals.last[name][int(ball) - 1]


def is_one(name: str) -> Value:
    """Return the ``value`` of a column that is true where a field of the log is 1."""
    return lambda rows: rows[name] == 1


WHEN = (("pre", "before"), ("post", "after"))
"""Before and after an impact, in the names of columns and in words."""
ENDS = tuple((end, when, words) for when, words in WHEN for end in "ab")
"""Both bodies of an impact, before and after it."""
LAW = word(
    "law", "impact law that gave the speeds after the impact", LAW_NAMES, value=of_log("law")
)


def impact_head() -> Iterator[Column]:
    """Yield the first columns of every table of impacts."""
    yield count("n", "number of the impact, from 1", value=lambda rows: rows.number)
    yield number("t", "s", "time of the impact, as the nearest double", value=of_log("t"))
    text = "remainder of the time: t + t_low is the time as the sum of two doubles"
    yield number("t_low", "s", text, value=of_log("t_low"))
    text = "time since the previous row (null in the first)"
    yield number("dt", "s", text, True, lambda rows: rows.between)


def before_and_after(
    name: str,
    unit: str,
    text: str,
    nullable: bool = False,
    value: Callable[[str, str], Value] | None = None,
    words: tuple[str, ...] = (),
) -> Iterator[Column]:
    """Yield a quantity of both bodies, or if `words` are given a word, before and after the impact.

    `text` has a field for the body and the time: "body a before the impact". `value` maps body
    (`a` or `b`) and time (`pre` or `post`) to the ``value`` of the column.
    """
    kind: ColumnType = "string" if words else "float64"
    for end, when, said in ENDS:
        own = None if value is None else value(end, when)
        what = text.format(f"body {end} {said} the impact")
        yield Column(f"{name}_{end}_{when}", kind, unit, what, nullable, words, own)


def impact_tail(
    loss: str = "energy lost in the impact",
    gap: str = "horizontal distance between the centres minus that at contact",
    simultaneous: str = "whether the preceding event was at the same instant, or other impacts "
    "were solved jointly with it",
) -> Iterator[Column]:
    """Yield the last columns of every table of impacts of two bodies.

    The arguments describe three of these columns.
    """
    yield number("energy_loss", "J", loss, value=of_log("loss"))
    text = "moment of the impulse, J_Pb (ω_b⁺ − ω_b⁻)"
    yield number("impulse_moment", "N m s", text, value=lambda rows: rows.impulse_moment)
    text = "speed of approach along the line of centres, before the impact"
    yield number("approach_speed", "m/s", text, value=lambda rows: rows.approach_speed)
    text = "speed of separation along the line of centres, after the impact"
    yield number("separation_speed", "m/s", text, value=lambda rows: rows.separation_speed)
    yield number("gap", "m", gap, value=of_log("gap"))
    yield LAW
    text = (
        "whether the law of the scenario is admissible here: the bodies separate after the impact "
        "(false also for impacts that another one, or lift-off, prevents)"
    )
    yield flag("admissible", text, is_one("admissible"))
    text = (
        "whether the normal-impulse law replaced the law of the scenario, which is inadmissible "
        "here (false for impacts that do not take place, whatever their law)"
    )
    yield flag("substituted", text, is_one("substituted"))
    yield flag("simultaneous", simultaneous, is_one("simultaneous"))
    yield grazing()


KINETIC = "kinetic energy ½ κ m v² = ½ J_P ω² of {}"
IMPULSE = "impulse, m_b (v_b⁺ − v_b⁻), under the translational law (otherwise null)"


def impulse() -> Column:
    """Return the column of the impulse on body b under the translational law, B (6)."""
    return number("impulse", "N s", IMPULSE, True, lambda rows: rows.impulse)


def grazing() -> Column:
    """Return the column that marks impacts that may be mere touches."""
    text = "whether double precision cannot distinguish the contact from a passing touch"
    return flag("grazing", text, is_one("grazing"))


def summary_head(causes: str) -> Iterator[Column]:
    """Yield the first columns of every summary; `causes` describes the causes of the end."""
    text = "ok, invalid (the scenario is impossible) or failed"
    yield word("status", text, value=lambda totals: "ok")
    yield word("reason", "why the status is not ok", (), True, lambda totals: None)
    yield word("end_cause", causes, (), True, lambda totals: totals.end_cause)
    text = "time at which the run ended"
    yield number("end_time", "s", text, True, lambda totals: totals.end_time)


def of_clock(name: str) -> Value:
    """Return the ``value`` of a summary's column: an integer field of the run's clock."""
    return lambda totals: int(totals.clock[name])


def summary_balance(
    impact: str = "impact of two bodies",
    gap: str = "largest distance left between two bodies at an impact",
) -> Iterator[Column]:
    """Yield the times, energies and gaps of every summary.

    `gap` describes a column; `impact` names the impacts.
    """
    text = f"time of the first {impact}"
    yield number("first_collision_time", "s", text, True, lambda totals: totals.first_time)
    text = f"time of the last {impact}"
    yield number("last_collision_time", "s", text, True, lambda totals: totals.last_time)
    text = "energy of all bodies at the start"
    yield number("energy_start", "J", text, True, lambda totals: totals.energy_start)
    text = "energy of all bodies at the end"
    yield number("energy_end", "J", text, True, lambda totals: totals.energy_end)
    text = "relative change in energy, where it should be conserved (otherwise null)"
    yield number("energy_drift", "", text, True, lambda totals: totals.energy_drift)
    text = "sum of the absolute values of the corrections that keep the energy constant"
    yield number("energy_correction", "J", text, True, lambda t: t.clock["energy_correction"])
    yield number("max_gap", "m", gap, True, lambda totals: totals.largest_gap)


GROWTH = (
    number(
        "amplification",
        "",
        "factor by which a small perturbation of the initial state has grown in the states of the "
        "bodies after the impact (null beyond 1e308, and where no derivative of the motion is "
        "known)",
        True,
    ),
    number(
        "digits_left",
        "",
        "accurate decimal digits left in these states if the initial state is rounded to doubles",
        True,
    ),
    flag("smooth", "whether the motion depends differentiably on the initial state here"),
)
"""Columns of impacts on the growth of small perturbations of the initial state."""


def with_columns(table: Table, *more: Column) -> Table:
    """Return a table with further columns."""
    return replace(table, columns=(*table.columns, *more))


def exponents(numbers: int | str, when: str = "") -> tuple[Column, ...]:
    """Return the columns of Lyapunov exponents: of a number of them, or of one letter for any.

    `when` completes their description.
    """
    names = [numbers] if isinstance(numbers, str) else range(1, numbers + 1)
    text = "Lyapunov exponent {}{}, the greatest first (null for −∞, and where it is unknown)"
    return tuple(number(f"lyapunov_{name}", "1/s", text.format(name, when), True) for name in names)


def converging(numbers: int | str) -> Table:
    """Return the table of converging exponents; `numbers` as in :func:`exponents`."""
    columns = (
        count("n", "number of the impact, from 1"),
        number("t", "s", "time of the impact"),
        *exponents(numbers, " of the run up to this impact"),
        number("lyapunov_error", "1/s", "standard error of the greatest exponent", True),
    )
    row = f"one of at most {MOST_EXPONENTS} evenly chosen impacts, with the exponents up to it"
    return Table("exponents", row, columns)
