"""Readers of a user's DBC file (by cantools) and of the mapping next to it (TOML)."""

import re
from pathlib import Path
from typing import Any

from strainfmu.can.frame import error_line, import_cantools
from strainfmu.errors import InputError
from strainfmu.files import read_bytes
from strainfmu.text_files import read_toml

LARGEST_FILE = 5_000_000
"""Characters of a DBC file beyond which it is not read: cantools takes seconds for a million."""

LONGEST_MESSAGE = 1785
"""Bytes of the longest message, of a transport protocol (SAE J1939-21); cantools lists every bit."""

_LENGTHS = re.compile(
    r"^\s*(?:BO_\s+\d+\s+(?P<message>\w+)\s*:\s*(?P<bytes>\d+)"
    r"|SG_\s+(?P<signal>\w+)[^:\n]*:\s*(?P<start>\d+)\|(?P<bits>\d+)@)",
    re.MULTILINE,
)
"""A message with its length [bytes]; a signal with its start and length [bits]."""


_UNUSED = re.compile(r"\b(VAL_|SIG_VALTYPE_) (\d+) (\w+)")
"""Entries of a value or type whose signal does not exist, as cantools lists them."""

_ENTRY = r'^[ \t]*{}\s+{}\s+{}\b(?:[^";]|"[^"]*")*;'

E2E_PROFILE, E2E_DATA_ID = "E2EProfile", "E2EDataID"
"""Message attributes of a DBC file that state the end-to-end protection; 0: none."""

SECOC_DATA_ID = "SecOCDataID"
"""Message attribute of a DBC file whose frames are authenticated; -1: not."""

MAPPING_TABLE = "input"
"""Table of a bus file whose entries map the signals of a DBC file."""

OTHER_ENTRIES = frozenset(
    {"profile", "dbc", "mapping", "id_base", "extended", "key", "freshness", "dynamic_pressure_pa", "gauges"}
)
"""Entries of that table that map no signal."""


def load_mapping(path: Path) -> dict[str, Any]:
    """Return the mapping in the file at ``path``, a mapping file or a bus file."""
    mapping = read_toml(path)
    of_bus = mapping.get(MAPPING_TABLE)
    if not isinstance(of_bus, dict):
        return mapping
    return {name: value for name, value in of_bus.items() if name not in OTHER_ENTRIES}


def load_database(path: Path) -> Any:
    """Return cantools' database of the DBC file at ``path``."""
    return database_of(_text(read_bytes(path)), str(path))


def _text(content: bytes) -> str:
    """Return a DBC file's text: UTF-8, else Windows-1252, whose letters beyond ASCII are hardly ever UTF-8."""
    try:
        return content.decode("utf-8-sig")
    except UnicodeDecodeError:
        return content.decode("cp1252", errors="replace")


def database_of(text: str, name: str) -> Any:
    """Return cantools' database of the DBC file with content ``text``; ``name`` is for messages.

    Entries about signals that the file does not have are left out; whether the signals of a message overlap or fit
    is judged where a mapping names it.

    Raises
    ------
    InputError
        It cannot be read, or is too large.
    StrainfmuError
        cantools is not installed.
    """
    cantools = import_cantools()
    _check_sizes(text, name)
    while True:
        try:
            return cantools.database.load_string(text, database_format="dbc", strict=False)
        except Exception as error:  # its parser raises exceptions of many types
            without = text
            for entry in _UNUSED.findall(str(error)):
                without = re.sub(_ENTRY.format(*entry), "", without, flags=re.MULTILINE)
            if without == text:
                raise InputError(f"{name}: cannot be read as a DBC file: {error_line(error)[:300]}") from error
            text = without


def _check_sizes(text: str, name: str) -> None:
    """Refuse what cantools would read for minutes: a file, a message or a signal of an absurd size."""
    if len(text) > LARGEST_FILE:
        raise InputError(
            f"{name}: expected at most {LARGEST_FILE / 1e6:g} MB, got {len(text) / 1e6:.1f} MB: keep the messages "
            "that the mapping names"
        )
    for size in _LENGTHS.finditer(text):
        is_message = size["message"] is not None
        what = f"message {size['message']}" if is_message else f"signal {size['signal']}"
        digits, limit = (size["bytes"], LONGEST_MESSAGE) if is_message else (size["bits"], 8 * LONGEST_MESSAGE)
        for number in (digits,) if is_message else (digits, size["start"]):
            if len(number) > 6 or int(number) > limit:
                unit = "bytes" if is_message else "bits"
                raise InputError(f"{name}: {what}: expected at most {limit:,} {unit}, got {number[:20]}")
