"""The one place where errors, signals and closed pipes become words and exit codes.

What the exit codes mean is said once, in `EXIT_CODES`: `--help`, `vibro help exit-codes` and
README's table come from it.
"""

import contextlib
import io
import json
import os
import signal
import sys
import warnings
from collections.abc import Mapping, Sequence
from types import FrameType
from typing import Any, TextIO

from vibro_cli.commands.options import Task

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

LEVELS = ("detail", "info", "warning", "error")
"""How much words matter: details are said with -v only, errors even with -q."""

_words: dict[str, Any] = {"as_json": False, "least": "info"}


class CommandError(Exception):
    """What the user should know, as one or more lines that can be read alone.

    `problems` says the same of invalid scenarios as plain values (key path, what was found, what
    was expected, file, line and column).
    """

    def __init__(
        self,
        message: str,
        exit_code: int = MISUSED,
        problems: Sequence[Mapping[str, Any]] = (),
    ) -> None:
        super().__init__(message)
        self.exit_code = exit_code
        self.problems = tuple(problems)


class Terminated(BaseException):
    """The process was asked to end (SIGTERM, SIGHUP); unwinds so that partial files are removed."""

    def __init__(self, number: int) -> None:
        super().__init__(number)
        self.exit_code = 128 + number


def choose_words(as_json: bool | None = None, least: str | None = None) -> None:
    """Choose how words are said, as text or as JSON lines, and the least level that is said."""
    if as_json is not None:
        _words["as_json"] = as_json
    if least is not None:
        _words["least"] = least


def say(text: str, level: str = "info", **details: Any) -> None:
    """Print words for a human to standard error; as JSON an object on a line, with the details."""
    if LEVELS.index(level) < LEVELS.index(_words["least"]):
        return
    if _words["as_json"]:
        text = json.dumps({"level": level, "message": text, **details}, ensure_ascii=False)
    try:
        print(text, file=sys.stderr, flush=True)
    except OSError:  # closed or full: nobody can be told, and the exit code still says it
        _silence(sys.stderr)


def attempt(task: Task) -> int:
    """Run a task and return its exit code; what goes wrong in it is said, and is no exception.

    Signals and a closed pipe still are: they end the program, not one task of several.
    """
    try:
        return task()
    except BrokenPipeError:
        raise
    except CommandError as error:
        say(str(error), "error", **({"problems": error.problems} if error.problems else {}))
        return error.exit_code
    except OSError as error:
        say(f"vibro: {reason(error)}", "error")
    except MemoryError:
        say("vibro: out of memory", "error")
    except Exception as fault:
        say(*_report_fault(fault))
    return FAILED


def perform(task: Task, log_format: str = "text") -> int:
    """Run the task of a whole command line and return its exit code, whatever happens in it."""
    choose_words(as_json=log_format == "json", least="info")
    _prepare_outputs()
    for name in ("SIGTERM", "SIGHUP"):
        _watch(getattr(signal, name, None))
    warnings.showwarning = _say_warning
    try:
        return attempt(lambda: _flushed(task()))
    except BrokenPipeError:  # whoever read our results has enough of them
        return DONE
    except KeyboardInterrupt:
        say("vibro: interrupted; what was finished is kept", "error")
        return INTERRUPTED
    except Terminated as end:
        how = "hung up" if end.exit_code == HUNG_UP else "terminated"
        say(f"vibro: {how}; what was finished is kept", "error")
        return end.exit_code
    finally:
        _drain_standard_output()


def reason(error: OSError) -> str:
    """An error of the system on one line, with the file's name where there is one."""
    text = error.strerror or str(error)
    return " ".join((f"{error.filename}: {text}" if error.filename else text).split())


def _flushed(code: int) -> int:
    """The exit code, once everything printed has arrived."""
    sys.stdout.flush()
    return code


def _drain_standard_output() -> None:
    """Leave nothing for Python to write, and to complain about, at exit."""
    try:
        sys.stdout.flush()
    except (OSError, ValueError):
        _silence(sys.stdout)


def _silence(stream: TextIO) -> None:
    """Let nothing more, flushed at exit or not, go to an output that takes nothing."""
    with contextlib.suppress(OSError, ValueError):
        nowhere = os.open(os.devnull, os.O_WRONLY)
        os.dup2(nowhere, stream.fileno())
        os.close(nowhere)


def _watch(number: signal.Signals | None) -> None:
    """Unwind at a signal, unless whoever started us wants it ignored (nohup)."""
    if number is not None and signal.getsignal(number) != signal.SIG_IGN:
        signal.signal(number, _terminate)


def _prepare_outputs() -> None:
    """Let closed outputs take what is printed, and others take letters they cannot encode."""
    if sys.stdout is None:
        sys.stdout = open(os.devnull, "w")  # noqa: SIM115 (kept to the end)
    if sys.stderr is None:
        sys.stderr = open(os.devnull, "w")  # noqa: SIM115 (kept to the end)
    if isinstance(sys.stdout, io.TextIOWrapper):
        sys.stdout.reconfigure(errors="backslashreplace")


def _terminate(number: int, frame: FrameType | None) -> None:
    raise Terminated(number)


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
