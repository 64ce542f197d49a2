"""Closing the loop on public measured benchmarks, each with a base FMU that lacks the effect."""
