"""`python -m scenarios.cli` is the command `railfmi`."""

from scenarios.cli.app import main

main()
