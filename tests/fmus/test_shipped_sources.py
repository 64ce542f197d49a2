"""The sources in a native FMU, built by others: by FMPy, and by a CMake project of a few lines."""

import shutil
import subprocess
import zipfile

import numpy as np
import pytest
from fmpy.build import build_platform_binary
from numpy.testing import assert_allclose

from fmus.export.builders.native.compilers import host
from fmus.host.fmu import Fmu
from fmus.models import MODELS
from fmus.variables import Output, State
from tests.helpers.everything import near_start
from tests.helpers.native import every_version, native
from tests.helpers.runs import names, run, start_of, stirred
from tests.helpers.sizes import quick_if_smallest

PROJECT = """
cmake_minimum_required(VERSION 3.15)
project(of_an_importer C)
add_library({name} SHARED sources/fmu.c)
target_link_libraries({name} m)
set_target_properties({name} PROPERTIES PREFIX "" C_STANDARD 99 LIBRARY_OUTPUT_DIRECTORY binaries/{place})
"""


def by_fmpy(folder, name, place):
    build = folder / "build"
    build.mkdir()
    build_platform_binary(folder, build_dir=build)
    shutil.rmtree(build)


def by_cmake(folder, name, place):
    (folder / "CMakeLists.txt").write_text(PROJECT.format(name=name, place=place))
    build = folder / "build"
    for call in (["-S", folder, "-B", build, "-DCMAKE_BUILD_TYPE=Release"], ["--build", build]):
        subprocess.run(["cmake", *call], check=True, capture_output=True)
    shutil.copytree(build / "binaries", folder / "binaries")
    shutil.rmtree(build)


@pytest.mark.parametrize("built_by", [by_fmpy, pytest.param(by_cmake, marks=pytest.mark.slow)])
@every_version
@quick_if_smallest
def test_a_library_built_from_the_shipped_sources_is_ours(name, fmi, built_by, tmp_path):
    if not (shutil.which("cmake") and shutil.which("cc")):
        pytest.skip("no CMake and C compiler here")
    model, ours = MODELS[name](), native(name, fmi=fmi)
    folder, theirs = tmp_path / "unpacked", tmp_path / "theirs.fmu"
    with zipfile.ZipFile(ours) as packed:
        packed.extractall(folder)
    shutil.rmtree(folder / "binaries")
    built_by(folder, model.name, host().folder(fmi))
    with zipfile.ZipFile(theirs, "w") as packed:
        for file in folder.rglob("*"):
            packed.write(file, file.relative_to(folder))
    found = []
    for path in (ours, theirs):
        rng = np.random.default_rng(6)
        with Fmu(path) as fmu:
            fmu.restart(**start_of(model, near_start(model, rng)))
            assert fmu.at_once > 1 or path == theirs  # the function for many rows too has no prefix
            found.append(run(fmu, stirred(model, rng)))
    assert found[0].shape[1] >= len(names(model, (State, Output)))
    assert_allclose(found[1], found[0], rtol=1e-9, atol=1e-9 * np.abs(found[0]).max(axis=0).min())
    assert np.ptp(found[0], axis=0).max() > 0
