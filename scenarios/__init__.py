"""Questions asked of the FMUs: experiments, closing the loop, reports, command line."""

from scenarios.closing import close_loop

__all__ = ["close_loop"]
