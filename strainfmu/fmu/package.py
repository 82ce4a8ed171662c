"""An FMU as a file: one zip whose bytes depend on its content alone."""

from __future__ import annotations

import io
import zipfile
from collections.abc import Mapping
from pathlib import Path

from strainfmu.errors import InputError
from strainfmu.files import write_bytes_atomically

CONTENTS = "extra/strainfmu/contents.json"
"""What ``strainfmu inspect`` reads: kind, map, validity."""

_ZIP_TIME = (1980, 1, 1, 0, 0, 0)  # the earliest a zip can hold, so that equal content gives equal bytes


def check_fmu_path(path: Path) -> None:
    """Refuse to write an FMU under a name that no tool would open.

    Raises
    ------
    InputError
        The name does not end in ``.fmu``, or is that of a folder.
    """
    if path.suffix != ".fmu":
        raise InputError(f"{path}: the name of an FMU must end in .fmu")
    if path.is_dir():
        raise InputError(f"{path}: is a folder, an FMU cannot be written there")


def write_fmu(path: Path, entries: Mapping[str, bytes]) -> None:
    """Write an FMU of ``entries``, content by name, to ``path`` atomically.

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
