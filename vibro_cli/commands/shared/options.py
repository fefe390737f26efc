"""Arguments and options that several commands share, and their completion in the shell.

The completion functions (scenario files, keys after --set, the gallery) must neither print nor
fail; they leave out what they cannot determine.
"""

import functools
import inspect
import os
import re
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from typing import Annotated, Any, Literal

import typer

from vibro_cli.commands.shared.terminal import configure_messages

_SUFFIXES = (".toml", ".json", ".yaml", ".yml")


def scenario_files(incomplete: str) -> list[str]:
    """Return the folders and scenario files that begin with a text."""
    return _paths(incomplete, _SUFFIXES)


def table_files(incomplete: str) -> list[str]:
    """Return the folders and parquet files that begin with a text."""
    return _paths(incomplete, (".parquet",))


def _paths(incomplete: str, suffixes: tuple[str, ...]) -> list[str]:
    head, slash, tail = incomplete.rpartition("/")
    folder = Path(head + slash or ".").expanduser()
    found = []
    try:
        for entry in sorted(folder.iterdir()):
            hidden = entry.name.startswith(".") and not tail.startswith(".")
            if hidden or not entry.name.startswith(tail):
                continue
            if entry.is_dir():
                found.append(f"{head}{slash}{entry.name}/")
            elif entry.suffix.lower() in suffixes:
                found.append(f"{head}{slash}{entry.name}")
    except OSError:
        return []
    return found


def gallery_names(incomplete: str) -> list[str]:
    """Return the scenarios and grids of the gallery that begin with a text."""
    from vibro_cli.scenario.gallery import grid_names, names

    return [name for name in [*names(), *grid_names()] if name.startswith(incomplete)]


def scenario_keys(incomplete: str) -> list[str]:
    """Return the key paths that begin with a text, as `balls[1].angle=`; after `=`, the values."""
    from vibro_cli.scenario.fields import json_schema

    path, equals, word = incomplete.partition("=")
    keys = dict(scenario_paths(json_schema()))
    if equals:
        words = keys.get(re.sub(r"\[\d+\]", "[1]", path), [])  # one entry of a list stands for all
        return [f"{path}={choice}" for choice in words if choice.startswith(word)]
    return [f"{_same_entry(key, path)}=" for key in keys if _same_entry(key, path).startswith(path)]


def _same_entry(key: str, typed: str) -> str:
    """Return a key path with the typed numbers in its brackets."""
    numbers = iter(re.findall(r"\[(\d+)\]", typed))
    return re.sub(r"\[1\]", lambda found: f"[{next(numbers, '1')}]", key)


def scenario_paths(schema: dict[str, Any]) -> Iterator[tuple[str, list[str]]]:
    """Yield the key paths of a scenario, `[1]` for any list entry, and the words they accept."""
    from vibro_cli.scenario.fields import keys_of

    for path, node, _ in keys_of(schema):
        if "items" not in node and "$ref" not in node:
            parts = (node, *node.get("anyOf", ()), *node.get("oneOf", ()))
            words = [str(word) for part in parts for word in _words(part)]
            yield path.replace("[i]", "[1]"), words


def _words(node: dict[str, Any]) -> list[Any]:
    return [*node.get("enum", ()), *([node["const"]] if "const" in node else [])]


def beside(folder: Path, ending: str) -> Path:
    """Return the path of a folder with an ending added to its name; `.` and `..` are resolved."""
    if folder.name in ("", ".."):
        folder = Path(os.path.abspath(folder))
    return folder.parent / f"{folder.name}{ending}"


Task = Callable[[], int]
"""A command with its arguments parsed; returns the exit code."""

TableFormat = Literal["csv", "jsonl", "arrow", "parquet"]

scenario_argument = partial(
    typer.Argument,
    metavar="SCENARIO",
    help="Scenario files (TOML, JSON or YAML), or - for standard input.",
    show_default=False,
    autocompletion=scenario_files,
)


output_option = partial(typer.Option, "--output", "-o")
json_option = partial(typer.Option, "--json")
repeatable = partial(typer.Option, default_factory=list, show_default=False)
set_option = partial(repeatable, "--set", metavar="PATH=VALUE", autocompletion=scenario_keys)

Overrides = Annotated[
    list[str],
    set_option(
        help="Override a value in every scenario, e.g. --set 'balls[2].angle=0.3'; repeatable."
    ),
]
Engine = Annotated[
    Literal["compiled", "python"],
    typer.Option(
        envvar="VIBRO_ENGINE",
        help="Run the kernels compiled or interpreted by Python; the results are bit-identical.",
    ),
]
Strict = Annotated[
    bool,
    typer.Option(
        "--strict",
        envvar="VIBRO_STRICT",
        help="Exit with 3 if a run was inadmissible or invalid.",
    ),
]
Width = Annotated[
    Literal["single", "double"],
    typer.Option(help="Width: one journal column (85 mm) or two (170 mm)."),
]
FailFast = Annotated[
    bool,
    typer.Option("--fail-fast", help="Stop at the first scenario that is invalid or fails."),
]


def _choose_least(level: str) -> Callable[[bool], bool]:
    """Return a flag's callback that sets the lowest level of messages to print."""

    def choose(given: bool) -> bool:
        if given:
            configure_messages(least=level)
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
        help="Also report what was not computed, and why.",
        callback=_choose_least("detail"),
    ),
]


LogFormat = Annotated[
    Literal["text", "json"],
    typer.Option(
        envvar="VIBRO_LOG_FORMAT",
        help="Format of messages on standard error: text, or one JSON object per line.",
    ),
]


def with_common_options(command: Callable[..., Task]) -> Callable[..., Task]:
    """Return a command with the options of every command added: `COMMON`."""
    own = inspect.signature(command, eval_str=True)

    @functools.wraps(command, updated=())
    def performed(**given: Any) -> Task:
        if given.get("output") == "":  # such as -o "$FOLDER" with the variable unset
            raise typer.BadParameter("--output: found an empty text, expected a name")
        return command(**{name: given[name] for name in own.parameters})

    parameters = [
        *own.parameters.values(),
        *(
            inspect.Parameter(
                name, inspect.Parameter.KEYWORD_ONLY, default=default, annotation=kind
            )
            for name, (kind, default) in COMMON.items()
        ),
    ]
    performed.__signature__ = own.replace(parameters=parameters)  # type: ignore[attr-defined]
    performed.__annotations__ = {one.name: one.annotation for one in parameters}
    return performed


COMMON: dict[str, tuple[Any, Any]] = {
    "quiet": (Quiet, False),
    "verbose": (Verbose, False),
    "log_format": (LogFormat, "text"),
}
"""Options that every command has: their types and defaults."""
