"""The one place where errors, signals and closed pipes become messages and exit codes.

`EXIT_CODES` defines the meanings of the exit codes for `vibro help exit-codes` and docs/. Messages
on wrong usage have the same form as all others: found, expected, suggestion.
"""

import contextlib
import errno
import logging
import os
import re
import signal
import sys
import warnings
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from types import FrameType
from typing import Any

import typer

from vibro_cli.commands.shared.options import Task
from vibro_cli.commands.shared.terminal import (
    configure_messages,
    drain_standard_output,
    prepare_streams,
    say,
    silence,
)
from vibro_cli.errors import Failure, VibroError, exhausted, similar

DONE, FAILED, MISUSED, NOT_STRICT = 0, 1, 2, 3
HUNG_UP, INTERRUPTED, TERMINATED = 129, 130, 143

EXIT_CODES = {
    DONE: "done (also when a run ended `inadmissible`: the cause is in the summary)",
    FAILED: "failed: a file could not be written, memory ran out, or an internal error",
    MISUSED: "wrong usage or invalid scenario",
    NOT_STRICT: "with `--strict`: done, but a run was inadmissible or invalid",
    HUNG_UP: "hung up (SIGHUP); finished results are kept",
    INTERRUPTED: "interrupted (SIGINT); finished results are kept",
    TERMINATED: "terminated (SIGTERM); finished results are kept",
}


class CommandError(Exception):
    """An error message for the user, of one or more self-contained lines.

    `problems` lists the problems of invalid scenarios as plain values (key path, value found,
    value expected, file, line and column).
    """

    def __init__(
        self,
        message: str | Sequence[str],
        exit_code: int = MISUSED,
        problems: Sequence[Mapping[str, Any]] = (),
    ) -> None:
        self.lines = [message] if isinstance(message, str) else list(message)
        super().__init__("\n".join(self.lines))
        self.exit_code = exit_code
        self.problems = tuple(problems)


class Terminated(KeyboardInterrupt):
    """Raised by a signal; unwinding removes partial files."""

    def __init__(self, number: int) -> None:
        super().__init__(number)
        self.number = number
        self.exit_code = 128 + number


def attempt(task: Task) -> int:
    """Run a task and return its exit code; print its errors instead of raising them.

    Signals and a closed pipe are still raised: they end the program, not one task of several.
    """
    try:
        return task()
    except BrokenPipeError:
        raise
    except CommandError as error:
        say(error.lines, "error", **({"problems": error.problems} if error.problems else {}))
        return error.exit_code
    except OSError as error:
        say(f"vibro: {exhausted(error) or reason(error)}", "error")
    except VibroError as error:
        first, *others = error.lines
        say([f"vibro: {first}", *others], "error")
        return FAILED if isinstance(error, Failure) else MISUSED
    except Exception as fault:
        end = _signalled(fault)
        if end is not None:
            raise end from None
        lack = exhausted(fault)
        say(*((f"vibro: {lack}", "error") if lack else _report_fault(fault)))
    return FAILED


def _signalled(fault: BaseException) -> BaseException | None:
    """Return the signal that caused a fault, or None.

    Python 3.11 wraps exceptions of `__set_name__`, and C code may replace them by its own.
    """
    cause = fault.__cause__
    if cause is None:
        return next(iter(_struck), None)
    if isinstance(cause, KeyboardInterrupt):
        return cause
    return _signalled(cause)


def perform(parse: Callable[[], Task], log_format: str) -> int:
    """Run a whole command line and return its exit code, whatever happens."""
    configure_messages(as_json=log_format == "json", least="info")
    prepare_streams()
    warnings.showwarning = _say_warning
    logging.getLogger("matplotlib").setLevel(logging.ERROR)  # hides where its cache is
    before = _placed()
    try:
        return attempt(lambda: _done(parse))
    except BrokenPipeError:  # the reader has closed the pipe
        return DONE
    except KeyboardInterrupt as end:
        silence(sys.stdout)  # do not wait for a reader that no longer reads
        code: int = getattr(end, "exit_code", INTERRUPTED)
        how = EXIT_CODES[code].partition(" (")[0]
        kept = "nothing was written" if _placed() == before else "finished results are kept"
        left = next(iter(getattr(end, "__notes__", ())), kept)
        say(f"vibro: {how}; {left}", "error")
        return code
    finally:
        drain_standard_output()


