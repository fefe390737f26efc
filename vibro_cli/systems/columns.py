"""Tables and their columns, each declared once: name, type, unit, nullability, meaning, value.

The parquet schemas, the checks before writing, `vibro schema tables` and the tables' reference in
docs/ all come from these declarations, and so do the columns themselves where they say their value.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace
from typing import Any, Literal

from vibro_cli.kernels.impact.laws import LAW_NAMES
from vibro_cli.systems.contract import Columns

SCHEMA_VERSION = "1"

END_CAUSES = {
    "time": "the time asked for was reached",
    "collisions": "the number of impacts asked for was reached",
    "no_more_collisions": "no further impact is possible",
    "inadmissible": "after the impact law two bodies would go through one another",
    "end_of_trace": "a body came to an end of the trace",
    "lift_off": "a body left the trace",
    "rest": "all bodies are at rest",
    "bounces": "the number of impacts on the wall asked for was reached",
    "wall_contact": "a ball comes to roll along the wall, which is not solved",
    "accumulation": "impacts follow one another without end in finite time, which is not solved",
}
"""What the causes that end a run mean, in words."""

ColumnType = Literal["float64", "int64", "bool", "string"]
Value = Callable[[Any], Any]


@dataclass(frozen=True)
class Column:
    """One column; `nullable` says whether null may stand in it, `unit` is "" for a plain number."""

    name: str
    type: ColumnType
    unit: str
    description: str
    nullable: bool = False
    words: tuple[str, ...] = ()
    """The words of a column that is made as numbers, from 0."""
    value: Value | None = field(default=None, compare=False)
    """From what the rows are made of; None where a kernel fills the column."""


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

    def filled(self, source: Any) -> Columns:
        """Return all columns, from what their values are made of."""
        return {column.name: column.value(source) for column in self.columns if column.value}

    def in_words(self, columns: Columns) -> Columns:
        """Return columns in which words are given by their numbers with the words."""
        import numpy as np

        words = {column.name: column.words for column in self.columns if column.words}
        return columns | {
            name: np.array(words[name], dtype=object)[values]
            for name, values in columns.items()
            if name in words
        }


def number(
    name: str, unit: str, description: str, nullable: bool = False, value: Value | None = None
) -> Column:
    """A column of numbers with a unit."""
    return Column(name, "float64", unit, description, nullable, value=value)


def count(
    name: str, description: str, nullable: bool = False, value: Value | None = None
) -> Column:
    """A column of whole numbers."""
    return Column(name, "int64", "", description, nullable, value=value)


def flag(name: str, description: str, value: Value | None = None) -> Column:
    """A column of truth values."""
    return Column(name, "bool", "", description, value=value)


def word(
    name: str,
    description: str,
    words: tuple[str, ...] = (),
    nullable: bool = False,
    value: Value | None = None,
) -> Column:
    """A column of words; where `words` are given, its values are their numbers."""
    return Column(name, "string", "", description, nullable, words, value)


def of_log(name: str) -> Value:
    """Return the value of a column that is a field of the log."""
    return lambda rows: rows[name]


def of_last(name: str, ball: int | str) -> Value:
    """Return the value of a column of a summary that is a body's of the motion table at the end."""
    return lambda totals: totals.last[name][int(ball) - 1]


def is_one(name: str) -> Value:
    """Return the value of a column that says whether a field of the log is 1."""
    return lambda rows: rows[name] == 1


WHEN = (("pre", "before"), ("post", "after"))
"""The times of an impact, in names of columns and in words."""
ENDS = tuple((end, when, words) for when, words in WHEN for end in "ab")
"""Both bodies of an impact at these times."""
LAW = word(
    "law", "impact law that gave the speeds after the impact", LAW_NAMES, value=of_log("law")
)


def impact_head() -> Iterator[Column]:
    """What every table of impacts begins with."""
    yield count("n", "number of the impact, from 1", value=lambda rows: rows.number)
    yield number("t", "s", "time of the impact, the nearest double", value=of_log("t"))
    text = "what t lacks: t + t_low is the time in two doubles"
    yield number("t_low", "s", text, value=of_log("t_low"))
    text = "time since the previous row (null in the first)"
    yield number("dt", "s", text, True, lambda rows: rows.between)


def before_and_after(
    name: str,
    unit: str,
    text: str,
    nullable: bool = False,
    value: Callable[[str, str], Value] | None = None,
) -> Iterator[Column]:
    """The same quantity of both bodies, before and after the impact; `value` as for `phases`."""
    for end, when, words in ENDS:
        own = None if value is None else value(end, when)
        what = f"{text}, {words} the impact, of body {end}"
        yield number(f"{name}_{end}_{when}", unit, what, nullable, own)


