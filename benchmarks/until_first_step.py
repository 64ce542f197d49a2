"""Runs `railfmi` with the given arguments up to the first communication step, and ends the process there.

Run: python -m benchmarks.until_first_step run SCENARIO.toml --out DIR. The exit code REACHED says that an FMU
was about to be stepped.
"""

import os
import sys
from typing import Any

REACHED = 77


def reached(*_: Any) -> None:
    """End the process at once."""
    os._exit(REACHED)


def main() -> None:
    """Replace all calls that step an FMU, and run the command."""
    from fmus.host.fmi2 import Fmi2Instance
    from fmus.host.fmi3 import Fmi3Instance
    from scenarios.cli.app import run_safely

    for kind in (Fmi2Instance, Fmi3Instance):
        for name in ("run", "stepper"):
            setattr(kind, name, reached)
    sys.exit(run_safely(sys.argv[1:]))


if __name__ == "__main__":
    main()
