"""Access to any FMU as x+ = f(x, u, theta), y = h(x, u, theta), in a way that a probe has found correct."""
