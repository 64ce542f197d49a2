"""railfmi: FMI models for railway dynamics that find out what they lack.

Everything here is loaded on first use, so that `import railfmi` costs nothing.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from fmus.contact import contact_table, creep_forces, equivalent_conicity, hertz, kalker
    from fmus.errors import BadInput
    from fmus.host.fmu import FmuError
    from railfmi.fmu import Fmu
    from scenarios.campaign.campaign import campaign
    from scenarios.closing.closing import close_loop
    from scenarios.closing.several import close_loops
    from scenarios.comparing.comparing import compare
    from scenarios.estimating.estimating import estimate
    from scenarios.experiment.experiment import load_experiment
    from scenarios.fleet.fleet import fleet
    from scenarios.planning.planning import plan
    from scenarios.preparing.initialising import init
    from scenarios.preparing.inspecting import inspect
    from scenarios.preparing.trial import dry_run
    from scenarios.reporting.report import report
    from scenarios.simulating.run import run
    from scenarios.watching.watching import watch

    __version__: str

_HOMES = {
    "BadInput": "fmus.errors",
    "Fmu": "railfmi.fmu",
    "FmuError": "fmus.host.fmu",
    "campaign": "scenarios.campaign.campaign",
    "close_loop": "scenarios.closing.closing",
    "close_loops": "scenarios.closing.several",
    "compare": "scenarios.comparing.comparing",
    "contact_table": "fmus.contact",
    "creep_forces": "fmus.contact",
    "dry_run": "scenarios.preparing.trial",
    "equivalent_conicity": "fmus.contact",
    "estimate": "scenarios.estimating.estimating",
    "fleet": "scenarios.fleet.fleet",
    "hertz": "fmus.contact",
    "init": "scenarios.preparing.initialising",
    "inspect": "scenarios.preparing.inspecting",
    "kalker": "fmus.contact",
    "load_experiment": "scenarios.experiment.experiment",
    "plan": "scenarios.planning.planning",
    "report": "scenarios.reporting.report",
    "run": "scenarios.simulating.run",
    "watch": "scenarios.watching.watching",
}

__all__ = [
    "BadInput", "Fmu", "FmuError", "__version__", "campaign", "close_loop", "close_loops",
    "compare", "contact_table", "creep_forces", "dry_run", "equivalent_conicity", "estimate", "fleet",
    "hertz", "init", "inspect", "kalker", "load_experiment", "plan", "report", "run", "watch",
]  # fmt: skip


def __getattr__(name: str) -> Any:
    """Loaded on first use."""
    if name == "__version__":
        from importlib.metadata import version

        return version("railfmi")
    if name not in _HOMES:
        raise AttributeError(f"module '{__name__}' has no attribute '{name}'")
    return getattr(import_module(_HOMES[name]), name)


def __dir__() -> list[str]:
    return sorted(__all__)
