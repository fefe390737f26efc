"""Entry point of the program `vibro`; `--version` is answered without importing libraries."""

import contextlib
import gc
import os
import sys

from vibro_cli import __version__, unsupported


def main() -> None:
    """Run the command line of this process, and exit with the command's exit code."""
    if sys.argv[1:] in (["--version"], ["-V"]):
        with contextlib.suppress(OSError):  # it recurs below, where it is reported
            os.write(1, f"vibro {__version__}\n".encode())
            return
    import signal

    reason = unsupported()
    if reason is not None:
        sys.exit(reason)
    # ^C ends the process without a traceback while libraries are loaded, and at its exit.
    if signal.getsignal(signal.SIGINT) is signal.default_int_handler:
        signal.signal(signal.SIGINT, signal.SIG_DFL)
    # Loading libraries creates hundreds of thousands of objects and no garbage: with Python's
    # default threshold, garbage collection takes a tenth of a short run.
    gc.set_threshold(100_000, 20, 50)
    # The search for plug-ins of pydantic takes another twentieth; none is used.
    os.environ.setdefault("PYDANTIC_DISABLE_PLUGINS", "__all__")
    # The threads of numpy's linear algebra, one per core, would spin during loading and make short
    # parallel runs an eighth slower. The matrices here are too small for a second thread.
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    # Arrow's own pool keeps the memory of every column that was read.
    os.environ.setdefault("ARROW_DEFAULT_MEMORY_POOL", "system")
    # Figures are files; an unknown backend in MPLBACKEND would make matplotlib fail.
    os.environ["MPLBACKEND"] = "agg"
    try:
        from vibro_cli.commands.app import run_command_line

        code = run_command_line(sys.argv[1:])
    except KeyboardInterrupt as end:  # while cleaning up
        code = getattr(end, "exit_code", 130)
    gc.freeze()  # garbage collection at exit would take a quarter of a short run
    sys.exit(code)


if __name__ == "__main__":
    main()
