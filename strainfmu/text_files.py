"""Text files that people write, TOML and CSV: read whole, and refused where they are something else.

A file may be named by mistake. So a file without end is given up early, and a message shows nothing of a file in
which nothing is as expected.
"""

import csv
import io
import tomllib
from collections.abc import Collection, Sequence
from pathlib import Path
from typing import Any

from strainfmu.errors import InputError

MIB = 2**20
LARGEST = 16 * MIB
"""Size [bytes] that no such file reaches, unless its reader says otherwise."""
SHOWN = 200
"""Characters of column names that a message shows."""


def read_text(path: Path, kind: str, largest: int = LARGEST) -> str:
    """Return the text of a file, without its byte-order mark.

    Parameters
    ----------
    path : the file.
    kind : what it should be, for messages: ``"CSV file"``.
    largest : its size [bytes] beyond which it is given up.

    Raises
    ------
    InputError
        The file is missing, cannot be read, is larger, or is no text in UTF-8.
    """
    parts, size = [], 0
    try:
        with path.open("rb") as stream:
            while part := stream.read(MIB):
                parts.append(part)
                size += len(part)
                if b"\0" in part:
                    raise InputError(f"{path}: not a {kind}: expected text, got bytes of 0")
                if size > largest:
                    raise InputError(f"{path}: not a {kind}: expected at most {largest // MIB} MiB, got more")
    except FileNotFoundError as error:
        raise InputError(f"{path}: no such file") from error
    except OSError as error:
        raise InputError(f"{path}: cannot be read: {error.strerror or error}") from error
    try:
        return b"".join(parts).decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise InputError(f"{path}: not a {kind}: expected text in UTF-8, got other bytes") from error


def read_toml(path: Path) -> dict[str, Any]:
    """Return the entries of a TOML file.

    Raises
    ------
    InputError
        As :func:`read_text`, or it is no TOML.
    """
    text = read_text(path, "TOML file")
    try:
        return tomllib.loads(text)
    except (ValueError, RecursionError) as error:  # of TOML, of a number with thousands of digits
        raise InputError(f"{path}: not a TOML file: {error}") from error


def read_csv(path: Path, largest: int = LARGEST) -> list[tuple[int, list[str]]]:
    """Return the rows of a CSV file with their line numbers; empty lines are left out.

    Cells are apart by the comma, semicolon or tab that the first line has most of.

    Raises
    ------
    InputError
        As :func:`read_text`, or it is no CSV file.
    """
    text = read_text(path, "CSV file", largest)
    heading = next((line for line in text.splitlines() if line.strip()), "")
    reader = csv.reader(io.StringIO(text, newline=""), delimiter=max(",;\t", key=heading.count))
    try:
        return [(reader.line_num, row) for row in reader if row]
    except csv.Error as error:
        raise InputError(f"{path}: not a CSV file: line {reader.line_num}: {error}") from error


def shown_columns(read: Sequence[str], known: Collection[str]) -> str:
    """Return names of columns for a message: nothing of a header that holds none of the ``known`` ones."""
    names = [name.strip() for name in read]
    if not any(names):
        return "nothing"
    if not any(name in known for name in names):
        return "none of them"
    text = ", ".join(names)
    return text if len(text) <= SHOWN else f"{text[:SHOWN]} .."
