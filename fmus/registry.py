"""The folder is the registry: find the classes of a kind in the modules of a package."""

import inspect
from importlib import import_module
from pkgutil import walk_packages
from types import ModuleType
from typing import TypeVar

T = TypeVar("T")


def classes_in(package: ModuleType, base: type[T]) -> list[type[T]]:
    """Concrete subclasses of `base` defined in the modules below a package, by module name."""
    found: list[type[T]] = []
    for info in walk_packages(package.__path__, package.__name__ + "."):
        for cls in vars(import_module(info.name)).values():
            own = inspect.isclass(cls) and cls.__module__ == info.name
            if own and issubclass(cls, base) and not inspect.isabstract(cls):
                found.append(cls)
    return found
