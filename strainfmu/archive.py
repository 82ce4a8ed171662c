"""Zip archives: bytes that depend on their content alone, as of FMUs and SSP packages; a limit on their size."""

import io
import zipfile
from collections.abc import Mapping
from pathlib import Path

from strainfmu.errors import InputError
from strainfmu.files import write_bytes_atomically

_ZIP_TIME = (1980, 1, 1, 0, 0, 0)  # the earliest a zip can hold, so that equal content gives equal bytes

LEVEL = 6
"""Of compression: 9 takes twice as long and makes an FMU 0.3 % smaller."""

LARGEST_UNPACKED = 10**9
"""Size of all entries of an archive [bytes] beyond which none is unpacked: a hundred large FMUs."""


def check_unpacked_size(path: Path) -> None:
    """Check the size of what is in the archive ``path``, as its directory states it; readers stop there.

    An archive that cannot be read is left to its reader.

    Raises
    ------
    InputError
        It is above :data:`LARGEST_UNPACKED`.
    """
    try:
        with zipfile.ZipFile(path) as archive:
            size = sum(entry.file_size for entry in archive.infolist())
    except Exception:  # zipfile raises whatever its parsers do
        return
    if size > LARGEST_UNPACKED:
        raise InputError(
            f"{path}: expected at most {LARGEST_UNPACKED / 1e9:.1f} GB in the archive, got {size / 1e9:.1f} GB"
        )


def write_archive(path: Path, entries: Mapping[str, bytes]) -> None:
    """Write a zip of ``entries``, content by name, to ``path`` atomically.

    Raises
    ------
    StrainfmuError
        The file could not be written; ``path`` keeps its old content.
    """
    write_bytes_atomically(path, _zip(entries))


def _zip(entries: Mapping[str, bytes]) -> bytes:
    """Return a deflated zip whose bytes depend on ``entries`` alone."""
    image = io.BytesIO()
    with zipfile.ZipFile(image, "w") as archive:
        for name in sorted(entries):
            entry = zipfile.ZipInfo(name.replace("\\", "/"), _ZIP_TIME)
            entry.compress_type = zipfile.ZIP_DEFLATED
            entry.create_system = 3
            entry.external_attr = 0o644 << 16
            archive.writestr(entry, entries[name], compresslevel=LEVEL)
    return image.getvalue()
