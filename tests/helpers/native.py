"""Native FMUs built once for a process, and what tests do with their files."""

import shutil
import tempfile
import zipfile
from functools import cache
from multiprocessing.util import Finalize
from pathlib import Path
from xml.etree import ElementTree

import pytest

from fmus.export.builders.native.build import build_native
from fmus.models import MODELS
from tests.helpers.everything import fitting

every_version = pytest.mark.parametrize("fmi", [2, 3])
STRICT = ["-std=c99", "-Wall", "-Wextra", "-pedantic", "-Werror", "-O2", "-ffp-contract=off"]
DEFINED = ["-DFMI2_OVERRIDE_FUNCTION_PREFIX", "-DFMI3_OVERRIDE_FUNCTION_PREFIX"]


@cache
def folder():
    path = Path(tempfile.mkdtemp(prefix="railfmi_native_"))
    Finalize(None, shutil.rmtree, (path, True), exitpriority=0)
    return path


@cache
def native(name, *effects, fmi=2, platforms="host"):
    """The path of that FMU; "all" stands for every effect that fits."""
    chosen = fitting(name) if effects == ("all",) else effects
    place = folder() / f"{name}_{len(effects)}_{fmi}_{platforms}"
    return build_native(MODELS[name](chosen), place, fmi, platforms)


def unpacked(path, target):
    """The folder with an FMU's files."""
    with zipfile.ZipFile(path) as packed:
        packed.extractall(target)
    return target


def description(path):
    """The root of its model description."""
    with zipfile.ZipFile(path) as packed:
        return ElementTree.fromstring(packed.read("modelDescription.xml"))


def compiler():
    """The C compiler of this machine."""
    found = shutil.which("cc")
    if not found:
        pytest.skip("no C compiler 'cc' here")
    return found