def _placed() -> int:
    """Return the number of files and folders that this process has put in their places."""
    files = sys.modules.get("vibro_cli.storage.files")  # not imported by all commands
    return 0 if files is None else int(files.placed)


@contextlib.contextmanager
def upon_signals(
    handler: Callable[[int, FrameType | None], None],
    numbers: Sequence[signal.Signals] = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP),
) -> Iterator[None]:
    """Handle signals that end the program in the block, except ignored ones (nohup)."""
    before: dict[signal.Signals, Any] = {}
    try:
        for number in numbers:
            if signal.getsignal(number) != signal.SIG_IGN:
                before[number] = signal.signal(number, handler)
        yield
    finally:
        for number, earlier in before.items():
            signal.signal(number, earlier)


def check_no_folder(path: Path) -> None:
    """Raise `CommandError` if the path of an output file is a folder."""
    if path.is_dir():
        raise CommandError(f"vibro: {path} is a folder; expected a file name")


def check_place(path: Path) -> None:
    """Raise what writing an output file would raise if it is a folder or has no folder to be in.

    Raises `CommandError` or `OSError`; called before long work, which would be lost.
    """
    check_no_folder(path)
    if not path.parent.is_dir():
        code = errno.ENOTDIR if path.parent.exists() else errno.ENOENT
        raise OSError(code, os.strerror(code), str(path))


def reason(error: OSError) -> str:
    """Return an operating-system error on one line, with the file's name if it has one."""
    text = error.strerror or str(error)
    if error.errno == errno.EBADF and not error.filename:
        text = "standard output is closed"
    is_absolute = os.path.isabs(error.filename or "")
    if error.errno == errno.ENOENT and not is_absolute and _is_nowhere():
        text = f"the working directory was removed or replaced; {_ENTER}"
    return " ".join((f"{error.filename}: {text}" if error.filename else text).split())


_ENTER = 'enter it again: cd "$PWD"'
"""A command changes its own working directory, not that of the shell."""


def _is_nowhere() -> bool:
    """Return whether the working directory no longer exists."""
    try:
        os.getcwd()
    except FileNotFoundError:
        return True
    return False


def _working_directory() -> int | None:
    """Return the number of the working directory, None if it may not be entered."""
    try:
        return os.stat(os.curdir).st_ino
    except PermissionError:  # as after a change of the user
        return None


def _done(parse: Callable[[], Task]) -> int:
    """Parse a command line, run its task, flush standard output and return the exit code.

    An error of flushing is not raised after a failure. Other signals than ^C end the process while
    it parses, which leaves nothing to unwind.
    """
    with upon_signals(terminate, (signal.SIGINT,)), _signals_not_lost():
        task = parse()
        if _struck:  # Typer returns an exit code in place of the task
            raise _struck[0]
    with upon_signals(terminate), _signals_not_lost():
        before = _working_directory()
        code = task()
        if _working_directory() != before:  # replaced by a folder of results, as with `-o .`
            say(f"vibro: the working directory is a new folder; {_ENTER}", "warning")
        try:
            sys.stdout.flush()
        except BrokenPipeError:
            raise
        except OSError:
            if code != FAILED:
                raise
        return code


def terminate(number: int, frame: FrameType | None = None) -> None:
    """Handle a signal: raise the exception that ends the command."""
    _struck.append(Terminated(number))
    raise _struck[-1]


_SOON = 0.01
_struck: list[Terminated] = []
"""Signals that the command has received."""


