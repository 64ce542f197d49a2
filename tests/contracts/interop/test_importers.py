"""Importers that nobody here wrote run our FMUs and give our trajectory.

The tools of the Python index come with `pip install '.[interop]'`; programs must be on the path. What each of
them gave is kept in results.json and shown in docs/compatibility.md: `python -m tests.contracts.interop`.
"""

import pytest

from tests.contracts.interop.cases import case, difference, expected, runs
from tests.contracts.interop.importer import Failed, importers, run

RUNS = [
    pytest.param(tool, build, kind, id=f"{tool.name}-{build.model}-{build.build}-{build.fmi}-{kind}")
    for tool in importers()
    for build, kind in runs(tool)
]


@pytest.mark.slow
@pytest.mark.parametrize(("tool", "build", "kind"), RUNS)
def test_an_importer_gives_our_trajectory(tool, build, kind, tmp_path):
    if why := tool.missing():
        pytest.skip(why)
    asked = case(tool, build, kind)
    if (build.build, kind, build.fmi) in tool.fails:
        with pytest.raises(Failed):
            run(tool, asked, tmp_path)
        return
    rows = run(tool, asked, tmp_path)
    wanted = expected(build.model, tool.solver if kind == "ME" else "", tool.sets_start)
    off = difference(rows, wanted, tool.resolution)
    print(f"{tool.name} {build.model}: largest difference {off:.1e} of a signal's largest value")
    assert off <= tool.tolerance[kind]
