"""A contact table, beside a script with SciPy's splines on the same profiles."""

import os
from collections.abc import Iterator
from contextlib import contextmanager
from itertools import count

import numpy as np
import pandas as pd

from benchmarks.group import Disagreement, Group, Row, Work
from benchmarks.peers.plain_contact import PlainContact
from benchmarks.timing import in_turns
from estimator.record import Array
from fmus.contact import contact_table
from fmus.contact.geometry.measured import load_profile
from fmus.contact.geometry.pair import Pair

PLAIN = "SciPy: CubicSpline, brentq, minimize_scalar"
REACH, CANT, N = 6e-3, 1 / 40, 55e3  # m, slope, N; within the reach no flange touches
SAME = 1e-6  # rad, of the roll; radii and angles jump where the contact does
CACHE = "XDG_CACHE_HOME"


class ContactGroup(Group):
    """S1002 on 60E1 at 1:40 by the rigid search; kept tables are not used."""

    name = "contact"

    def measure(self, work: Work) -> Iterator[Row]:
        """See Group."""
        shifts, fresh = np.linspace(-REACH, REACH, work.of(201, 11)), count(1)

        def ours(search: str) -> pd.DataFrame:
            # a load that differs in the last digits makes a table that is not in memory
            load = N * (1 + 1e-12 * next(fresh))
            return contact_table("S1002", "60E1", CANT, N=load, search=search, shifts=shifts)

        def plain() -> Array:
            pair = Pair(load_profile("S1002", "wheel"), load_profile("60E1", "rail"), CANT)
            return PlainContact.of(pair).table(shifts)

        with no_kept_tables(work):
            apart = float(np.abs(ours("rigid")["phi"].to_numpy() - plain()[:, 0]).max())
            if not apart <= SAME:
                raise Disagreement(f"contact table, {PLAIN}: rolls differ by {apart:.2g} rad")
            searches = {"rigid": "rigid", "quasi-elastic": "quasi_elastic"}
            runs = {said: (lambda s=search: ours(s)) for said, search in searches.items()}
            times = in_turns({**runs, PLAIN: plain}, work.of(5, 2))
        for said in searches:
            how = (
                f"{len(shifts)} shifts of S1002 on 60E1, {said} search, with curvatures and ellipses; the "
                "peer finds roll, radii and angles of the rigid contact"
            )
            yield times.row(f"contact table, {said}", said, PLAIN, "ms", how, factor=1e3)


@contextmanager
def no_kept_tables(work: Work) -> Iterator[None]:
    """Have tables kept in the folder of the benchmarks instead of the user's."""
    before = os.environ.get(CACHE)
    os.environ[CACHE] = str(work.folder / "cache")
    try:
        yield
    finally:
        os.environ.pop(CACHE)
        if before is not None:
            os.environ[CACHE] = before
