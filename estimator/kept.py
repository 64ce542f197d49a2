"""Results of the last simulations of this process, so that none of them is made twice.

A fit begins where another one ended, and the slopes within the errors of an answer are asked for when its
steps are checked and again for its intervals. Such a simulation was made before with the same values, to the
last bit, and its result is a copy of the first one.
"""

from collections import OrderedDict
from collections.abc import Hashable, Mapping, Sequence
from hashlib import blake2b

import numpy as np

from estimator.record import Array, Run

KEPT = 1 << 26  # bytes of all results kept by a process: a hundred of two variables over 36,000 samples
OF_ALL = 8  # part of them that one result takes at most, since a longer one would drive out the others
KEY = 1 << 10  # bytes that are counted for what a result is found by, beside its own


class Kept:
    """Results (N, n) of named variables by all that they depend on; those not asked for longest go first.

    most: bytes of all results together.
    """

    def __init__(self, most: int = KEPT) -> None:
        self.most, self.size = most, 0
        self._found: OrderedDict[Hashable, tuple[tuple[str, ...], Array]] = OrderedDict()

    def room_for(self, size: int) -> bool:
        """Whether a result of so many bytes is kept; those of a long record are not."""
        return size + KEY <= self.most // OF_ALL

    def room_for_all(self, sizes: Sequence[int]) -> bool:
        """Whether results of so many bytes each are kept until all of them are."""
        return all(map(self.room_for, sizes)) and sum(sizes) + KEY * len(sizes) <= self.most

    def get(self, key: Hashable, names: tuple[str, ...]) -> Array | None:
        """A copy of these variables, since residuals are computed in their place; None if one is not kept."""
        if key not in self._found:
            return None
        there, result = self._found[key]
        if not set(names) <= set(there):
            return None
        self._found.move_to_end(key)
        return np.take(result, [there.index(name) for name in names], axis=1)

    def put(self, key: Hashable, names: tuple[str, ...], result: Array) -> None:
        """Keep a copy of a result, if there is room for one of its size, unless it holds nothing new."""
        there, old = self._found.get(key, ((), None))
        if not self.room_for(result.nbytes) or set(names) <= set(there):
            return
        self.size += result.nbytes + KEY - (0 if old is None else old.nbytes + KEY)
        self._found[key] = names, result.copy()
        self._found.move_to_end(key)
        while self.size > self.most:
            self.size -= self._found.popitem(last=False)[1][1].nbytes + KEY

    def clear(self) -> None:
        """Forget all results."""
        self._found.clear()
        self.size = 0


def bits(values: Mapping[str, float]) -> tuple[tuple[str, ...], bytes]:
    """Names and values such that only the same bits are equal: 0.0 and -0.0 may act differently."""
    return tuple(values), np.array([*values.values()], dtype=float).tobytes()


def digest(run: Run) -> bytes:
    """What stands for the times and inputs of a run; equal only if all their bits are."""
    found = blake2b(repr((run.t.shape, run.u.shape)).encode(), digest_size=32)
    for samples in (run.t, run.u):
        found.update(np.ascontiguousarray(samples, dtype=float).data)
    return found.digest()
