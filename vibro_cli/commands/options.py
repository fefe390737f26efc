"""Arguments and options that several commands share."""

import functools
import inspect
from collections.abc import Callable
from typing import Annotated, Any, Literal

import typer

from vibro_cli.commands.completing import scenario_files, scenario_keys
from vibro_cli.commands.streams import choose_words

Task = Callable[[], int]
"""What a command does once its arguments are read; it returns the exit code."""

TableFormat = Literal["csv", "jsonl", "arrow", "parquet"]

Scenarios = Annotated[
    list[str],
    typer.Argument(
        metavar="SCENARIO",
        help="Scenario files (TOML, JSON or YAML), or - for standard input.",
        show_default=False,
        autocompletion=scenario_files,
    ),
]
Overrides = Annotated[
    list[str],
    typer.Option(
        "--set",
        metavar="PATH=VALUE",
        help="Override a value of every scenario, e.g. --set balls[1].angle=-1.2; repeatable.",
        show_default=False,
        autocompletion=scenario_keys,
    ),
]
Engine = Annotated[
    Literal["compiled", "python"],
    typer.Option(
        "--engine",
        envvar="VIBRO_ENGINE",
        help="Kernels: compiled, or interpreted by Python; the results are the same to the bit.",
    ),
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
    bool,
    typer.Option(
        "--strict",
        envvar="VIBRO_STRICT",
        help="Exit with 3 when a run was inadmissible or invalid.",
    ),
]
FailFast = Annotated[
    bool,
    typer.Option(
        "--fail-fast", help="Stop at the first scenario that is invalid or fails; else go on."
    ),
]


def _choose_least(level: str) -> Callable[[bool], bool]:
    """A callback of a flag that chooses the least level of words that is said."""

    def choose(given: bool) -> bool:
        if given:
            choose_words(least=level)
        return given

    return choose


Quiet = Annotated[
    bool,
    typer.Option("--quiet", "-q", help="Print errors only.", callback=_choose_least("error")),
]
Verbose = Annotated[
    bool,
    typer.Option(
        "--verbose",
        "-v",
        help="Say what was not computed, and why.",
        callback=_choose_least("detail"),
    ),
]


def choose_log_format(form: str) -> str:
    """Take up the form of words on standard error."""
    choose_words(as_json=form == "json")
    return form


LogFormat = Annotated[
    Literal["text", "json"],
    typer.Option(
        "--log-format",
        envvar="VIBRO_LOG_FORMAT",
        help="Words and errors on standard error as text, or as a JSON object on each line.",
        callback=choose_log_format,
        is_eager=True,
    ),
]


def with_common_options(command: Callable[..., Any]) -> Callable[..., Any]:
    """A command that also takes the options every command has: words and their form."""
    own = inspect.signature(command)

    @functools.wraps(command)
    def performed(**given: Any) -> Any:
        if given.get("output") == "":  # such as -o "$FOLDER" where no such variable is set
            raise typer.BadParameter("--output: found an empty text, expected a name")
        return command(**{name: given[name] for name in own.parameters})

    parameters = list(own.parameters.values())
    for name, kind, default in _COMMON:
        if name not in own.parameters:
            parameters.append(
                inspect.Parameter(
                    name, inspect.Parameter.KEYWORD_ONLY, default=default, annotation=kind
                )
            )
    performed.__signature__ = own.replace(parameters=parameters)  # type: ignore[attr-defined]
    performed.__annotations__ = {one.name: one.annotation for one in parameters}
    return performed


_COMMON: tuple[tuple[str, Any, Any], ...] = (
    ("quiet", Quiet, False),
    ("verbose", Verbose, False),
    ("log_format", LogFormat, "text"),
)