@contextlib.contextmanager
def _signals_not_lost() -> Iterator[None]:
    """Repeat (after `_SOON` s) a signal that struck where Python drops exceptions.

    That is in `__del__` and in other callbacks of libraries, most of them short.
    """
    _struck.clear()
    dropped = sys.unraisablehook

    def come_again(unraisable: Any) -> None:
        end = unraisable.exc_value
        if not isinstance(end, Terminated):
            dropped(unraisable)
            return
        signal.signal(signal.SIGALRM, lambda *_: terminate(end.number))
        signal.setitimer(signal.ITIMER_REAL, _SOON)

    sys.unraisablehook = come_again
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        sys.unraisablehook = dropped


def _say_warning(message: Warning | str, *place: Any, **more: Any) -> None:
    """Print a warning on one line, without its place in the code."""
    say(f"vibro: warning: {' '.join(str(message).split())}", "warning")


def _report_fault(fault: Exception) -> tuple[str, str]:
    """Write the traceback of an internal fault to a file; return a message that names both."""
    import tempfile
    import traceback

    text = " ".join(f"{type(fault).__name__}: {fault}".split())
    try:
        lines = traceback.format_exception(fault)
        handle, path = tempfile.mkstemp(prefix="vibro-fault-", suffix=".txt")
        with open(handle, "w", encoding="utf-8") as file:
            file.writelines(lines)
    except MemoryError:  # the fault's own cause, too
        return "vibro: out of memory", "error"
    except OSError:
        path = "not saved, as the temporary folder cannot be written"
    return f"vibro: internal error, please report it: {text} (traceback: {path})", "error"


def suggestion(word: str, known: Iterable[str]) -> str:
    """Return ` (did you mean 'x'?)` with the most similar known word, or an empty text."""
    close = similar(word, known)
    return "" if close is None else f" (did you mean {close!r}?)"


_EXPECTED = {
    "bool_parsing": "true or false (1 or 0)",
    "int_parsing": "a whole number",
    "float_parsing": "a number",
    "greater_than_equal": "a number of at least {ge:g}",
    "less_than_equal": "a number of at most {le:g}",
}
"""Texts for the expected value, by pydantic's error type; the numbers are from its context."""


def usage_error(error: typer.TyperException, command: str) -> CommandError:
    """Return an error on wrong usage, on one line, that refers to the help of the command."""
    is_option = str(getattr(error, "option_name", "")).startswith("-")
    placed = "options follow a command; " if command == "vibro" and is_option else ""
    words = " ".join(_words(error).split())
    return CommandError(f"vibro: {words} ({placed}see {command} --help)")


def _is_of_a_command(option: str, error: Any) -> bool:
    """Return whether an option before the command is one of some command, thus not mistyped."""
    commands = getattr(error.ctx.command, "commands", {}).values()
    return any(option in parameter.opts for one in commands for parameter in one.params)


def _words(error: typer.TyperException) -> str:
    cause = error.__cause__
    if cause is not None and hasattr(cause, "errors"):
        return _refused_value(error, cause.errors()[0])
    possible = getattr(error, "possibilities", None)
    if possible:
        given = str(getattr(error, "option_name", ""))
        meant = "" if _is_of_a_command(given, error) else suggestion(given, possible)
        return f"No such option: {given}{meant}"
    return error.format_message().removeprefix("Invalid value: ")


def _refused_value(error: Any, details: dict[str, Any]) -> str:
    """Return the message for an invalid value of an option or argument (`details` of pydantic)."""
    found, message = str(details["input"]), str(details["msg"]).removeprefix("Value error, ")
    expected = _EXPECTED.get(details["type"], "").format(**details.get("ctx", {}))
    choices = re.fullmatch(r".* is not one of (.*?)\.?", message, re.DOTALL)
    if choices:
        words = re.findall(r"'([^']*)'", choices[1])
        expected = f"one of {', '.join(words)}{suggestion(found, words)}"
    return f"{_name(error.param)}: found {found!r}, expected {expected or message}"


def _name(parameter: Any) -> str:
    """Return the name of a parameter, with its environment variable if it has one."""
    if parameter.param_type_name == "argument":
        return str(parameter.metavar or parameter.name.upper())
    variable = f" (or {parameter.envvar})" if isinstance(parameter.envvar, str) else ""
    return f"{parameter.opts[0]}{variable}"
