"""Torsional tram-wheel test rig with two motors."""
