"""Integrity of an FMU file: the check sums of its archive, and of the maps and models that are ours."""

import hashlib
import zipfile
import zlib
from pathlib import Path, PurePosixPath

from strainfmu.files import USER_BLOCK_SIZE
from strainfmu.interface.contents import CONTENTS
from strainfmu.resource_file import is_whole

_ALTERED = "damaged or altered, its check sum is wrong"


def damaged_entries(path: Path) -> list[str]:
    """Return the entries of the FMU at ``path`` that are not as they were written, a line each; none if all are.

    Of any FMU the check sums of the archive are held against the content; of this project's also those inside
    the resources, which an entry that was exchanged or packed again does not satisfy.
    """
    damaged = []
    with zipfile.ZipFile(path) as archive:
        names = [item.filename for item in archive.infolist() if not item.is_dir()]
        for name in names:
            try:
                content = archive.read(name)
            except (zipfile.BadZipFile, zlib.error, EOFError, OSError):
                damaged.append(f"{name}: {_ALTERED}")
            except (RuntimeError, NotImplementedError) as error:  # encrypted, or packed in a way of its own
                damaged.append(f"{name}: cannot be read: {error}")
            else:
                if CONTENTS in names and not _is_whole(name, content):
                    damaged.append(f"{name}: {_ALTERED}")
    return damaged


def _is_whole(name: str, content: bytes) -> bool:
    """Return whether an entry satisfies the check sum that it holds; entries without one do."""
    kind = PurePosixPath(name)
    if kind.parent.name != "resources":
        return True
    if kind.name in ("map.bin", "model.bin"):
        return is_whole(content)
    return kind.suffix != ".h5" or _is_whole_hdf5(content)


def _is_whole_hdf5(content: bytes) -> bool:
    """Return whether an HDF5 file has the SHA-256 of the line ahead of it."""
    words = content[:USER_BLOCK_SIZE].split(b"\n")[0].split(b" ")
    return words[-1] == hashlib.sha256(content[USER_BLOCK_SIZE:]).hexdigest().encode()