def impact_tail(
    loss: str = "energy lost in the impact",
    gap: str = "horizontal distance of the centres beyond that of touching",
    simultaneous: str = "whether the event before it was at the same instant, or others are solved "
    "with it",
) -> Iterator[Column]:
    """What every impact of two bodies ends with, with what three columns mean."""
    yield number("energy_loss", "J", loss, value=of_log("loss"))
    text = "J_Pb (ω_b⁺ − ω_b⁻), the moment of the impulse"
    yield number("impulse_moment", "N m s", text, value=lambda rows: rows.impulse_moment)
    text = "speed of approach along the line of centres, before"
    yield number("approach_speed", "m/s", text, value=lambda rows: rows.approach_speed)
    text = "speed of separation along the line of centres, after"
    yield number("separation_speed", "m/s", text, value=lambda rows: rows.separation_speed)
    yield number("gap", "m", gap, value=of_log("gap"))
    yield LAW
    text = "whether the law of the scenario can be followed: the bodies separate after it"
    yield flag("admissible", text, is_one("admissible"))
    text = "whether the normal-impulse law stood in for an inadmissible impact"
    yield flag("substituted", text, is_one("substituted"))
    yield flag("simultaneous", simultaneous, is_one("simultaneous"))
    yield grazing()


KINETIC = "kinetic energy ½ κ m v² = ½ J_P ω²"
IMPULSE = "m_b (v_b⁺ − v_b⁻), the impulse, under the law of translation (else null)"


def impulse() -> Column:
    """The impulse on body b, where the law is that of translation, B (6)."""
    return number("impulse", "N s", IMPULSE, True, lambda rows: rows.impulse)


def phases(
    prefix: str,
    text: str,
    words: tuple[str, ...],
    value: Callable[[str, str], Value] | None = None,
) -> Iterator[Column]:
    """Where both bodies are in their phase planes, before and after the impact.

    `value` gives that of a column from the end, `a` or `b`, and `pre` or `post`.
    """
    for end, when, said in ENDS:
        of_end = None if value is None else value(end, when)
        name, what = f"{prefix}_{end}_{when}", f"{text}; body {end}, {said} the impact"
        yield word(name, what, words, value=of_end)


def grazing() -> Column:
    """Whether an impact is a mere touch."""
    text = "whether the contact cannot be told from a touch in double precision"
    return flag("grazing", text, is_one("grazing"))


def summary_head(causes: str) -> Iterator[Column]:
    """What every summary begins with; `causes` are those of the end."""
    text = "ok, invalid (the scenario is not possible) or failed"
    yield word("status", text, value=lambda totals: "ok")
    yield word("reason", "why the status is not ok", (), True, lambda totals: None)
    yield word("end_cause", causes, (), True, lambda totals: totals.end_cause)
    text = "time at which the run ended"
    yield number("end_time", "s", text, True, lambda totals: totals.end_time)


def of_clock(name: str) -> Value:
    """Return the value of a column of a summary that is a field of the run's clock."""
    return lambda totals: int(totals.clock[name])


def summary_balance(
    impact: str = "impact of two bodies",
    drift: str = "relative change of the energy, where it should be kept",
    gap: str = "largest distance left between bodies at an impact",
) -> Iterator[Column]:
    """Times, energies and gaps of every summary; `drift` and `gap` are what two columns mean."""
    text = f"time of the first {impact}"
    yield number("first_collision_time", "s", text, True, lambda totals: totals.first_time)
    text = f"time of the last {impact}"
    yield number("last_collision_time", "s", text, True, lambda totals: totals.last_time)
    text = "energy of all bodies at the start"
    yield number("energy_start", "J", text, True, lambda totals: totals.energy_start)
    text = "energy of all bodies at the end"
    yield number("energy_end", "J", text, True, lambda totals: totals.energy_end)
    yield number("energy_drift", "", drift, True, lambda totals: totals.energy_drift)
    text = "sum of the corrections that keep the energy, absolute"
    yield number("energy_correction", "J", text, True, lambda t: t.clock["energy_correction"])
    yield number("max_gap", "m", gap, True, lambda totals: totals.largest_gap)


GROWTH = (
    number(
        "amplification",
        "",
        "growth of a small change of the start in the states of both bodies after the impact "
        "(null beyond 1e308, and where the motion has no derivative that is known)",
        True,
    ),
    number(
        "digits_left",
        "",
        "decimal digits that rounding the start to doubles leaves of these states",
        True,
    ),
    flag("smooth", "whether the motion depends differentiably on its start here"),
)
"""What impacts have besides where the growth of small changes is followed."""


def with_columns(table: Table, *more: Column) -> Table:
    """A table with some more columns."""
    return replace(table, columns=(*table.columns, *more))


def with_growth(table: Table) -> Table:
    """A table of impacts with what they have where the growth of small changes is followed."""
    return with_columns(table, *GROWTH)


def exponents(numbers: int | str, when: str = "") -> tuple[Column, ...]:
    """Columns of so many Lyapunov exponents, or of one that stands for any; of a run, or `when`."""
    names = [numbers] if isinstance(numbers, str) else range(1, numbers + 1)
    text = "Lyapunov exponent {}{}, the greatest first (null for −∞, and where it is not known)"
    return tuple(number(f"lyapunov_{name}", "1/s", text.format(name, when), True) for name in names)


def converging(numbers: int | str) -> Table:
    """The table of how exponents converge; `numbers` as for :func:`exponents`."""
    columns = (
        count("n", "number of the impact, from 1"),
        number("t", "s", "time of the impact"),
        *exponents(numbers, " until then"),
        number("lyapunov_error", "1/s", "standard error of the greatest exponent", True),
    )
    return Table("exponents", "the run until one of its impacts", columns)
