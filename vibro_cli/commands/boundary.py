"""The one place where errors, signals and closed pipes become words and exit codes.

Exit codes: 0 done; 1 failed; 2 wrong usage or invalid scenario; 3 with --strict, done, but some run
was inadmissible or invalid; 130 and 143 interrupted or terminated, what was finished is kept.
"""

import io
import os
import signal
import sys
import warnings
from types import FrameType
from typing import Any

from vibro_cli.commands.options import Task

DONE, FAILED, MISUSED, NOT_STRICT, INTERRUPTED, TERMINATED = 0, 1, 2, 3, 130, 143


class CommandError(Exception):
    """What the user should know, as one or more lines that can be read alone."""

    def __init__(self, message: str, exit_code: int = MISUSED) -> None:
        super().__init__(message)
        self.exit_code = exit_code


class Terminated(BaseException):
    """The process was asked to end (SIGTERM); unwinds so that partial files are removed."""


def say(text: str) -> None:
    """Print words for a human: standard error."""
    print(text, file=sys.stderr, flush=True)


def perform(task: Task) -> int:
    """Run a task and return its exit code, whatever happens in it."""
    _prepare_outputs()
    signal.signal(signal.SIGTERM, _terminate)
    warnings.showwarning = _say_warning
    try:
        code = task()
        sys.stdout.flush()
        return code
    except BrokenPipeError:  # whoever read our results has enough of them
        _silence_standard_output()
        return DONE
    except KeyboardInterrupt:
        say("vibro: interrupted; what was finished is kept")
        return INTERRUPTED
    except Terminated:
        say("vibro: terminated; what was finished is kept")
        return TERMINATED
    except CommandError as error:
        say(str(error))
        return error.exit_code
    except OSError as error:
        say(f"vibro: {reason(error)}")
        return FAILED
    except MemoryError:
        say("vibro: out of memory")
        return FAILED
    except Exception as fault:
        say(_report_fault(fault))
        return FAILED


def reason(error: OSError) -> str:
    """An error of the system on one line, with the file's name where there is one."""
    text = error.strerror or str(error)
    return " ".join((f"{error.filename}: {text}" if error.filename else text).split())


def _prepare_outputs() -> None:
    """Let closed outputs take what is printed, and others take letters they cannot encode."""
    if sys.stdout is None:
        sys.stdout = open(os.devnull, "w")  # noqa: SIM115 (kept to the end)
    if sys.stderr is None:
        sys.stderr = open(os.devnull, "w")  # noqa: SIM115 (kept to the end)
    if isinstance(sys.stdout, io.TextIOWrapper):
        sys.stdout.reconfigure(errors="backslashreplace")


def _terminate(number: int, frame: FrameType | None) -> None:
    raise Terminated


def _say_warning(message: Warning | str, *place: Any, **more: Any) -> None:
    """Print a warning as one line, without the line of code it comes from."""
    say(f"vibro: warning: {' '.join(str(message).split())}")


def _silence_standard_output() -> None:
    """Let nothing more, flushed at exit or not, go to a pipe that is closed."""
    nowhere = os.open(os.devnull, os.O_WRONLY)
    os.dup2(nowhere, sys.stdout.fileno())
    os.close(nowhere)


def _report_fault(fault: Exception) -> str:
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
    return f"vibro: fault of the program: {text} (traceback: {path})"
