"""The command line: one module a command."""

import sys

from fmus.errors import BadInput


def main() -> None:
    """Entry of the console command; a file of RAILFMI_PATH that cannot be used ends with one line too."""
    try:
        from scenarios.cli.app import main as run
    except BadInput as error:
        print(f"railfmi: {error}", file=sys.stderr)
        sys.exit(2)
    run()


__all__ = ["main"]
