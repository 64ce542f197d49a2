"""Systems within systems of an SSP package become one level, with their values and connections."""

import zipfile

import pytest

from fmus.errors import BadInput
from fmus.export.ssp import read_package
from fmus.export.ssp.system import NAMESPACES, Link, Start

SPACES = " ".join(f'xmlns:{k}="{v}"' for k, v in NAMESPACES.items() if k in ("ssd", "ssc", "ssv", "ssm"))


def connector(name, kind, unit=None, real="Real"):
    inner = f'<ssc:{real} unit="{unit}"/>' if unit else f"<ssc:{real}/>"
    return f'<ssd:Connector name="{name}" kind="{kind}">{inner}</ssd:Connector>'


def wire(source, target, inner="", more=""):
    """'element.connector', or the connector alone for one of the system."""
    words = []
    for end, text in (("start", source), ("end", target)):
        element, _, name = text.rpartition(".")
        words.append(f'{end}Element="{element}"' if element else "")
        words.append(f'{end}Connector="{name}"')
    return f"<ssd:Connection {' '.join(words)} {more}>{inner}</ssd:Connection>"


def bound(**values):
    """Names hold two underscores for a dot."""
    rows = "".join(
        f'<ssv:Parameter name="{n.replace("__", ".")}"><ssv:Real value="{v}"/></ssv:Parameter>'
        for n, v in values.items()
    )
    inner = (
        f'<ssv:ParameterSet name="s" version="1.0"><ssv:Parameters>{rows}</ssv:Parameters></ssv:ParameterSet>'
    )
    binding = (
        f"<ssd:ParameterBinding><ssd:ParameterValues>{inner}</ssd:ParameterValues></ssd:ParameterBinding>"
    )
    return f"<ssd:ParameterBindings>{binding}</ssd:ParameterBindings>"


def element(kind, name, connectors="", values="", inner="", wires=""):
    source = ' source="resources/a%20b.fmu"' if kind == "Component" else ""
    parts = f"<ssd:Connectors>{connectors}</ssd:Connectors>" if connectors else ""
    parts += values + (f"<ssd:Elements>{inner}</ssd:Elements>" if inner else "")
    parts += f"<ssd:Connections>{wires}</ssd:Connections>" if wires else ""
    return f'<ssd:{kind} name="{name}"{source}>{parts}</ssd:{kind}>'


def fmu(name, values="", unit="m"):
    ends = connector("u", "input", unit) + connector("y", "output", unit) + connector("k", "parameter")
    return element("Component", name, ends, values)


def packed(path, system, version="1.0"):
    text = f'<ssd:SystemStructureDescription {SPACES} version="{version}" name="it">{system}'
    with zipfile.ZipFile(path / "it.ssp", "w") as package:
        package.writestr("SystemStructure.ssd", f"{text}</ssd:SystemStructureDescription>")
        package.writestr("resources/a b.fmu", b"")
    return path / "it.ssp"


def read(path, system, version="1.0"):
    found, _ = read_package(packed(path, system, version))
    return found


def twice(name, first="", second="", unit="m", values=""):
    """A system with one FMU between its connectors, and the changes of a value on the way in and out."""
    ends = connector("in", "input", unit) + connector("out", "output", unit) + connector("k", "parameter")
    wires = wire("in", "f.u", first) + wire("f.y", "out", second) + wire("k", "f.k")
    return element("System", name, ends, values, fmu("f", bound(k=1.0)), wires)


LINE = '<ssc:LinearTransformation factor="{}" offset="{}"/>'


@pytest.mark.parametrize("version", ["1.0", "2.0"])
def test_connections_lead_through_the_connectors_of_systems(tmp_path, version):
    inner = twice("a") + twice("b")
    system = read(tmp_path, element("System", "top", inner=inner, wires=wire("a.out", "b.in")), version)
    assert [c.name for c in system.components] == ["a.f", "b.f"]
    assert {c.source for c in system.components} == {"resources/a b.fmu"}
    assert system.links == (Link(("a.f", "y"), ("b.f", "u"), plain=False),)
    assert any("system.in" in line or "a.in" in line for line in system.ignored)


