"""Benchmarks, run by hand: computing times, measured records and the blind challenge."""
