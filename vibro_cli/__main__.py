"""Entry of the `vibro` program; what needs no library is answered before any is imported."""

import sys


def main() -> None:
    """Run the command line of this process and end it with the command's exit code."""
    if sys.argv[1:] in (["--version"], ["-V"]):
        from vibro_cli import __version__

        print(f"vibro {__version__}")
        return
    from vibro_cli.commands.app import run_command_line

    sys.exit(run_command_line(sys.argv[1:]))


if __name__ == "__main__":
    main()
