"""The one place where errors, signals and closed pipes become words and exit codes.

What the exit codes mean is said once, in `EXIT_CODES`: `--help`, `vibro help exit-codes` and
the table in docs/ come from it. Wrong usage is told like everything that is wrong: found, expected,
suggestion.
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
    choose_words,
    drain_standard_output,
    prepare_streams,
    say,
    silence,
)
from vibro_cli.errors import Failure, VibroError, similar

DONE, FAILED, MISUSED, NOT_STRICT = 0, 1, 2, 3
HUNG_UP, INTERRUPTED, TERMINATED = 129, 130, 143

EXIT_CODES = {
    DONE: "done (also when a run ended `inadmissible`: the cause is in the summary)",
    FAILED: "failed: a file could not be written, memory ran out, or a fault of the program",
    MISUSED: "wrong usage or invalid scenario",
    NOT_STRICT: "with `--strict`: done, but some run was inadmissible or invalid",
    HUNG_UP: "hung up (SIGHUP); what was finished is kept",
    INTERRUPTED: "interrupted (SIGINT); what was finished is kept",
    TERMINATED: "terminated (SIGTERM); what was finished is kept",
}

NOTHING_WRITTEN = "nothing was written"


class CommandError(Exception):
    """What the user should know, as one or more lines that can be read alone.

    `problems` says the same of invalid scenarios as plain values (key path, what was found, what
    was expected, file, line and column).
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
    """A signal asked the command to end; unwinds so that partial files are removed."""

    def __init__(self, number: int) -> None:
        super().__init__(number)
        self.number = number
        self.exit_code = 128 + number


def attempt(task: Task) -> int:
    """Run a task and return its exit code; what goes wrong in it is said, and is no exception.

    Signals and a closed pipe still are: they end the program, not one task of several.
    """
    try:
        return task()
    except BrokenPipeError:
        raise
    except CommandError as error:
        say(error.lines, "error", **({"problems": error.problems} if error.problems else {}))
        return error.exit_code
    except OSError as error:
        say(f"vibro: {reason(error)}", "error")
    except VibroError as error:
        first, *others = error.lines
        say([f"vibro: {first}", *others], "error")
        return FAILED if isinstance(error, Failure) else MISUSED
    except Exception as fault:
        end = _signalled(fault)
        if end is not None:
            raise end from None
        lack = _lack(fault)
        say(*((f"vibro: {lack}", "error") if lack else _report_fault(fault)))
    return FAILED


def _lack(fault: Exception) -> str:
    """What the system has no more of, empty for other faults; Python and arrow say it in words."""
    ends = ("failed to map segment from shared object", os.strerror(errno.ENOMEM))
    if isinstance(fault, MemoryError) or (
        isinstance(fault, ImportError) and str(fault).endswith(ends)
    ):
        return "out of memory"
    threads = ("can't start new thread", "Failed to launch worker thread")
    if any(words in str(fault) for words in threads):
        return "no thread can be started: the limit of processes is reached (ulimit -u)"
    return ""


def _signalled(fault: BaseException) -> BaseException | None:
    """The signal that a fault comes from, if it does.

    Python 3.11 wraps one in `__set_name__`, and code in C may raise an error in its place.
    """
    cause = fault.__cause__
    if cause is None:
        return next(iter(_struck), None)
    if isinstance(cause, KeyboardInterrupt):
        return cause
    return _signalled(cause)


def perform(parse: Callable[[], Task], log_format: str) -> int:
    """Do what a whole command line asks and return its exit code, whatever happens in it."""
    choose_words(as_json=log_format == "json", least="info")
    prepare_streams()
    warnings.showwarning = _say_warning
    logging.getLogger("matplotlib").setLevel(logging.ERROR)  # it would say where its cache is
    try:
        return attempt(lambda: _done(parse()))
    except BrokenPipeError:  # whoever read our results has enough of them
        return DONE
    except KeyboardInterrupt as end:
        silence(sys.stdout)  # who does not read any more must not be waited for
        code: int = getattr(end, "exit_code", INTERRUPTED)
        how = EXIT_CODES[code].partition(" (")[0]
        say(f"vibro: {how}; {_left(end)}", "error")
        return code
    finally:
        drain_standard_output()


