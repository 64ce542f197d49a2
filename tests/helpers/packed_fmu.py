"""FMUs compiled from the C files of the tests."""

import subprocess
import zipfile
from pathlib import Path

import fmpy

FOLDER = Path(__file__).parent / "c"


def build_packed(compiler, source, description, path):
    """Compile a C file and pack it with its model description at a path, which is returned.

    The library has the description's identifier as its name.
    """
    identifier = description.partition('modelIdentifier="')[2].partition('"')[0]
    library = path.parent / f"{identifier}{fmpy.sharedLibraryExtension}"
    headers = Path(fmpy.__file__).parent / "c-code"
    strict = [
        "-std=c99",
        "-Wall",
        "-Wextra",
        "-Werror",
        "-O2",
        "-shared",
        "-fPIC",
        "-I",
        headers,
        "-I",
        FOLDER,
    ]
    subprocess.run([compiler, *strict, source, "-o", library, "-lm"], check=True)
    place = fmpy.platform_tuple if 'fmiVersion="3' in description else fmpy.platform
    with zipfile.ZipFile(path, "w") as packed:
        packed.writestr("modelDescription.xml", description)
        packed.write(library, f"binaries/{place}/{library.name}")
    return path
