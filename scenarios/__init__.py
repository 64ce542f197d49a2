"""Questions asked of the FMUs: experiments, estimates, closing the loop, scenarios, reports, command line."""

from scenarios.closing.closing import close_loop
from scenarios.closing.several import close_loops
from scenarios.estimating.estimating import estimate

__all__ = ["close_loop", "close_loops", "estimate"]
