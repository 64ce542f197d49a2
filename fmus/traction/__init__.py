"""Torsional wheelset with gearbox and motor; equations in README.md."""
