"""Working builds: the numbers of the native build, no derivatives, and libraries kept for the next record."""

import zipfile

import numpy as np
import pytest
from fmpy.fmi1 import FMICallException
from numpy.testing import assert_array_equal

from fmus.errors import BadInput
from fmus.export.builders.native import libraries
from fmus.export.builders.native.libraries import folder
from fmus.export.builders.native.working import build_working
from fmus.host.fmu import Fmu
from fmus.models import MODELS
from tests.helpers.native import description, native
from tests.helpers.runs import heavier, run, stirred
from tests.helpers.sizes import by_size


@pytest.fixture
def empty_cache(monkeypatch, tmp_path):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))


@pytest.fixture
def compiled(monkeypatch, empty_cache):
    """How often the compiler was called."""
    calls = []
    real = libraries.compile_library
    monkeypatch.setattr(libraries, "compile_library", lambda *given: calls.append(given) or real(*given))
    return calls


@by_size
def test_it_computes_what_the_native_build_computes(name, tmp_path):
    model = MODELS[name]()
    rows = stirred(model, np.random.default_rng(1))
    found = []
    for path in (native(name), build_working(model, tmp_path / "model.fmu")):
        with Fmu(path) as fmu:
            fmu.restart()
            found.append(run(fmu, rows))
    assert_array_equal(found[1], found[0])
    assert np.ptp(found[0], axis=0).max() > 0


def test_it_says_that_it_has_no_derivatives_and_refuses_them(tmp_path):
    path = build_working(MODELS["drive"](), tmp_path / "model.fmu")
    for kind in ("CoSimulation", "ModelExchange"):
        assert description(path).find(kind).get("providesDirectionalDerivative") == "false"
        assert description(native("drive")).find(kind).get("providesDirectionalDerivative") == "true"
    with Fmu(path) as fmu, Fmu(native("drive")) as complete:
        for one in (fmu, complete):
            one.restart()
        along = fmu.references(["q_ddot"]), fmu.references(["F"]), [1.0]
        assert complete.instance._slave.getDirectionalDerivative(*along)[0] > 0
        with pytest.raises(FMICallException):
            fmu.instance._slave.getDirectionalDerivative(*along)


def test_the_same_sources_are_compiled_once_to_the_same_bytes(compiled, tmp_path):
    paths = [build_working(MODELS["drive"](), tmp_path / f"{i}.fmu") for i in range(2)]
    assert len(compiled) == 1
    assert paths[0].read_bytes() == paths[1].read_bytes()
    assert len(list(folder().iterdir())) == 1


@pytest.mark.slow
def test_other_sources_and_other_compilers_have_libraries_of_their_own(compiled, monkeypatch, tmp_path):
    build_working(MODELS["drive"](), tmp_path / "1.fmu")
    build_working(heavier(96.0), tmp_path / "2.fmu")
    assert len(compiled) == 2
    real = libraries.version
    monkeypatch.setattr(libraries, "version", lambda name: "0.0" if name == "ziglang" else real(name))
    build_working(heavier(96.0), tmp_path / "3.fmu")
    assert len(compiled) == 3


def _damage(file):
    file.write_bytes(file.read_bytes()[:-1] + b"!")


def _cut_short(file):
    file.write_bytes(file.read_bytes()[:10])


def _open_to_all(file):
    file.chmod(0o666)


def _open_folder(file):
    file.parent.chmod(0o777)


def _swap(file):
    """The library of another model under this one's key."""
    build_working(heavier(96.0), file.parents[3] / "other.fmu")
    other = next(f for f in file.parent.iterdir() if f != file)
    file.write_bytes(other.read_bytes())


@pytest.mark.parametrize("harm", [_damage, _cut_short, _open_to_all, _open_folder, _swap])
@pytest.mark.slow
def test_a_library_that_others_could_have_made_is_compiled_again(harm, compiled, tmp_path):
    first = build_working(MODELS["drive"](), tmp_path / "1.fmu").read_bytes()
    harm(next(folder().iterdir()))
    before = len(compiled)
    assert build_working(MODELS["drive"](), tmp_path / "2.fmu").read_bytes() == first
    assert len(compiled) == before + 1


@pytest.mark.slow
def test_a_cache_that_cannot_be_written_costs_time_only(compiled, monkeypatch, tmp_path):
    (tmp_path / "file").write_text("")
    monkeypatch.setattr(libraries, "folder", lambda: tmp_path / "file" / "libraries")
    assert zipfile.is_zipfile(build_working(MODELS["drive"](), tmp_path / "1.fmu"))
    assert zipfile.is_zipfile(build_working(MODELS["drive"](), tmp_path / "2.fmu"))
    assert len(compiled) == 2


@pytest.mark.slow
def test_the_oldest_library_goes_where_there_are_too_many(compiled, monkeypatch, tmp_path):
    monkeypatch.setattr(libraries, "KEPT", 1)
    build_working(MODELS["drive"](), tmp_path / "1.fmu")
    old = list(folder().iterdir())
    build_working(heavier(96.0), tmp_path / "2.fmu")
    assert len(list(folder().iterdir())) == 1
    assert list(folder().iterdir()) != old


def test_without_a_compiler_nothing_is_written(monkeypatch, tmp_path):
    monkeypatch.setattr("fmus.export.builders.native.compilers.find_spec", lambda name: None)
    with pytest.raises(BadInput, match="pip install ziglang"):
        build_working(MODELS["drive"](), tmp_path / "model.fmu")
    assert list(tmp_path.iterdir()) == []
