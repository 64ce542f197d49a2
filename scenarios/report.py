"""Placeholder until the page exists."""

from pathlib import Path

from estimator.closeloop.chain import Outcome
from estimator.closeloop.problem import Problem
from scenarios.result import Result


def write_report(folder: Path, problem: Problem, found: Outcome, result: Result) -> None:
    """Write report.html and the figures into a folder."""
