"""Open an FMU file safely: checked zip, model description, folder of its own that goes with it."""

import shutil
import tempfile
import zipfile
from collections.abc import Callable
from multiprocessing.util import Finalize
from pathlib import Path, PurePosixPath
from types import TracebackType
from typing import Any, Self, TypeVar
from xml.etree import ElementTree

import fmpy
from fmpy.model_description import read_model_description
from fmpy.validation import validate_fmu

from fmus.errors import BadInput
from fmus.host.apart.isolation import Isolation
from fmus.host.apart.room import Room, room_of
from fmus.host.description import FmuDescription
from fmus.host.reduced import reduced
from fmus.taken import check_packed

Made = TypeVar("Made")

FMI_VERSIONS = ("2.0", "3.0")


class Archive:
    """An unpacked FMU; several instances can run from one. BadInput where it cannot be used here.

    isolation: limits of the process of its own in which its instances run; None: they run in this process.
    """

    def __init__(self, path: str | Path, isolation: Isolation | None = None) -> None:
        self.path, self.isolation = Path(path), isolation
        names = _checked_names(self.path)
        self.folder = Path(tempfile.mkdtemp(prefix="railfmi_fmu_"))
        # goes with the object or the process, worker processes included, which skip atexit
        self._delete = Finalize(self, shutil.rmtree, (self.folder, True), exitpriority=0)
        try:
            _unpack(self.path, self.folder)
            self.description = _description(self.path, self.folder)
            _check_platform(self.path, self.description, names)
        except BaseException:
            self.close()
            raise

    @property
    def room(self) -> Room | None:
        """The process in which its instances run, if that is not this one."""
        return None if self.isolation is None else room_of(self.isolation)

    def made(self, kind: Callable[..., Made], *args: Any) -> Made:
        """kind(archive, *args), made where the instances run."""
        return kind(self, *args) if self.room is None else self.room.make(kind, self, *args)

    def called(self, function: Callable[..., Made], *args: Any) -> Made:
        """function(archive, *args), called where the instances run."""
        return function(self, *args) if self.room is None else self.room.call(function, self, *args)

    def close(self) -> None:
        """Delete the folder."""
        self._delete()

    def __reduce__(self) -> tuple[Any, ...]:
        """In another process it stands for the same folder, which stays this one's, and runs there."""
        return _unpacked, (self.path, self.folder, self.description)

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()


def _unpacked(path: Path, folder: Path, description: FmuDescription) -> Archive:
    archive = Archive.__new__(Archive)
    archive.path, archive.folder, archive.description, archive.isolation = path, folder, description, None
    return archive


def describe(path: str | Path) -> FmuDescription:
    """The description of an FMU file."""
    with Archive(path) as archive:
        return archive.description


def problems(path: str | Path) -> list[str]:
    """What the FMI standard objects to in an FMU file's model description; empty where all is well."""
    return [" ".join(str(problem).split()) for problem in validate_fmu(str(path))]


def _checked_names(path: Path) -> list[str]:
    if path.is_dir():
        raise BadInput(f"{path}: is a folder; give the .fmu file that it was unpacked from")
    if not path.is_file():
        raise BadInput(f"{path}: no such FMU file; build one with 'railfmi build' or mend the path")
    try:
        with zipfile.ZipFile(path) as packed:
            check_packed(packed, path)
            names = packed.namelist()
            broken = packed.testzip()
    except BadInput:
        raise
    except Exception as error:  # damage shows as errors of zipfile, zlib, struct, codecs and others
        raise BadInput(f"{path}: not a readable zip file, so no FMU ({error}); get it again") from error
    if broken:
        raise BadInput(f"{path}: '{broken}' in it is damaged; get the FMU again")
    for name in names:
        parts = PurePosixPath(name.replace("\\", "/")).parts
        if ".." in parts or name.startswith(("/", "\\")) or ":" in name:
            raise BadInput(f"{path}: holds the path '{name}', which leads outside; do not use this file")
    if "modelDescription.xml" not in names:
        raise BadInput(f"{path}: has no modelDescription.xml, so it is no FMU; export it again")
    return names


def _unpack(path: Path, folder: Path) -> None:
    try:
        with zipfile.ZipFile(path) as packed:
            packed.extractall(folder)
    except OSError as error:
        raise BadInput(
            f"{path}: cannot be unpacked in {folder} ({error}); mend the file or free space"
        ) from error


def _description(path: Path, folder: Path) -> FmuDescription:
    file = folder / "modelDescription.xml"
    if why := _no_description(file):
        raise BadInput(f"{path}: its modelDescription.xml {why}; export the FMU again")
    try:
        try:
            model = read_model_description(str(folder), validate=False)
        except Exception:
            if not _mended(file):
                raise
            model = read_model_description(str(folder), validate=False)
    except Exception as error:
        said = " ".join(str(error).split())[:200]
        raise BadInput(
            f"{path}: its modelDescription.xml cannot be read ({said}); export the FMU again"
        ) from error
    if model.coSimulation is None and model.modelExchange is None:
        raise BadInput(
            f"{path}: is neither for co-simulation nor for model exchange; export it again for one of them"
        )
    try:
        return reduced(model)
    except ValueError as error:
        raise BadInput(f"{path}: its modelDescription.xml cannot be read ({error})") from error


def _no_description(file: Path) -> str:
    """Why a file is no model description of a version that is read; empty if it is one."""
    try:
        root = ElementTree.parse(file).getroot()
    except ElementTree.ParseError as broken:
        return f"is no XML ({broken})"
    except (ValueError, LookupError):  # an encoding that this parser does not know; that of FMPy may
        return ""
    if root.tag != "fmiModelDescription":
        return f"is none: it holds <{root.tag[:40]}>"
    if not (version := root.get("fmiVersion")):
        return "states no version of FMI"
    if version not in FMI_VERSIONS:
        return f"is FMI {version}; FMI {' and '.join(FMI_VERSIONS)} are read here"
    return ""


def _mended(file: Path) -> bool:
    """Call parameters of an unpacked description fixed that say nothing of their variability.

    Without a word they count as continuous, which no parameter may be; PythonFMU writes them so by default.
    """
    tree = ElementTree.parse(file)
    silent = [
        v
        for v in tree.iter("ScalarVariable")
        if v.get("causality") == "parameter" and v.get("variability") is None
    ]
    for v in silent:
        v.set("variability", "fixed")
    if silent:
        tree.write(file, encoding="UTF-8", xml_declaration=True)
    return bool(silent)


def _check_platform(path: Path, description: FmuDescription, names: list[str]) -> None:
    here = fmpy.platform_tuple if description.fmi_version.startswith("3") else fmpy.platform
    held = sorted({n.split("/")[1] for n in names if n.startswith("binaries/") and n.count("/") >= 2})
    library = f"binaries/{here}/{description.identifier}{fmpy.sharedLibraryExtension}"
    if library not in names:
        has = ", ".join(held) or "none"
        raise BadInput(
            f"{path}: has no binary for this platform ({here}); it holds {has}; export it for this platform"
        )
