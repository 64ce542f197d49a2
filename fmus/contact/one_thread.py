"""Linear algebra on one thread, so that its last digits do not depend on the number of threads.

OpenBLAS divides a product or a decomposition among its threads, and its rounding changes with the division.
"""

import ctypes
from collections.abc import Iterator
from contextlib import contextmanager
from importlib.util import find_spec

# modules that are linked with OpenBLAS, and the ending of its names there
LINKED = {"numpy.linalg._umath_linalg": "64_", "scipy.linalg._fblas": ""}


@contextmanager
def one_thread() -> Iterator[None]:
    """Have the OpenBLAS of NumPy and SciPy use one thread meanwhile; any other BLAS is left as it is."""
    found = list(_counts())
    before = [count() for count, _ in found]
    try:
        for _, limit in found:
            limit(1)
        yield
    finally:
        for (_, limit), threads in zip(found, before, strict=True):
            limit(threads)


def _counts() -> Iterator[tuple["ctypes._NamedFuncPointer", "ctypes._NamedFuncPointer"]]:
    """Functions that tell and set the number of threads, of each library that is there."""
    for module, ending in LINKED.items():
        spec = find_spec(module)
        library = ctypes.CDLL(spec.origin) if spec and spec.origin else None
        names = (f"scipy_openblas_{verb}_num_threads{ending}" for verb in ("get", "set"))
        tell, limit = (getattr(library, name, None) for name in names)
        if tell and limit:
            yield tell, limit
