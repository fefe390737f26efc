"""Entry of the `vibro` program; what needs no library is answered before any is imported."""

import gc
import sys


def main() -> None:
    """Run the command line of this process and end it with the command's exit code."""
    if sys.argv[1:] in (["--version"], ["-V"]):
        from vibro_cli import __version__

        print(f"vibro {__version__}")
        return
    # Loading libraries makes hundreds of thousands of objects and no garbage: at Python's own
    # threshold, looking for it takes a tenth of a short run.
    gc.set_threshold(50_000, 20, 50)
    try:
        from vibro_cli.commands.app import run_command_line

        code = run_command_line(sys.argv[1:])
    except KeyboardInterrupt:  # before there was anything to interrupt, or while cleaning up
        code = 130
    sys.exit(code)


if __name__ == "__main__":
    main()
