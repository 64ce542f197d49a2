"""Descriptions of FMUs and packages that would have their reader open other files, or grow without end."""

import os
import threading
import zipfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

import pytest

from fmus.errors import BadInput
from fmus.export.ssp.reading import read_package
from fmus.host.archive import describe
from tests.helpers.fuzzing import STRUCTURE
from tests.helpers.misbehaving import Fault, bad_fmu
from tests.helpers.packed import repacked

INCLUDED = '<xi:include xmlns:xi="http://www.w3.org/2001/XInclude" href="file://{pipe}" parse="text"/>'
ATTACKS = {  # what stands before the root, and first in it
    "an external entity": ('<!DOCTYPE a [<!ENTITY e SYSTEM "file://{pipe}">]>', "&e;"),
    "an external document type": ('<!DOCTYPE a SYSTEM "file://{pipe}">', ""),
    "an external parameter entity": ('<!DOCTYPE a [<!ENTITY % p SYSTEM "file://{pipe}"> %p;]>', ""),
    "an inclusion": ("", INCLUDED),
}
LAUGHS = "".join(f'<!ENTITY e{i} "{10 * f"&e{i - 1};"}">' for i in range(1, 10))
GROWING = f'<!DOCTYPE a [<!ENTITY e0 "{100 * "ha "}">{LAUGHS}]>'  # to 300 GB


def attacked(xml: bytes, before: str, inside: str) -> bytes:
    """A description with these texts before its root and first in it."""
    at = xml.index(b"?>") + 2
    begin = xml.index(b">", at) + 1
    return xml[:at] + before.encode() + xml[at:begin] + inside.encode() + xml[begin:]


@contextmanager
def guarded(pipe: Path) -> Iterator[None]:
    """A pipe that nobody may open meanwhile; who does gets one line."""
    os.mkfifo(pipe)
    opened = threading.Event()

    def wait() -> None:
        writer = os.open(pipe, os.O_WRONLY)  # until there is a reader
        opened.set()
        with suppress(BrokenPipeError):
            os.write(writer, b"secret\n")
        os.close(writer)

    thread = threading.Thread(target=wait, daemon=True)
    thread.start()
    try:
        yield
        assert not opened.is_set()
    finally:
        reader = os.open(pipe, os.O_RDONLY | os.O_NONBLOCK)  # until the thread came, however late
        thread.join()
        os.close(reader)


@pytest.fixture
def fmu(tmp_path, tmp_path_factory) -> Callable[[str, str], object]:
    """Reads an FMU with such a description."""
    sound = bad_fmu(tmp_path, Fault("none", "none", ""), tmp_path_factory.mktemp("library"))

    def read(before: str, inside: str) -> object:
        def changed(name: str, data: bytes) -> tuple[str, bytes]:
            return name, attacked(data, before, inside) if name == "modelDescription.xml" else data

        return describe(repacked(sound, tmp_path / "attacked.fmu", changed))

    return read


@pytest.fixture
def package(tmp_path) -> Callable[[str, str], object]:
    """Reads an SSP package with such a structure."""

    def read(before: str, inside: str) -> object:
        with zipfile.ZipFile(tmp_path / "attacked.ssp", "w") as packed:
            packed.writestr("SystemStructure.ssd", attacked(STRUCTURE, before, inside))
            packed.writestr("resources/a.fmu", b"")
        return read_package(tmp_path / "attacked.ssp")

    return read


@pytest.mark.parametrize("kind", ["fmu", "package"])
def test_the_changed_descriptions_are_read(kind, request):
    """Without an attack: so that the others are not refused for another reason."""
    assert request.getfixturevalue(kind)("", "")


@pytest.mark.parametrize("attack", ATTACKS)
@pytest.mark.parametrize("kind", ["fmu", "package"])
def test_no_other_file_is_opened(kind, attack, request, tmp_path):
    before, inside = (text.replace("{pipe}", str(tmp_path / "pipe")) for text in ATTACKS[attack])
    with guarded(tmp_path / "pipe"), suppress(BadInput):
        request.getfixturevalue(kind)(before, inside)


@pytest.mark.parametrize("kind", ["fmu", "package"])
def test_entities_that_grow_are_refused(kind, request):
    read = request.getfixturevalue(kind)
    with pytest.raises(BadInput, match=r"(?i)entit") as refused:
        read(GROWING, '<Tool name="&e9;"/>')
    assert len(str(refused.value).splitlines()) == 1
