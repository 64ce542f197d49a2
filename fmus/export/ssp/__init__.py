"""SSP 1.0 packages: connected FMUs with their values, as other tools exchange them."""

from fmus.export.ssp.reading import read_package
from fmus.export.ssp.system import (
    Component,
    Connector,
    Link,
    Start,
    System,
)
from fmus.export.ssp.writing import write_package

__all__ = ["Component", "Connector", "Link", "Start", "System", "read_package", "write_package"]
