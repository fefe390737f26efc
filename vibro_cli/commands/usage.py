"""Wrong usage of the command line in the words of this program: found, expected, suggestion."""

import re
from typing import Any

import typer

from vibro_cli.commands.boundary import CommandError
from vibro_cli.commands.suggesting import suggestion

_EXPECTED = {
    "bool_parsing": "true or false (1 or 0)",
    "int_parsing": "a whole number",
    "float_parsing": "a number",
}


def usage_error(error: typer.TyperException) -> CommandError:
    """What is wrong with a command line, on one line."""
    context = getattr(error, "ctx", None)
    help_command = f"{context.command_path if context else 'vibro'} --help"
    return CommandError(f"vibro: {' '.join(_words(error).split())} (see {help_command})")


def _words(error: typer.TyperException) -> str:
    cause = error.__cause__
    if cause is not None and hasattr(cause, "errors"):
        return _refused_value(error, cause.errors()[0])
    possible = getattr(error, "possibilities", None)
    if possible:
        given = str(getattr(error, "option_name", ""))
        return f"No such option: {given}{suggestion(given, possible)}"
    return error.format_message().removeprefix("Invalid value: ")


def _refused_value(error: Any, details: dict[str, Any]) -> str:
    """A value that an option or argument does not take (`details` are pydantic's)."""
    found, message = str(details["input"]), str(details["msg"]).removeprefix("Value error, ")
    expected = _EXPECTED.get(details["type"])
    choices = re.fullmatch(r".* is not one of (.*?)\.?", message, re.DOTALL)
    if choices:
        words = re.findall(r"'([^']*)'", choices[1])
        expected = f"one of {', '.join(words)}{suggestion(found, words)}"
    return f"{_name(error.param)}: found {found!r}, expected {expected or message}"


def _name(parameter: Any) -> str:
    """An option by its name, and by that of the variable that may have given it."""
    if parameter.param_type_name == "argument":
        return str(parameter.metavar or parameter.name.upper())
    variable = f" (or {parameter.envvar})" if isinstance(parameter.envvar, str) else ""
    return f"{parameter.opts[0]}{variable}"
