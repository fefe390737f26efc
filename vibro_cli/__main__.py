"""Entry of the `vibro` program; what needs no library is answered before any is imported."""

import contextlib
import gc
import os
import sys

from vibro_cli import __version__, unsupported


def main() -> None:
    """Run the command line of this process and end it with the command's exit code."""
    if sys.argv[1:] in (["--version"], ["-V"]):
        with contextlib.suppress(OSError):  # which comes again below, where it is told
            os.write(1, f"vibro {__version__}\n".encode())
            return
    reason = unsupported()
    if reason is not None:
        sys.exit(reason)
    # Loading libraries makes hundreds of thousands of objects and no garbage: at Python's own
    # threshold, looking for it takes a tenth of a short run.
    gc.set_threshold(100_000, 20, 50)
    # Looking for plug-ins of pydantic, of which none is wanted, takes another twentieth.
    os.environ.setdefault("PYDANTIC_DISABLE_PLUGINS", "__all__")
    # Threads of numpy's linear algebra, one for each core, would spin while the rest is loaded:
    # short runs side by side on all cores take an eighth longer. No matrix here needs a second.
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    # Figures are files: matplotlib would end the program for a backend that it does not know.
    os.environ["MPLBACKEND"] = "agg"
    try:
        from vibro_cli.commands.app import run_command_line

        code = run_command_line(sys.argv[1:])
    except KeyboardInterrupt as end:  # before there was anything to end, or while cleaning up
        code = getattr(end, "exit_code", 130)
    gc.freeze()  # nor is there garbage at the end, where looking for it takes a quarter
    sys.exit(code)


if __name__ == "__main__":
    main()
