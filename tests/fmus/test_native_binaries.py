"""Libraries and sources of native FMUs: what they need, what they show, how they treat memory."""

import re
import shutil
import struct
import subprocess
import threading
from pathlib import Path

import fmpy
import numpy as np
import pytest
from numpy.testing import assert_array_equal

from fmus.errors import BadInput
from fmus.export.builders.native.build import build_native
from fmus.export.builders.native.compilers import PLATFORMS, chosen, host
from fmus.export.builders.native.universal import universal
from fmus.host.archive import Archive
from fmus.host.fmu import Fmu
from fmus.host.rows import AT_ONCE, NAME
from fmus.models import MODELS
from fmus.variables import (
    Input,
    Output,
    Parameter,
    State,
)
from tests.helpers.native import (
    DEFINED,
    STRICT,
    compiler,
    description,
    every_version,
    native,
    unpacked,
)
from tests.helpers.packed import repacked
from tests.helpers.paths import ROOT
from tests.helpers.runs import run, stirred
from tests.helpers.sizes import by_size

LIFE = ROOT / "tests" / "helpers" / "c" / "native_life.c"
HEADERS = Path(fmpy.__file__).parent / "c-code"
ELF = pytest.mark.skipif(not host().name.endswith("linux"), reason="reads Linux libraries")
LIBC = ("libc.so.6", "libm.so.6")
NEWEST_GLIBC = (2, 17)


def functions(fmi):
    """All functions that the standard's header declares."""
    text = (HEADERS / f"fmi{fmi}Functions.h").read_text()
    return set(re.findall(rf"^#define (fmi{fmi}\w+) +fmi{fmi}FullName", text, re.MULTILINE)) - {
        f"fmi{fmi}FullName"
    }


def library(path, folder, where=None):
    """The unpacked library of an FMU."""
    where = where or host()
    fmi = 2 if description(path).get("fmiVersion") == "2.0" else 3
    root = description(path)
    name = root.get("modelName") + where.suffix
    return unpacked(path, folder) / "binaries" / where.folder(fmi) / name


def readelf(option, path):
    if not shutil.which("readelf"):
        pytest.skip("readelf is not installed")
    done = subprocess.run(["readelf", "-W", option, path], capture_output=True, text=True, check=True)
    return done.stdout


def needs_only_libc_of_old(path):
    needed = re.findall(r"\(NEEDED\).*\[(.*)\]", readelf("-d", path))
    assert set(needed) <= {*LIBC, "ld-linux-aarch64.so.1"}
    versions = re.findall(r"GLIBC_([0-9.]+)", readelf("-V", path))
    assert versions
    assert max(tuple(int(n) for n in v.split(".")) for v in versions) <= NEWEST_GLIBC


def shows_only_the_interface(path, fmi):
    symbols = re.findall(r"(?:GLOBAL|WEAK)\s+DEFAULT\s+\d+ (\w+)$", readelf("--dyn-syms", path), re.MULTILINE)
    assert set(symbols) == {*functions(fmi), NAME, AT_ONCE}


@ELF
@by_size
@every_version
def test_a_linux_library_shows_fmi_and_rows_alone_and_needs_an_old_libc_alone(name, fmi, tmp_path):
    path = library(native(name, fmi=fmi), tmp_path)
    needs_only_libc_of_old(path)
    shows_only_the_interface(path, fmi)
    assert len(functions(fmi)) == {2: 44, 3: 75}[fmi]


@every_version
def test_it_compiles_from_its_own_sources_without_a_warning(fmi, tmp_path):
    """With cc alone, as the page inside says, and gives the numbers of the library inside."""
    folder = unpacked(native("testrig", fmi=fmi), tmp_path / "fmu")
    made = tmp_path / "made.so"
    flags = [*STRICT, *DEFINED, "-fvisibility=hidden", "-fPIC", "-shared"]
    subprocess.run([compiler(), *flags, "sources/fmu.c", "-o", made, "-lm"], cwd=folder, check=True)

    def exchanged(name, data):
        return (name, made.read_bytes()) if name.startswith("binaries/") else (name, data)

    other = repacked(native("testrig", fmi=fmi), tmp_path / "other.fmu", exchanged)
    rows, ends = stirred(MODELS["testrig"](), np.random.default_rng(1)), []
    for path in (native("testrig", fmi=fmi), other):
        with Fmu(path) as fmu:
            fmu.restart(omega_w=12.0, omega_r=9.0)
            ends.append(run(fmu, rows, 0.01))
    assert_array_equal(*ends)


