"""Scenarios as SSP 1.0 packages, and packages as scenarios."""

from scenarios.exchange.exporting import export_ssp
from scenarios.exchange.importing import import_ssp

__all__ = ["export_ssp", "import_ssp"]
