"""Memory that two processes share, by a name under which the other one opens it."""

import fcntl
import mmap
import os
from weakref import finalize


class Memory:
    """A file in memory, mapped as a whole; both processes may make it larger, and neither smaller."""

    def __init__(self, size: int = 0, name: str = "") -> None:
        if name:
            self._file = os.open(name, os.O_RDWR | os.O_CLOEXEC)
        else:
            self._file = os.memfd_create("railfmi", os.MFD_CLOEXEC | os.MFD_ALLOW_SEALING)
            os.ftruncate(self._file, size)
            # reading what another process has cut off would end this one with a bus error
            fcntl.fcntl(self._file, fcntl.F_ADD_SEALS, fcntl.F_SEAL_SHRINK | fcntl.F_SEAL_SEAL)
        self.map = mmap.mmap(self._file, 0)
        finalize(self, os.close, self._file)  # the memory goes with the last process that has it open

    @property
    def name(self) -> str:
        """Opens the same memory in another process, as long as this one has not closed it."""
        return f"/proc/{os.getpid()}/fd/{self._file}"

    def reserve(self, size: int) -> None:
        """Make it at least so large, bytes."""
        if size > len(self.map):
            os.ftruncate(self._file, size)
            self.follow(size)

    def follow(self, size: int) -> None:
        """See as many bytes as the other process has made of it."""
        if size != len(self.map):
            self.map.close()
            self.map = mmap.mmap(self._file, size)