@contextlib.contextmanager
def upon_signals(handler: Callable[[int, FrameType | None], None]) -> Iterator[None]:
    """Have a handler for signals that end us, but for those that are to be ignored (nohup)."""
    before: dict[signal.Signals, Any] = {}
    try:
        for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
            if signal.getsignal(number) != signal.SIG_IGN:
                before[number] = signal.signal(number, handler)
        yield
    finally:
        for number, earlier in before.items():
            signal.signal(number, earlier)


@contextlib.contextmanager
def leaving(text: str = NOTHING_WRITTEN) -> Iterator[None]:
    """Have it said what is left on the disk when a signal ends the block."""
    try:
        yield
    except KeyboardInterrupt as end:
        end.add_note(text)
        raise


def _left(end: BaseException) -> str:
    """What is left on the disk after a signal; without a word from where it struck, as always."""
    return next(iter(getattr(end, "__notes__", ())), "what was finished is kept")


def check_no_folder(path: Path) -> None:
    """Raise `CommandError` if a folder stands where a file is to be written."""
    if path.is_dir():
        raise CommandError(f"vibro: {path} is a folder; expected a file or nothing")


def reason(error: OSError) -> str:
    """An error of the system on one line, with the file's name where there is one."""
    text = error.strerror or str(error)
    if error.errno == errno.EBADF and not error.filename:
        text = "standard output is closed"
    return " ".join((f"{error.filename}: {text}" if error.filename else text).split())


def _done(task: Task) -> int:
    """The exit code of a task, once everything printed has arrived; of failures, no more words.

    Signals are heard here alone: nothing has to be unwound while the command line is read.
    """
    with upon_signals(terminate), _signals_not_lost():
        code = task()
        try:
            sys.stdout.flush()
        except BrokenPipeError:
            raise
        except OSError:
            if code != FAILED:
                raise
        return code


def terminate(number: int, frame: FrameType | None = None) -> None:
    """Raise what ends the command; the handler of signals."""
    _struck.append(Terminated(number))
    raise _struck[-1]


_SOON = 0.01
_struck: list[Terminated] = []
"""The signals that a command has been asked to end by."""


@contextlib.contextmanager
def _signals_not_lost() -> Iterator[None]:
    """Have a signal come again (after s) that struck where Python drops whatever is raised.

    That is in `__del__` and in other calls back of libraries, most of them short.
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
    """Print a warning as one line, without the line of code it comes from."""
    say(f"vibro: warning: {' '.join(str(message).split())}", "warning")


def _report_fault(fault: Exception) -> tuple[str, str]:
    """Write the traceback of a fault of the program to a file, and name both on one line."""
    import tempfile
    import traceback

    text = " ".join(f"{type(fault).__name__}: {fault}".split())
    try:
        handle, path = tempfile.mkstemp(prefix="vibro-fault-", suffix=".txt")
        with open(handle, "w", encoding="utf-8") as file:
            file.writelines(traceback.format_exception(fault))
    except OSError:
        path = "nowhere: the temporary folder cannot be written"
    return f"vibro: fault of the program, please report it: {text} (traceback: {path})", "error"


def suggestion(word: str, known: Iterable[str]) -> str:
    """` (did you mean 'x'?)` for the known word that is most like it, or an empty text."""
    close = similar(word, known)
    return "" if close is None else f" (did you mean {close!r}?)"


_EXPECTED = {
    "bool_parsing": "true or false (1 or 0)",
    "int_parsing": "a whole number",
    "float_parsing": "a number",
    "greater_than_equal": "a number of at least {ge:g}",
    "less_than_equal": "a number of at most {le:g}",
}
"""What was expected, by the kind of pydantic's error, with the numbers of its context."""


def usage_error(error: typer.TyperException, command: str) -> CommandError:
    """What is wrong with a command line, on one line, and whose help tells more."""
    return CommandError(f"vibro: {' '.join(_words(error).split())} (see {command} --help)")


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
    expected = _EXPECTED.get(details["type"], "").format(**details.get("ctx", {}))
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
