"""Memory stays the same over very many instances and steps, here and in the process of foreign FMUs."""

from pathlib import Path

import numpy as np
import pytest

from fmus.host.apart.isolation import ISOLATED
from fmus.host.archive import Archive
from fmus.host.fmu import Fmu
from tests.helpers.native import native

SIZES = [(2_000, 3), pytest.param(20_000, 10, marks=pytest.mark.slow)]  # instances, and 1e5 steps each
MOST = 4e6  # bytes: what the allocator may keep; 20 000 instances that keep 1 kB each would be 20 MB
PAGE = 4096  # bytes


def taken(process: int | str) -> tuple[int, int]:
    """Bytes of memory, and mappings, of a process."""
    at = Path("/proc") / str(process)
    return int((at / "statm").read_text().split()[1]) * PAGE, len((at / "maps").read_text().splitlines())


@pytest.mark.parametrize(("instances", "simulations"), SIZES)
@pytest.mark.parametrize("isolation", [None, ISOLATED], ids=["here", "apart"])
@pytest.mark.slow
def test_nothing_is_kept_of_instances_and_steps(isolation, instances, simulations):
    t = np.arange(100_001) * 1e-4
    force = {"F": 50 * np.sin(7 * t)}
    with Archive(native("drive"), isolation) as archive:
        process = "self" if archive.room is None else archive.room._process._started.pid
        for k in range(instances):
            with Fmu(archive) as fmu:
                fmu.restart(q=0.1)
            if k == instances // 10:
                before = taken(process)
        after = taken(process)
        assert after[0] - before[0] < MOST
        assert after[1] <= before[1] + 2
        with Fmu(archive) as fmu:
            found = []
            for _ in range(simulations):
                fmu.simulate(t, force, ["q"], {"q": 0.1})
                found.append(taken(process)[0])
        assert found[-1] - found[1] < MOST  # in the first the loop is compiled, and arrays get their place
