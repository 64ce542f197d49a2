"""Figures of a residual that no fit has seen, and of what white noise would leave of them.

The figures depend on the noise only through its means over blocks, its share along the sensitivities of the
calibration, and the length of what is left, which are independent of one another. So these few numbers are
drawn, and not the noise of every sample.
"""

import numpy as np

from estimator.record import Array

SIZE = "size of the residual that no fit has seen"
SLOW = "slow part of the residual that no fit has seen"
UNSEEN = 1e-12  # square of a change by one standard deviation, in units of the noise, below which it is none


def figures_of(left: Array, pieces: int) -> dict[str, float]:
    """Largest mean square of an output of a residual (N, n_y), and that of its means over blocks, in units of
    what white noise leaves.
    """
    ends = _ends(len(left), pieces)
    means = np.add.reduceat(left, ends, axis=0) / np.sqrt(np.diff([*ends, len(left)]))[:, None]
    squares = np.einsum("ij,ij->j", left, left) / len(left)
    return {SIZE: float(np.max(squares)), SLOW: float(np.max(np.mean(means**2, axis=0)))}


def figures_of_noise(
    shape: tuple[int, int], late: Array, root: Array, pieces: int, replicates: int, rng: np.random.Generator
) -> dict[str, Array]:
    """As `figures_of` for each of several draws of white noise after the calibration, (replicates,) each.

    shape: (N, n_y) of the noise; late: (N n_y, n), by which n unknowns change its samples; root: (n, k), by
    which k independent standard normal numbers change the unknowns.
    """
    (n, n_y), k, ends = shape, root.shape[1], _ends(shape[0], pieces)
    sizes = np.diff([*ends, n])
    means, products = np.empty((len(ends), n_y, k)), np.zeros((n_y, k, k))
    for i, (first, size) in enumerate(zip(ends, sizes, strict=True)):
        part = (late[first * n_y : (first + size) * n_y] @ root).reshape(size, n_y, k).swapaxes(0, 1)
        means[i] = part.sum(axis=1) / np.sqrt(size)
        products += part.swapaxes(1, 2) @ part
    by_calibration = rng.standard_normal((replicates, k))
    squares, slow = np.empty((n_y, replicates)), np.empty((n_y, replicates))
    for j in range(n_y):
        values, vectors = np.linalg.eigh(products[j] - means[:, j].T @ means[:, j])
        shown = values > UNSEEN
        along = (vectors[:, shown] * np.sqrt(values[shown])).T  # beside the means
        in_means, beside = (
            np.sum((rng.standard_normal((replicates, len(a))) - by_calibration @ a.T) ** 2, axis=1)
            for a in (means[:, j], along)
        )
        free = n - len(ends) - len(along)
        rest = rng.chisquare(free, replicates) if free > 0 else 0.0
        squares[j], slow[j] = (in_means + beside + rest) / n, in_means / len(ends)
    return {SIZE: np.max(squares, axis=0), SLOW: np.max(slow, axis=0)}


def _ends(samples: int, pieces: int) -> list[int]:
    """First sample of each of the blocks."""
    return [int(b[0]) for b in np.array_split(np.arange(samples), min(pieces, samples))]
