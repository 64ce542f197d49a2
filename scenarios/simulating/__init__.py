"""Scenarios: a question, the FMUs that answer it, and what must come true."""

from scenarios.simulating.reading import Scenario, load_scenario
from scenarios.simulating.result import Result
from scenarios.simulating.run import run, run_all

__all__ = ["Result", "Scenario", "load_scenario", "run", "run_all"]
