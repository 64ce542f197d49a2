"""Entries of the archives that are written here: the same bytes at any time, readable by all."""

from zipfile import ZipInfo

DATE = (1980, 1, 1, 0, 0, 0)  # the first that a zip file can hold
MODE = 0o644  # of an unpacked file


def entry(name: str) -> ZipInfo:
    """The entry of a file in an archive."""
    info = ZipInfo(name, DATE)
    info.external_attr = MODE << 16
    return info
