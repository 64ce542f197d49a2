"""Bogie in curves, and what models on bogies share; equations in README.md."""
