"""The command line: one module for each command."""

import signal
import sys

from fmus.errors import BadInput


def main() -> None:
    """Entry of the console command; an unusable file of RAILFMI_PATH also ends in one error line."""
    if signal.getsignal(signal.SIGINT) is signal.default_int_handler:
        signal.signal(signal.SIGINT, signal.SIG_DFL)  # while modules load, Ctrl-C ends it without a traceback
    try:
        from scenarios.cli.app import main as run
    except BadInput as error:
        print(f"railfmi: {error}", file=sys.stderr)
        sys.exit(2)
    run()


__all__ = ["main"]
