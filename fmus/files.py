"""Files that are written as a whole or not at all."""

import os
from pathlib import Path


def write_at_once(target: Path, data: bytes) -> None:
    """Write a file at once: a reader sees the old one or the new one."""
    target.parent.mkdir(parents=True, exist_ok=True)
    part = target.with_name(f".{target.name}.{os.getpid()}")
    try:
        part.write_bytes(data)
        part.replace(target)
    finally:
        part.unlink(missing_ok=True)