@every_version
def test_a_compiler_of_the_machine_builds_too(fmi, tmp_path):
    path = build_native(MODELS["drive"](), tmp_path, fmi, compiler=compiler())
    rows, ends = stirred(MODELS["drive"](), np.random.default_rng(1)), []
    for one in (path, native("drive", fmi=fmi)):
        with Fmu(one) as fmu:
            fmu.restart()
            ends.append(run(fmu, rows))
    assert_array_equal(*ends)


def compiled_life(name, fmi, folder, *flags, effects=()):
    """A program that lets instances live and die, linked to the sources of an FMU."""
    path = native(name, *effects, fmi=fmi)
    sources = unpacked(path, folder / "fmu") / "sources"
    model, root = MODELS[name](), description(path)
    sizes = {"N_STATES": len(model.of(State)), "FIRST_INPUT": len(model.of(State))}
    sizes["FIRST_OUTPUT"] = len(model.of(State, Input, Parameter))
    sizes["N_VARIABLES"] = sizes["FIRST_OUTPUT"] + len(model.of(Output))
    sizes["FIRST_REFERENCE"] = 1 if fmi == 3 else 0
    facts = [f"-D{k}={v}" for k, v in sizes.items()]
    token = root.get("guid") or root.get("instantiationToken")
    program = folder / "life"
    strict = ["-std=c99", "-Wall", "-Wextra", "-Werror", "-g", "-ffp-contract=off", *DEFINED, *flags]
    about = [*facts, f'-DTOKEN="{token}"', f"-DFMI_VERSION={fmi}", f"-I{sources}"]
    subprocess.run([compiler(), *strict, *about, "-c", LIFE, "-o", folder / "life.o"], check=True)
    both = [folder / "life.o", sources / "fmu.c"]
    subprocess.run([compiler(), *strict, f"-I{sources}", *both, "-o", program, "-lm"], check=True)
    return program


