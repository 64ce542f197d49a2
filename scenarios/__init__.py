"""Work with the FMUs: experiments, estimates, closing the loop, scenarios, reports, command line."""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from scenarios.closing.closing import close_loop
    from scenarios.closing.several import close_loops
    from scenarios.estimating.estimating import estimate
    from scenarios.planning.planning import plan

__all__ = ["close_loop", "close_loops", "estimate", "plan"]

_HOMES = {
    "close_loop": "scenarios.closing.closing",
    "close_loops": "scenarios.closing.several",
    "estimate": "scenarios.estimating.estimating",
    "plan": "scenarios.planning.planning",
}


def __getattr__(name: str) -> Any:
    """Loaded on first use, so that the command line can report an error in a user's file in one line."""
    if name not in _HOMES:
        raise AttributeError(f"module '{__name__}' has no attribute '{name}'")
    return getattr(import_module(_HOMES[name]), name)
