"""The command `campaign`: a scenario simulated at many points, and what its results depend on."""
