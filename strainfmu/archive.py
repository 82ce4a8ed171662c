"""Zip archives whose bytes depend on their content alone, as FMUs and SSP packages are."""

from __future__ import annotations

import io
import zipfile
from collections.abc import Mapping
from pathlib import Path

from strainfmu.files import write_bytes_atomically

_ZIP_TIME = (1980, 1, 1, 0, 0, 0)  # the earliest a zip can hold, so that equal content gives equal bytes


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
    with zipfile.ZipFile(image, "w", zipfile.ZIP_DEFLATED, compresslevel=9) as archive:
        for name in sorted(entries):
            entry = zipfile.ZipInfo(name.replace("\\", "/"), _ZIP_TIME)
            entry.compress_type = zipfile.ZIP_DEFLATED
            entry.create_system = 3
            entry.external_attr = 0o644 << 16
            archive.writestr(entry, entries[name])
    return image.getvalue()
