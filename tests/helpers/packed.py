"""Changed copies of FMU files."""

import re
import zipfile


def repacked(source, target, change=lambda name, data: (name, data)):
    """A copy of a zip with each file's name and data changed; None leaves it out."""
    with zipfile.ZipFile(source) as old, zipfile.ZipFile(target, "w") as new:
        for name in old.namelist():
            changed = change(name, old.read(name))
            if changed:
                new.writestr(*changed)
    return target


def with_description(source, target, pattern, replacement, flags=0):
    """A copy whose modelDescription.xml is changed."""

    def change(name, data):
        return name, re.sub(
            pattern, replacement, data, flags=flags
        ) if name == "modelDescription.xml" else data

    return repacked(source, target, change)


def alone(fmu, target):
    """A copy of an FMU that is for model exchange alone."""

    def change(name, data):
        if name != "modelDescription.xml":
            return name, data
        text, count = re.subn(rb"<CoSimulation[^>]*/>|<CoSimulation.*?</CoSimulation>", b"", data, flags=re.S)
        assert count == 1
        return name, text

    return repacked(fmu, target, change)
