"""The folder is the registry: find the classes of a kind in the modules of a package."""

import inspect
from fnmatch import fnmatch
from importlib import import_module
from pkgutil import walk_packages
from types import ModuleType
from typing import TypeVar

T = TypeVar("T")


def classes_in(package: ModuleType, base: type[T], modules: str = "*") -> list[type[T]]:
    """Concrete subclasses of `base` in the modules below a package whose full name matches a pattern."""
    found: list[type[T]] = []
    names = (info.name for info in walk_packages(package.__path__, package.__name__ + "."))
    for name in filter(lambda n: fnmatch(n, modules), names):
        for cls in vars(import_module(name)).values():
            own = inspect.isclass(cls) and cls.__module__ == name
            if own and issubclass(cls, base) and not inspect.isabstract(cls):
                found.append(cls)
    return found
