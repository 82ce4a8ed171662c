"""A file that HDF5 writes to through Python, and that never fails towards HDF5.

When a write fails (a full disk), HDF5 keeps what it could not write, fails again while it closes, and crashes the
process at the latest at its end. Here the error is kept for the caller instead; what could not be written is held
in memory, so that HDF5 closes the file in order.
"""

from __future__ import annotations

import io
import os
from pathlib import Path
from typing import Any


class GuardedFile(io.RawIOBase):
    """A new file for reading and writing; :attr:`error` is the first error of the operating system.

    After an error nothing more is written to disk: the file is to be closed and removed.
    """

    def __init__(self, path: Path) -> None:
        super().__init__()
        self.error: OSError | None = None
        self._file = path.open("w+b", buffering=0)
        self._position = 0
        self._end = 0
        self._held: list[tuple[int, bytes]] = []

    def raise_error(self) -> None:
        """Raise what went wrong so far, if anything did."""
        if self.error is not None:
            raise self.error

    def write(self, data: Any) -> int:
        """Write ``data``, any buffer, at the position; return its length in bytes, whatever happened to it."""
        content = bytes(memoryview(data))
        if self.error is None:
            self._to_disk(content)
        if self.error is not None:
            self._held.append((self._position, content))
        self._position += len(content)
        self._end = max(self._end, self._position)
        return len(content)

    def readinto(self, buffer: Any) -> int:
        """Fill ``buffer`` from the position on; return the number of bytes read."""
        view = memoryview(buffer).cast("B")
        first = self._position
        n = max(min(len(view), self._end - first), 0)
        content = bytearray(n)
        self._from_disk(content)
        for start, held in self._held:
            low, high = max(start, first), min(start + len(held), first + n)
            if low < high:
                content[low - first : high - first] = held[low - start : high - start]
        view[:n] = content
        self._position += n
        return n

    def seek(self, offset: int, whence: int = os.SEEK_SET) -> int:
        """Move to ``offset`` [bytes] and return the position."""
        origin = {os.SEEK_SET: 0, os.SEEK_CUR: self._position, os.SEEK_END: self._end}[whence]
        self._position = origin + offset
        return self._position

    def tell(self) -> int:
        """Return the position [bytes]."""
        return self._position

    def truncate(self, size: int | None = None) -> int:
        """Set the length of the file [bytes]."""
        self._end = self._position if size is None else size
        if self.error is None:
            try:
                self._file.truncate(self._end)
            except OSError as error:
                self.error = error
        return self._end

    def sync(self) -> None:
        """Bring all to the disk itself, which may be where a lack of space shows.

        Raises
        ------
        OSError
            This failed, or a write before.
        """
        self.raise_error()
        os.fsync(self._file.fileno())

    def readable(self) -> bool:
        """Return true."""
        return True

    def writable(self) -> bool:
        """Return true."""
        return True

    def seekable(self) -> bool:
        """Return true."""
        return True

    def close(self) -> None:
        """Close the file; an error of this is kept too."""
        if not self.closed:
            try:
                self._file.close()
            except OSError as error:
                self.error = self.error or error
            super().close()

    def _to_disk(self, content: bytes) -> None:
        rest = memoryview(content)
        try:
            self._file.seek(self._position)
            while rest:
                rest = rest[self._file.write(rest) :]
        except OSError as error:
            self.error = error

    def _from_disk(self, content: bytearray) -> None:
        """Fill ``content`` from the position on, as far as the file reaches."""
        view = memoryview(content)
        try:
            self._file.seek(self._position)
            while view and (read := self._file.readinto(view)):
                view = view[read:]
        except OSError as error:
            self.error = self.error or error
