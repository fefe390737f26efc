"""The tables of every system as their objects declare them, and their description.

The parquet schemas, the checks before writing, `vibro schema tables` and the tables' reference in
docs/ all come from these declarations (see `systems.columns`).
"""

from collections.abc import Iterable, Sequence

from vibro_cli.systems import system_named
from vibro_cli.systems.columns import Column, Table, count, flag, number

__all__ = ["Column", "Table", "count", "flag", "number"]


def summary(balls: int, system: str = "trace", grown: bool = False) -> Table:
    """The table of summaries of runs of a system with `balls` bodies; `grown` with exponents."""
    return system_named(system).summary(balls, grown)


def reference(system: str = "trace") -> tuple[Table, ...]:
    """Every table of a system with all columns it may have; the summary's stand for a body `i`."""
    return system_named(system).tables()


def table_named(name: str, column_names: Sequence[str], system: str = "trace") -> Table:
    """The table `name` of a system, as it must be for data with these columns.

    Raises `ValueError` for a name that is no table.
    """
    found = system_named(system).table(name, column_names)
    if found is None:
        raise ValueError(f"there is no table {name!r}")
    return found


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