def lived(program, *before):
    done = subprocess.run([*before, program], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    assert re.search(r"refusals heard [1-9]\d*, wrong 0", done.stdout)
    return done.stdout + done.stderr


@by_size
@every_version
def test_address_and_undefined_behaviour_sanitizers_find_nothing(name, fmi, tmp_path):
    flags = ["-O1", "-fsanitize=address,undefined", "-fno-sanitize-recover=all"]
    probe = [compiler(), "-x", "c", "-", "-fsanitize=address,undefined", "-o", tmp_path / "probe"]
    if subprocess.run(probe, input="int main(void) { return 0; }", text=True, capture_output=True).returncode:
        pytest.skip("the C compiler here has no sanitizers")
    assert "ERROR" not in lived(compiled_life(name, fmi, tmp_path, *flags))


@pytest.mark.skipif(shutil.which("valgrind") is None, reason="valgrind is not installed")
@by_size
@every_version
def test_valgrind_finds_nothing_in_a_hundred_instances(name, fmi, tmp_path):
    check = ["valgrind", "--leak-check=full", "--show-leak-kinds=all", "--error-exitcode=9"]
    said = lived(compiled_life(name, fmi, tmp_path, "-O1"), *check)
    assert "ERROR SUMMARY: 0 errors" in said
    assert "All heap blocks were freed" in said


def test_no_memory_is_asked_for_in_a_step(tmp_path):
    """Twice the lives, no more allocations: instances and saved states are all there is."""
    source = unpacked(native("testrig"), tmp_path) / "sources"
    calls = {n: re.findall(r"\b(?:c|m|re)alloc\(", (source / n).read_text()) for n in _own(source)}
    assert {n: len(c) for n, c in calls.items() if c} == {"instance.c": 1, "states.c": 2}


def _own(source):
    return [p.name for p in source.iterdir() if not re.match(r"fmi[23][A-Z]", p.name)]


@by_size
@pytest.mark.parametrize("effects", [(), pytest.param(("all",), marks=pytest.mark.slow)], ids=["bare", "all"])
def test_there_are_no_globals(name, effects, tmp_path):
    """Nothing can be written but what an instance holds: sections of data and of zeros are empty."""
    source = unpacked(native(name, *effects), tmp_path) / "sources" / "fmu.c"
    made = tmp_path / "fmu.o"
    subprocess.run([compiler(), "-std=c99", "-O1", "-c", source, "-o", made], check=True)
    if not host().name.endswith("linux"):
        pytest.skip("reads Linux object files")
    sizes = dict(re.findall(r"\] (\.data|\.bss|\.tdata|\.tbss)\s+\w+\s+\w+ \w+ (\w+)", readelf("-S", made)))
    assert {int(size, 16) for size in sizes.values()} == {0}
    assert ".data" in sizes


def test_two_models_can_be_linked_into_one_program(tmp_path):
    """Without the override, names have the model's prefix, as the standard wants for static linking."""
    objects = []
    for name in ("drive", "testrig"):
        source = unpacked(native(name), tmp_path / name) / "sources" / "fmu.c"
        objects.append(tmp_path / f"{name}.o")
        subprocess.run([compiler(), "-std=c99", "-O1", "-c", source, "-o", objects[-1]], check=True)
    program = """
        extern const char *Drive_fmi2GetVersion(void), *Testrig_fmi2GetVersion(void);
        int main(void) { return Drive_fmi2GetVersion()[0] != '2' || Testrig_fmi2GetVersion()[0] != '2'; }
    """
    made = [compiler(), *objects, "-x", "c", "-", "-lm", "-o", tmp_path / "program"]
    subprocess.run(made, input=program, text=True, check=True)
    assert subprocess.run([tmp_path / "program"], check=False).returncode == 0


@every_version
def test_threads_do_not_disturb_each_other(fmi):
    """Each thread runs an instance of its own through calls that let others run at the same time."""
    model = MODELS["testrig"]()
    rows = [stirred(model, np.random.default_rng(i), 40) for i in range(8)]
    with Archive(native("testrig", fmi=fmi)) as archive:
        alone, together = [], [None] * len(rows)
        for r in rows:
            with Fmu(archive) as fmu:
                fmu.restart(omega_w=9.0, omega_r=9.0)
                alone.append(run(fmu, r, 0.01))

        def work(i):
            with Fmu(archive) as fmu:
                fmu.restart(omega_w=9.0, omega_r=9.0)
                together[i] = run(fmu, rows[i], 0.01)

        threads = [threading.Thread(target=work, args=(i,)) for i in range(len(rows))]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
    assert_array_equal(together, alone)


@every_version
def test_threads_that_start_together_leave_the_working_folder(fmi, tmp_path, monkeypatch):
    """Loading a library goes through its folder, which is one for the whole process."""
    monkeypatch.chdir(tmp_path)
    gate, file = threading.Barrier(8), native("testrig", fmi=fmi)

    def start():
        with Archive(file) as archive:
            gate.wait()
            for _ in range(20):
                Fmu(archive).close()

    threads = [threading.Thread(target=start) for _ in range(8)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert Path.cwd() == tmp_path


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"fmi": 1}, "FMI 1 is not built; 2 and 3 are"),
        ({"platforms": "x86_64-linus"}, "did you mean 'x86_64-linux'"),
        ({"compiler": "no-such-cc"}, "compiler 'no-such-cc' cannot be run"),
        ({"compiler": "false"}, "the compiler failed"),
        ({"compiler": "cc", "platforms": "all"}, "builds for this machine only"),
    ],
)
def test_a_build_that_cannot_be_made_writes_nothing(options, words, tmp_path):
    with pytest.raises(BadInput, match=words) as caught:
        build_native(MODELS["drive"](), tmp_path / "out", **options)
    assert "\n" not in str(caught.value)
    assert not (tmp_path / "out").exists()


