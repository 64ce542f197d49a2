"""Wear of wheels over mileage: a scenario is run, its wheels wear by T gamma, and run again."""
