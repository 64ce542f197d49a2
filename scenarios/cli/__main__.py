"""`python -m scenarios.cli` is the command `railfmi`."""

from scenarios.cli import main

main()
