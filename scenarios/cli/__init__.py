"""The command line: one module for each command."""

import sys

from fmus.errors import BadInput


def main() -> None:
    """Entry of the console command; an unusable file of RAILFMI_PATH also ends in one error line."""
    try:
        from scenarios.cli.app import main as run
    except BadInput as error:
        print(f"railfmi: {error}", file=sys.stderr)
        sys.exit(2)
    run()


__all__ = ["main"]