def test_factors_and_units_on_the_way_are_applied_in_turn(tmp_path):
    """y in m, out in mm: 1000 y; then 2 v + 3 outside; then into m: 2 y + 0.003; then 5 v + 7 inside."""
    inner = twice("a", unit="mm") + twice("b", first=LINE.format(5, 7), unit="mm")
    across = wire("a.out", "b.in", LINE.format(2, 3))
    (link,) = read(tmp_path, element("System", "top", inner=inner, wires=across)).links
    assert link.plain
    assert link.gain == pytest.approx(10.0)
    assert link.offset == pytest.approx(5 * 0.003 + 7)


def test_values_of_systems_reach_the_fmus_and_the_outermost_count(tmp_path):
    inner = twice("a", values=bound(f__u=2.0, k=3.0)) + twice("b", values=bound(k=4.0))
    top = element("System", "top", values=bound(a__f__u=5.0, b__k=6.0, nowhere=1.0), inner=inner)
    system = read(tmp_path, top)
    starts = {c.name: dict(c.start) for c in system.components}
    assert starts == {"a.f": {"u": Start(5.0), "k": Start(3.0)}, "b.f": {"k": Start(6.0)}}
    assert any("'nowhere' of the system belongs to no component" in line for line in system.ignored)


@pytest.mark.parametrize("unit", ["mm", None])
def test_a_value_of_a_connector_is_in_its_unit_and_changed_behind_that(tmp_path, unit):
    """2 m on a connector in mm, or in no unit, then 5 v + 7 in m on the way to the FMU."""
    values = bound(v=2.0).replace('value="2.0"', 'value="2.0" unit="m"')
    inner = fmu("f")
    ends = connector("v", "input", unit)
    wires = wire("v", "f.u", LINE.format(5, 7))
    [f] = read(tmp_path, element("System", "top", ends, values, inner, wires)).components
    assert f.start["u"].within("mm", "") == pytest.approx(5 * 2000 + 7)
    plain = wire("v", "f.u", LINE.format(5, 7), 'suppressUnitConversion="true"')
    [f] = read(tmp_path, element("System", "top", ends, values, inner, plain)).components
    assert f.start["u"].within("mm", "") == pytest.approx(5 * (2000 if unit else 2) + 7)


def test_entries_of_one_dictionary_are_one_place(tmp_path):
    refer = '<ssd:SignalDictionaryReference name="{}" dictionary="bus"/>'.format
    deep = element("System", "s", inner=fmu("g") + refer("r"), wires=wire("r.speed", "g.u"))
    top = element("System", "top", inner=fmu("f") + refer("q") + deep, wires=wire("f.y", "q.speed"))
    text = f"{top}"
    assert read(tmp_path, text, "2.0").links == (Link(("f", "y"), ("s.g", "u"), plain=False),)


def test_a_circle_of_connectors_is_refused(tmp_path):
    round_ = connector("in", "input") + connector("out", "output")
    turn = element("System", "t", round_, inner=fmu("f"), wires=wire("in", "out") + wire("in", "f.u"))
    with pytest.raises(BadInput, match=r"circle.*correct"):
        read(tmp_path, element("System", "top", inner=turn, wires=wire("t.out", "t.in")))


@pytest.mark.parametrize(
    ("system", "words"),
    [
        ("", "has no system"),
        (
            '<ssd:System name="s"><ssd:Elements><ssd:Component name="c"/></ssd:Elements></ssd:System>',
            "no 'source'",
        ),
        (element("System", "s", inner=fmu("f"), wires=wire("f.y", "f.u", LINE.format("two", 0))), "'two'"),
    ],
)
def test_a_bad_package_of_ssp_2_is_one_clear_line(tmp_path, system, words):
    with pytest.raises(BadInput, match=words) as refused:
        read(tmp_path, system, "2.0")
    assert "\n" not in str(refused.value)
