"""The command `bifurcation`: positions of rest and limit cycles of an FMU over one parameter."""
