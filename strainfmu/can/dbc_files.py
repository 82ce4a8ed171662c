"""A user's DBC file, read by cantools, and the mapping beside it, read as TOML."""

from __future__ import annotations

import tomllib
from pathlib import Path
from typing import Any

from strainfmu.errors import InputError, StrainfmuError


def load_mapping(path: Path) -> dict[str, Any]:
    """Return the mapping file at ``path``.

    Raises
    ------
    InputError
        It is missing, no TOML, or holds an entry that does not exist.
    """
    try:
        mapping = tomllib.loads(path.read_text("utf-8"))
    except FileNotFoundError as error:
        raise InputError(f"{path}: no such file") from error
    except (OSError, UnicodeDecodeError, tomllib.TOMLDecodeError, RecursionError) as error:
        raise InputError(f"{path}: cannot be read: {error}") from error
    return mapping


def load_database(path: Path) -> Any:
    """Return cantools' database of the DBC file at ``path``.

    Raises
    ------
    InputError
        It is missing or cannot be read.
    StrainfmuError
        cantools is not installed.
    """
    try:
        # As DBC tools write them: Windows-1252; every byte means something.
        return database_of(path.read_text("cp1252", errors="replace"), str(path))
    except FileNotFoundError as error:
        raise InputError(f"{path}: no such file") from error
    except OSError as error:
        raise InputError(f"{path}: cannot be read: {error.strerror or error}") from error


def database_of(text: str, name: str) -> Any:
    """Return cantools' database of the DBC file with content ``text``; ``name`` is for messages.

    Raises
    ------
    InputError
        It cannot be read.
    StrainfmuError
        cantools is not installed.
    """
    try:
        import cantools
    except ImportError as error:
        raise StrainfmuError("cantools is not installed: pip install 'strainfmu[can]'") from error
    try:
        return cantools.database.load_string(text, database_format="dbc")
    except Exception as error:  # its parser raises what it meets
        raise InputError(f"{name}: cannot be read as a DBC file: {' '.join(str(error).split())[:300]}") from error
