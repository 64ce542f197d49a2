"""`python -m railfmi` is the command `railfmi`."""

from scenarios.cli import main

main()
