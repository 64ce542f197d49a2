"""Vertical vehicle on two bogies with seven degrees of freedom."""
