"""Scenarios: a question, the FMUs that answer it, and what must come true."""

from scenarios.running.reading import Scenario, load_scenario
from scenarios.running.result import Result
from scenarios.running.run import run, run_all

__all__ = ["Result", "Scenario", "load_scenario", "run", "run_all"]