def test_a_missing_compiler_is_named(monkeypatch, tmp_path):
    monkeypatch.setattr("fmus.export.builders.native.compilers.find_spec", lambda name: None)
    with pytest.raises(BadInput, match="pip install ziglang"):
        build_native(MODELS["drive"](), tmp_path)
    assert list(tmp_path.iterdir()) == []


def test_an_old_file_stays_where_the_build_fails(tmp_path):
    (tmp_path / "Drive.fmu").write_bytes(b"old")
    with pytest.raises(BadInput):
        build_native(MODELS["drive"](), tmp_path, compiler="false")
    assert [p.read_bytes() for p in tmp_path.iterdir()] == [b"old"]


def test_platforms_by_name():
    assert chosen("all") == list(PLATFORMS.values())
    assert chosen(()) == chosen("host") == chosen(["host", host().name]) == [host()]
    assert [p.folder(2) for p in PLATFORMS.values()] == [
        "linux64",
        "aarch64-linux",
        "win64",
        *["darwin64"] * 2,
    ]


def test_a_universal_binary_holds_its_parts(tmp_path):
    parts = []
    for processor, size in ((0x01000007, 20_000), (0x0100000C, 5_000)):
        parts.append(tmp_path / str(processor))
        parts[-1].write_bytes(struct.pack("<III", 0xFEEDFACF, processor, 3) + bytes([7]) * size)
    whole = universal(parts)
    assert struct.unpack_from(">II", whole) == (0xCAFEBABE, 2)
    for i, part in enumerate(parts):
        processor, _, offset, size, align = struct.unpack_from(">IIIII", whole, 8 + 20 * i)
        assert (processor, offset % 2**align) == (int(part.name), 0)
        assert whole[offset : offset + size] == part.read_bytes()


def least_macos(data: bytes) -> set[tuple[int, int]]:
    """The oldest systems that the slices of a Mach-O library run on, by their LC_BUILD_VERSION."""
    starts = [0]
    if data[:4] == b"\xca\xfe\xba\xbe":
        (slices,) = struct.unpack_from(">I", data, 4)
        starts = [struct.unpack_from(">5I", data, 8 + 20 * i)[2] for i in range(slices)]
    found = set()
    for start in starts:
        commands, at = struct.unpack_from("<I", data, start + 16)[0], start + 32
        for _ in range(commands):
            kind, size = struct.unpack_from("<2I", data, at)
            if kind == 0x32:
                minos = struct.unpack_from("<4I", data, at)[3]
                found.add((minos >> 16, minos >> 8 & 0xFF))
            at += size
    return found


@pytest.mark.slow
@every_version
def test_one_machine_builds_for_all_platforms(fmi, tmp_path):
    """Each library is read by a tool that knows its format, and offers every function."""
    pefile = pytest.importorskip("pefile", reason="pefile is not installed")
    path = native("testrig", fmi=fmi, platforms="all")
    again = build_native(MODELS["testrig"](), tmp_path / "again", fmi, "all")
    assert again.read_bytes() == path.read_bytes()
    for where in PLATFORMS.values():
        one = library(path, tmp_path / "fmu", where)
        if where.suffix == ".so":
            needs_only_libc_of_old(one)
            shows_only_the_interface(one, fmi)
        elif where.suffix == ".dll":
            read = pefile.PE(one)
            assert {s.name.decode() for s in read.DIRECTORY_ENTRY_EXPORT.symbols} == {
                *functions(fmi),
                NAME,
                AT_ONCE,
            }
            needed = {entry.dll.decode().lower() for entry in read.DIRECTORY_ENTRY_IMPORT}
            assert all(n == "kernel32.dll" or n.startswith("api-ms-win-crt-") for n in needed), needed
            assert read.FILE_HEADER.Machine == 0x8664
        else:
            data = one.read_bytes()
            assert all(f"_{f}\0".encode() in data or f.encode() in data for f in functions(fmi))
            assert data[:4] == (b"\xca\xfe\xba\xbe" if fmi == 2 else b"\xcf\xfa\xed\xfe")
            assert least_macos(data) == {(11, 0)}
