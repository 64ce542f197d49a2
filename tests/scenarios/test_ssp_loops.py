"""Packages with loops that exist only because FMUs do not say on what their outputs depend."""

import tomllib
from types import SimpleNamespace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from fmus.errors import BadInput
from fmus.export.ssp import Component, Link, System, write_package
from fmus.host.archive import describe
from scenarios.exchange import import_ssp
from scenarios.exchange.loops import late_links
from scenarios.simulating import run
from tests.helpers.packed import with_description

RING = (Link(("a", "x"), ("b", "u")), Link(("b", "x"), ("a", "u"), gain=-0.5))


def fmu(dependencies):
    """What a description says of an FMU with an input u and an output x."""
    variables = {
        "u": SimpleNamespace(causality="input", initial=None),
        "x": SimpleNamespace(causality="output", initial="calculated"),
    }
    return SimpleNamespace(variables=variables, inputs=["u"], dependencies=dependencies)


SILENT, DIRECT, FREE = fmu({}), fmu({"x": ("u",)}), fmu({"x": ()})


@pytest.mark.parametrize(
    ("a", "b", "late"),
    [
        (SILENT, SILENT, [RING[0]]),  # the first one of the package
        (SILENT, DIRECT, [RING[1]]),  # the one into the FMU that says nothing
        (DIRECT, DIRECT, []),  # a loop that is there
        (SILENT, FREE, []),  # no loop
    ],
)
def test_one_connection_into_an_fmu_that_says_nothing_is_late(a, b, late):
    assert late_links(RING, {"a": a, "b": b}) == late


@given(st.lists(st.tuples(st.integers(0, 5), st.integers(0, 5)), unique_by=lambda pair: pair[1]))
def test_no_loop_is_left_of_fmus_that_say_nothing_and_none_is_cut_that_is_not(pairs):
    links = [Link((f"f{a}", "x"), (f"f{b}", "u")) for a, b in pairs]
    fmus = {f"f{k}": SILENT for k in range(6)}
    late = late_links(links, fmus)
    left = [link for link in links if link not in late]
    assert late_links(left, fmus) == []
    for link in late:
        assert late_links([*left, link], fmus)


def package(path, folder):
    """A ring of twice the same FMU."""
    components = tuple(Component(n, f"resources/{n}.fmu") for n in "ab")
    system = System("ring", components, RING, stop=0.5, step=1e-2)
    return write_package(system, {c.source: path.read_bytes() for c in components}, folder / "ring.ssp")


def test_a_ring_of_fmus_that_say_nothing_is_imported_and_runs(foreign, tmp_path):
    path = foreign(initial="calculated")
    assert not describe(path).dependencies
    said = []
    scenario = import_ssp(package(path, tmp_path), tmp_path / "back", said.append)
    [late] = [w["to"] for w in tomllib.loads(scenario.read_text())["connections"] if w.get("delayed")]
    assert [line for line in said if f"connection to {late} is one step late" in line], said
    assert run(scenario, tmp_path / "out").ok


def test_a_ring_of_fmus_that_state_it_is_refused_by_the_run(foreign, tmp_path):
    silent = foreign(initial="calculated")
    inlet = list(describe(silent).variables).index("u") + 1
    stated = rb'<Outputs><Unknown index="\1" dependencies="%d"/>' % inlet
    path = with_description(
        silent, tmp_path / "stated.fmu", rb'<Outputs>\s*<Unknown index="(\d+)"\s*/>', stated
    )
    assert describe(path).dependencies == {"x": ("u",)}
    scenario = import_ssp(package(path, tmp_path), tmp_path / "back")
    with pytest.raises(BadInput, match="algebraic loop"):
        run(scenario, tmp_path / "out")
