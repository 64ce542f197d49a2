"""The command line: one module a command."""

from scenarios.cli.app import main

__all__ = ["main"]
