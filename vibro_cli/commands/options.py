"""Arguments and options that several commands share."""

from collections.abc import Callable
from typing import Annotated, Literal

import typer

Task = Callable[[], int]
"""What a command does once its arguments are read; it returns the exit code."""

TableFormat = Literal["csv", "jsonl", "arrow", "parquet"]

Scenarios = Annotated[
    list[str],
    typer.Argument(
        metavar="SCENARIO",
        help="Scenario files (TOML, JSON or YAML), or - for standard input.",
        show_default=False,
    ),
]
Overrides = Annotated[
    list[str],
    typer.Option(
        "--set",
        metavar="PATH=VALUE",
        help="Override a value of every scenario, e.g. --set balls[1].angle=-1.2; repeatable.",
        show_default=False,
    ),
]
Engine = Annotated[
    Literal["auto", "python", "numba"],
    typer.Option("--engine", help="Kernels: interpreted, compiled, or as the scenario needs."),
]
CollisionStream = Annotated[
    TableFormat | None,
    typer.Option(
        "--format",
        help="Stream the collision table to standard output in this form; no folder is written "
        "unless -o names one.",
    ),
]
Strict = Annotated[
    bool, typer.Option("--strict", help="Exit with 3 when a run was inadmissible or invalid.")
]
Quiet = Annotated[bool, typer.Option("--quiet", "-q", help="Print errors only.")]
Verbose = Annotated[
    bool, typer.Option("--verbose", "-v", help="Say what was not computed, and why.")
]
