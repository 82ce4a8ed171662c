"""The vehicle file in the line of what is refused of it: checks of its parts know entries, not files."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from strainfmu.errors import FaultsError, InputError

_FILES = (".toml", ".h5", ".csv", ".json", ".stl", ".tri", ".triq", ".obj", ".vtk", ".vtp", ".vtu", ".msh")
"""Suffixes by which a file that is missing is known as one."""


@contextmanager
def naming(vehicle: Path) -> Iterator[None]:
    """Put ``vehicle`` before every line that is refused and names neither a file nor an option.

    Raises
    ------
    InputError
        As refused inside, with the file; :class:`FaultsError` where that was one.
    """
    try:
        yield
    except InputError as error:
        lines = named(error.lines, vehicle)
        if lines == error.lines:
            raise
        kind = FaultsError if isinstance(error, FaultsError) else InputError
        raise kind("\n".join(lines)) from error


def named(lines: list[str], vehicle: Path) -> list[str]:
    """Return ``lines`` with ``vehicle`` before those that name neither a file nor an option."""
    return [line if _has_name(line) else f"{vehicle}: {line}" for line in lines]


def _has_name(line: str) -> bool:
    head = line.partition(": ")[0]
    return head.startswith("--") or Path(head).suffix.lower() in _FILES or Path(head).exists()
