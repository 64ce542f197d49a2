"""Flows of systems whose limit cycles are known, exact or by Runge-Kutta steps of many states at once."""

import numpy as np


class Known:
    """x' = f(x, p) for states (k, n) and parameters (k,); the output is the first state.

    size: of the states; the first cycle has a hundredth of it.
    """

    def __init__(self, f, n, size=1.0):
        self.f, self.nominal = f, np.full(n, size)

    def ends(self, x, p, duration, steps):
        for _ in range(steps):
            x = self._ahead(x, p, duration / steps)
        return x

    def path(self, x, p, duration, steps):
        states = [x[None]]
        for _ in range(steps):
            states.append(self._ahead(states[-1], np.array([p]), duration / steps))
        states = np.concatenate(states)
        return states, states[:, 0]

    def _ahead(self, x, p, h):
        k1 = self.f(x, p)
        k2 = self.f(x + h / 2 * k1, p)
        k3 = self.f(x + h / 2 * k2, p)
        return x + h / 6 * (k1 + 2 * k2 + 2 * k3 + self.f(x + h * k3, p))


class Subcritical:
    """Normal form r' = r (p + r^2), angle' = 2 + r^2/2, solved: its cycle r^2 = -p is unstable everywhere."""

    nominal = np.full(2, 1.0)

    def ends(self, x, p, duration, steps):
        z = x[:, 0] + 1j * x[:, 1]
        square = np.abs(z) ** 2
        p = np.where(p == 0, 1e-300, p)
        grown = np.expm1(2 * p * duration)  # of the Bernoulli equation for the square
        ratio = (1 + grown) / (1 - square * grown / p)
        ratio = np.where(ratio > 0, ratio, np.nan)  # it has left for infinity before
        angle = 2 * duration + (np.log(ratio) / 2 - p * duration) / 2
        z = z * np.sqrt(ratio) * np.exp(1j * np.nan_to_num(angle))
        return np.column_stack([z.real, z.imag])

    def path(self, x, p, duration, steps):
        t = np.linspace(0, duration, steps + 1)
        states = self.ends(np.tile(x, (steps + 1, 1)), np.full(steps + 1, p), t, 1)
        return states, states[:, 0]


def turning(x, g, w):
    """x' = g x1 - w x2, w x1 + g x2."""
    return np.stack([g * x[:, 0] - w * x[:, 1], w * x[:, 0] + g * x[:, 1]], axis=1)


def folded(x, p):
    """Normal form with a fold: amplitude p = -2 a^2 + a^4, angular frequency 2 + a^2/2."""
    square = np.einsum("ij,ij->i", x, x)
    return turning(x, p + square * (2 - square), 2 + square / 2)


def van_der_pol(x, p):
    """x'' = (p - x^2) x' - x; at p = 1 the oscillator with mu = 1."""
    return np.stack([x[:, 1], (p - x[:, 0] ** 2) * x[:, 1] - x[:, 0]], axis=1)


def kinked(x, p):
    """Damping of another size for motions than for their direction: |x| in place of a product with x1."""
    size = np.sqrt(np.einsum("ij,ij->i", x, x) + 1e-30)
    return turning(x, p - 0.2 * np.abs(x[:, 0]) / size - size**2, np.full(len(x), 2.0))
