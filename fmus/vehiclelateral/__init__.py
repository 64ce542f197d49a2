"""Lateral vehicle: two bogies and a car body in curves; equations in README.md."""
