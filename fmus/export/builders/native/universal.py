"""A universal binary of macOS: libraries for several processors in one file."""

from collections.abc import Sequence
from pathlib import Path
from struct import pack, unpack_from

MAGIC = 0xCAFEBABE
PAGE = 14  # power of two that each part is aligned to: the page of Apple's own processors


def universal(parts: Sequence[Path]) -> bytes:
    """One file of several Mach-O libraries of 64 bits."""
    contents = [part.read_bytes() for part in parts]
    header, offset = pack(">II", MAGIC, len(contents)), 0
    body = b""
    for data in contents:
        offset = -(-(max(offset, 1)) // 2**PAGE) * 2**PAGE
        processor, kind = unpack_from("<II", data, 4)
        header += pack(">IIIII", processor, kind, offset, len(data), PAGE)
        body += bytes(offset - 2**PAGE - len(body)) + data
        offset += len(data)
    return header.ljust(2**PAGE, b"\0") + body
