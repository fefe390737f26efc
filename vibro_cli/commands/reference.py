"""The reference: commands, scenario keys, tables, exit codes, environment; said once, as Markdown.

`vibro help TOPIC` prints it and README.md holds it between markers; a test keeps them equal.
"""

import re
from collections.abc import Callable, Iterator
from functools import partial
from typing import Any

from vibro_cli.commands.boundary import EXIT_CODES

COMMON = ("quiet", "verbose", "log_format")
"""Options that every command has."""

ENVIRONMENT = {
    "VIBRO_ENGINE": "`--engine` of every command that has it",
    "VIBRO_FIGURES": "`0`: as with `--no-figures`",
    "VIBRO_STRICT": "`1`: as with `--strict`",
    "VIBRO_WORKERS": "`--workers` of `vibro grid`",
    "VIBRO_DASK": "`--dask` of `vibro grid`",
    "VIBRO_LOG_FORMAT": "`--log-format` of every command",
    "VIBRO_CACHE_DIR": "where compiled kernels are kept, instead of the platform's cache folder",
    "NO_COLOR": "nothing is coloured, so nothing changes",
}


def commands(program: Any) -> str:
    """Every command and its options, from the program itself (the context of its main command)."""
    every = program.command.commands
    lines = ["| command | what it does |", "|---|---|"]
    for name, command in every.items():
        usage = " ".join(["vibro", name, *_arguments(command)])
        lines.append(f"| `{usage}` | {_cell(command.help)} |")
    common = [option for option in _options(every["help"]) if option.name in COMMON]
    tables = {"Every command": common}
    for name, command in every.items():
        own = [option for option in _options(command) if option.name not in COMMON]
        tables |= {f"`vibro {name}`": own} if own else {}
    for title, options in tables.items():
        lines += ["", f"{title}:", "", "| option | meaning |", "|---|---|"]
        lines += [f"| {_names(option, program)} | {_meaning(option)} |" for option in options]
    return "\n".join(lines) + "\n"


def _arguments(command: Any) -> Iterator[str]:
    for parameter in command.params:
        if parameter.param_type_name == "argument":
            name = parameter.metavar or parameter.name.upper()
            yield f"{name}…" if parameter.nargs == -1 else name


def _options(command: Any) -> Iterator[Any]:
    for parameter in command.params:
        if parameter.param_type_name == "option" and not parameter.hidden:
            yield parameter


def _names(option: Any, program: Any) -> str:
    """The names of an option, with what they take."""
    names = ", ".join(f"`{name}`" for name in (*option.opts, *option.secondary_opts))
    if option.is_flag:
        return names
    takes = option.metavar or option.display_type(program).strip("<>")
    return f"{names} `{_cell(takes)}`"


def _meaning(option: Any) -> str:
    variable = f" [`{option.envvar}`]" if isinstance(option.envvar, str) else ""
    return _cell(option.help) + variable


def _cell(text: str | None) -> str:
    """A text as it stands in a cell of a table, where words in angle brackets would be HTML."""
    line = " ".join((text or "").split()).replace("|", "\\|")
    return re.sub(r"[\w/]*<\w+>", lambda found: f"`{found[0]}`", line)


def scenario(system: str = "trace", below: str = "") -> str:
    """Every key of a system's scenarios, or those below a path, from their JSON Schema."""
    from vibro_cli.scenario.json_schema import json_schema

    schema = json_schema(system)
    lines = ["| key | default | meaning |", "|---|---|---|"]
    for path, node, required in _keys(schema, schema, ""):
        if not path.startswith(below):
            continue
        default = "required" if required else _default(node)
        lines.append(f"| `{path}` | {default} | {_cell(node.get('description'))} |")
    return "\n".join(lines) + "\n"


def _default(node: dict[str, Any]) -> str:
    default = node.get("default")
    if default is None or isinstance(default, dict):
        return ""
    return f"`{str(default).lower() if isinstance(default, bool) else default}`"


def _keys(
    node: dict[str, Any], schema: dict[str, Any], path: str
) -> Iterator[tuple[str, dict[str, Any], bool]]:
    """Key paths with their nodes and whether they are required; `[i]` is any entry of a list."""
    node = _resolved(node, schema)
    for name, child in node.get("properties", {}).items():
        below = f"{path}.{name}" if path else name
        yield below, child, name in node.get("required", ())
        for branch in (child, *child.get("anyOf", ()), *child.get("oneOf", ())):
            inner = _resolved(branch, schema)
            yield from _keys(inner, schema, below)
            if isinstance(inner.get("items"), dict):
                yield from _keys(inner["items"], schema, f"{below}[i]")


def _resolved(node: dict[str, Any], schema: dict[str, Any]) -> dict[str, Any]:
    if "$ref" not in node:
        return node
    found: dict[str, Any] = schema["$defs"][node["$ref"].rpartition("/")[2]]
    return found


def tables() -> str:
    """Every table and its columns."""
    from vibro_cli.storage.schema import as_markdown

    return as_markdown()


def of_system(system: str) -> str:
    """Every key of a system's scenarios, and every column of its tables."""
    from vibro_cli.storage.schema import markdown_of
    from vibro_cli.storage.system_schema import system_reference

    return f"{scenario(system)}\n{markdown_of(system_reference(system))}"


def exit_codes() -> str:
    """What the exit codes mean."""
    rows = [f"| {code} | {text} |" for code, text in EXIT_CODES.items()]
    return "\n".join(["| exit code | meaning |", "|---|---|", *rows]) + "\n"


def environment() -> str:
    """The variables of the environment that are read."""
    rows = [f"| `{name}` | {text} |" for name, text in ENVIRONMENT.items()]
    return "\n".join(["| variable | meaning |", "|---|---|", *rows]) + "\n"


TOPICS: dict[str, tuple[str, Callable[[], str] | None]] = {
    "commands": ("every command and its options", None),
    "scenario": ("the keys of a scenario", scenario),
    "tables": ("the columns of the tables", tables),
    "turning": ("keys of a trace that turns", partial(scenario, below="trace.turning")),
    "table": ('keys and tables of `system = "table"`', partial(of_system, "table")),
    "springs": ('keys and tables of `system = "springs"`', partial(of_system, "springs")),
    "exit-codes": ("what the exit codes mean", exit_codes),
    "environment": ("the variables of the environment that are read", environment),
}
