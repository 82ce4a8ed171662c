"""Readers of a user's DBC file (by cantools) and of the mapping beside it (TOML)."""

from __future__ import annotations

import tomllib
from pathlib import Path
from typing import Any

from strainfmu.can.wire.libraries import error_line, import_cantools
from strainfmu.errors import InputError
from strainfmu.files import read_bytes


def load_mapping(path: Path) -> dict[str, Any]:
    """Return the mapping file at ``path``.

    Raises
    ------
    InputError
        It is missing, or no TOML.
    """
    try:
        mapping = tomllib.loads(path.read_text("utf-8-sig"))
    except FileNotFoundError as error:
        raise InputError(f"{path}: no such file") from error
    except (OSError, ValueError, RecursionError) as error:
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
    return database_of(_text(read_bytes(path)), str(path))


def _text(content: bytes) -> str:
    """Return a DBC file's text: UTF-8, else Windows-1252, whose letters beyond ASCII are hardly ever UTF-8."""
    try:
        return content.decode("utf-8-sig")
    except UnicodeDecodeError:
        return content.decode("cp1252", errors="replace")


def database_of(text: str, name: str) -> Any:
    """Return cantools' database of the DBC file with content ``text``; ``name`` is for messages.

    Raises
    ------
    InputError
        It cannot be read.
    StrainfmuError
        cantools is not installed.
    """
    cantools = import_cantools()
    try:
        return cantools.database.load_string(text, database_format="dbc")
    except Exception as error:  # its parser raises exceptions of many types
        raise InputError(f"{name}: cannot be read as a DBC file: {error_line(error)[:300]}") from error
