"""Access to any FMU as x+ = f(x, u, theta), y = h(x, u, theta), by what a probe found to be honest."""
