"""Completeness check of legacy VTK files: VTK's reader fills what is missing at the end with arbitrary memory.

Format: "VTK File Formats", simple legacy formats (VTK User's Guide). Only the last block of a file can be cut
short, so only its size is compared with what its heading declares.
"""

from __future__ import annotations

import re
from pathlib import Path

from strainfmu.errors import InputError

_BYTES = {
    "bit": 0.125,
    "char": 1,
    "unsigned_char": 1,
    "short": 2,
    "unsigned_short": 2,
    "int": 4,
    "unsigned_int": 4,
    "float": 4,
    "long": 8,
    "unsigned_long": 8,
    "vtkIdType": 4,
    "vtktypeint64": 8,
    "double": 8,
}
_TYPE = rb"(?P<type>" + b"|".join(name.encode() for name in _BYTES) + rb")"
_HEADINGS = (
    rb"POINTS (?P<n>\d+) " + _TYPE,
    rb"(?:POLYGONS|CELLS|TRIANGLE_STRIPS|LINES|VERTICES) (?P<offsets>\d+) (?P<n>\d+)",
    rb"CELL_TYPES (?P<n>\d+)",
    rb"(?:VECTORS|NORMALS) \S+ " + _TYPE,
    rb"SCALARS \S+ " + _TYPE + rb"(?: (?P<k>\d+))?[ \t\r]*\nLOOKUP_TABLE \S+",
    rb"\S+ (?P<k>\d+) (?P<n>\d+) " + _TYPE,
)
# Version 5 lists offsets and connectivity instead of one block of cells.
_SPLIT_CELLS = re.compile(rb"^(?:OFFSETS|CONNECTIVITY) (\S+)[ \t\r]*\n", re.MULTILINE | re.IGNORECASE)
_PARENT = re.compile(rb"^(?:POINT_DATA|CELL_DATA) (\d+)", re.MULTILINE | re.IGNORECASE)
_COMPILED = [re.compile(rb"^" + h + rb"[ \t\r]*\n", re.MULTILINE | re.IGNORECASE) for h in _HEADINGS]


def check_whole(path: Path, content: bytes) -> None:
    """Refuse a legacy file whose last block holds less than its heading declares.

    Raises
    ------
    InputError
        Numbers are missing at the end, or the last may be cut in two.
    """
    binary = re.match(rb"[^\n]*\n[^\n]*\n\s*BINARY", content, re.IGNORECASE) is not None
    headings = [match for pattern in _COMPILED for match in pattern.finditer(content)]
    if not headings:
        raise InputError(f"{path}: cut short: no block of data found")
    last = max(headings, key=lambda match: match.end())
    block = content[last.end() :]
    groups = last.groupdict()
    parts = _SPLIT_CELLS.findall(block) if groups.get("offsets") else []
    if parts:
        block = _SPLIT_CELLS.sub(b"", block)
        groups["type"] = parts[0]
        count = int(groups["offsets"]) + int(groups["n"])
    elif groups.get("n") is not None:
        count = int(groups["n"]) * int(groups.get("k") or 1)
    else:
        tuples = _PARENT.findall(content[: last.start()])
        components = 3 if last.group(0)[:7].upper() in (b"VECTORS", b"NORMALS") else int(groups.get("k") or 1)
        count = int(tuples[-1]) * components if tuples else 0
    if binary:
        size = _BYTES.get(groups["type"].decode(), 1) if groups.get("type") else 4
        found, expected, what = len(block), int(count * size), "bytes"
    else:
        found, expected, what = len(block.split(b"METADATA")[0].split()), count, "numbers"
    if found < expected:
        heading = last.group(0).split(b"\n")[0].decode("ascii", "replace")
        raise InputError(f"{path}: cut short: {found} {what} found behind '{heading}', must be {expected}")
    if not binary and found == expected and not content[-1:].isspace():
        raise InputError(f"{path}: cut short: the last number has no line end behind it")
