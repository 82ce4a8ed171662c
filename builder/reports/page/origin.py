"""What a report was made from: version, date, and the hash of every file that it follows from."""

import os
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from datetime import UTC, datetime
from hashlib import file_digest
from pathlib import Path
from typing import Any

from builder.reports.page.page_tables import Column, Table, make_table
from strainfmu.errors import InputError
from strainfmu.version import __version__


@dataclass(frozen=True, kw_only=True)
class InputFile:
    """A file that a report follows from: what it is, its name, and the SHA-256 of its bytes."""

    content: str
    name: str
    sha256: str


@dataclass(frozen=True, kw_only=True)
class Origin:
    """Version of strainfmu, date of making (ISO 8601, UTC), and the files."""

    version: str
    date: str
    files: tuple[InputFile, ...]

    @property
    def sentence(self) -> str:
        """Version and date in words."""
        return f"Made by strainfmu {self.version} on {self.date}."

    def as_json(self) -> dict[str, Any]:
        """Return it for JSON."""
        return asdict(self)

    def table(self) -> Table:
        """Return the files as a table."""
        columns = Column("made from"), Column("file"), Column("SHA-256")
        rows = [(file.content, file.name, file.sha256) for file in self.files]
        return make_table("made_from", "Files that this report was made from.", columns, rows)


def input_files(paths: Mapping[str, Path]) -> tuple[InputFile, ...]:
    """Return the files ``paths``, by what they are.

    Raises
    ------
    InputError
        A file cannot be read.
    """
    files = []
    for content, path in paths.items():
        try:
            with path.open("rb") as stream:
                digest = file_digest(stream, "sha256").hexdigest()
        except OSError as error:
            raise InputError(f"{path}: cannot be read: {error.strerror}") from error
        files.append(InputFile(content=content, name=path.name, sha256=digest))
    return tuple(files)


def origin_of(files: tuple[InputFile, ...]) -> Origin:
    """Return the origin of a report that is made of ``files`` now, or at ``SOURCE_DATE_EPOCH`` if that is set."""
    epoch = os.environ.get("SOURCE_DATE_EPOCH", "")
    date = datetime.fromtimestamp(int(epoch), UTC) if epoch.isdigit() else datetime.now(UTC)
    return Origin(version=__version__, date=f"{date:%Y-%m-%d %H:%M} UTC", files=files)
