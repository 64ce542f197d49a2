"""Processes that joblib starts for a search end with the one that started them, also if it is killed."""

import os
from collections.abc import Iterator
from contextlib import contextmanager

from joblib import parallel_config

from fmus.processes import end_after


@contextmanager
def workers_end_too() -> Iterator[None]:
    """Workers that are started within it end with this process."""
    with parallel_config("loky", initializer=end_after, initargs=(os.getpid(),)):
        yield
