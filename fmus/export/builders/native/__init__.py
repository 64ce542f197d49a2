"""Native FMUs: generated C for a model's equations, hand-written C around it, no Python where they run."""
