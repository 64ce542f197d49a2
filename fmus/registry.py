"""The folder is the registry: find the classes of a kind in the files of a package.

The environment variable RAILFMI_PATH names further folders, whose subfolders `fmus`, `estimator` and
`scenarios` mirror the packages: a file there counts as one of the package, which itself stays untouched.
"""

import inspect
import os
from importlib import import_module
from pathlib import Path
from types import ModuleType
from typing import TypeVar

from fmus.errors import BadInput

T = TypeVar("T")

VARIABLE = "RAILFMI_PATH"
PACKAGES = ("fmus", "estimator", "scenarios")


def further_folders(package: str) -> list[Path]:
    """Folders that RAILFMI_PATH adds to the package of that full name; BadInput for an entry that is none."""
    entries = [Path(e).expanduser().resolve() for e in os.environ.get(VARIABLE, "").split(os.pathsep) if e]
    for entry in entries:
        if not any((entry / name).is_dir() for name in PACKAGES):
            raise BadInput(
                f"{VARIABLE}: folder '{entry}' holds none of the folders {', '.join(PACKAGES)}; "
                "correct its path"
            )
    mirrored = (entry.joinpath(*package.split(".")) for entry in entries)
    return [folder for folder in mirrored if folder.is_dir()]


def classes_in(package: ModuleType, base: type[T], pattern: str = "*.py") -> list[type[T]]:
    """Concrete subclasses of `base` in the files of a package, and of RAILFMI_PATH, that match a pattern.

    pattern: of the file's path below the package; a folder on it needs no `__init__.py`. Files whose name
    begins with "_" are left out. BadInput where a further file cannot be loaded or holds no such class.
    """
    added = further_folders(package.__name__)
    own = [Path(folder) for folder in package.__path__ if Path(folder) not in added]
    package.__path__[:] = [str(folder) for folder in (*own, *added)]
    seen: dict[str, Path] = {}
    found: list[type[T]] = []
    for folder in (*own, *added):
        for file in sorted(folder.glob(pattern)):
            if file.name.startswith("_"):
                continue
            name = ".".join((package.__name__, *file.relative_to(folder).with_suffix("").parts))
            if name in seen:
                raise BadInput(f"{file}: '{name}' is also the name of {seen[name]}; rename the file")
            seen[name] = file
            found += _further(file, name, base) if folder in added else _defined(name, base)
    return found


def by_name(classes: list[type[T]], attribute: str) -> dict[str, type[T]]:
    """Classes by an attribute that names them; BadInput where one has none or two share it."""
    found: dict[str, type[T]] = {}
    for cls in classes:
        name = getattr(cls, attribute, None)
        if not isinstance(name, str):
            raise BadInput(f"{_file(cls)}: class {cls.__name__} has no '{attribute}'; give it a name by that")
        if name in found:
            raise BadInput(
                f"{_file(cls)}: '{name}' is also in {_file(found[name])}; give it another {attribute}"
            )
        found[name] = cls
    return found


def _defined(name: str, base: type[T]) -> list[type[T]]:
    return [c for c in _subclasses(name, base) if not inspect.isabstract(c)]


def _subclasses(name: str, base: type[T]) -> list[type[T]]:
    classes = (c for c in vars(import_module(name)).values() if inspect.isclass(c))
    return [c for c in classes if c.__module__ == name and issubclass(c, base)]


def _further(file: Path, name: str, base: type[T]) -> list[type[T]]:
    """The classes of a file from outside the package, which must load and hold at least one."""
    try:
        classes = _subclasses(name, base)
    except Exception as error:  # a file of the user's may fail in any way
        said = " ".join(f"{type(error).__name__}: {error}".split())
        raise BadInput(f"{file}: cannot be loaded ({said}); mend it") from error
    concrete = [c for c in classes if not inspect.isabstract(c)]
    if not concrete:
        missing = sorted({n for c in classes for n in getattr(c, "__abstractmethods__", ())})
        lacks = f"has a class of {base.__name__} that lacks {', '.join(missing)}"
        none = f"holds no class of {base.__name__}"
        raise BadInput(
            f"{file}: {lacks if missing else none}; complete it, or begin the file's name with '_'"
        )
    return concrete


def _file(cls: type) -> str:
    return inspect.getsourcefile(cls) or cls.__module__
