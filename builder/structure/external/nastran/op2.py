"""OP2 files: the tables of element strain, in single or double precision, of either byte order.

An OP2 file is a Fortran sequential file. A word is 4 bytes, or 8 where Nastran ran with 8-byte integers; each
record has its length in bytes before and after it. Records of one word are keys: a positive one says how many
words follow, a negative one ends a logical record, 0 a table; two 0 in a row end the file.
"""

from collections.abc import Iterator
from pathlib import Path

import numpy as np

from builder.structure.external.nastran.element_rows import LAYOUTS, ElementRows, known_rows
from strainfmu.arrays import FloatArray
from strainfmu.errors import InputError

STRAIN_TABLES = ("OSTR1", "OSTR1X", "OSTR1C")
"""Names of the tables of element strain, real, by subcase: of MSC and NX Nastran, and of composite plies."""
OTHER_ORDER = ("OSTR2", "OSTR2X", "OSTR2C")
"""The same sorted by element."""
STATICS = (1, 10)
"""Approach codes of linear and nonlinear statics."""
_HEADER_RECORDS = 3  # of a table: name, trailer, name again


def read_op2_strains(path: Path) -> list[ElementRows]:
    """Return the element strains of an OP2 file, a block per table, subcase and type of element.

    Raises
    ------
    InputError
        The file is none, is cut short, or holds strains other than linear statics per subcase.
    """
    data = path.read_bytes()
    order, size = _format(path, data)
    rows: list[ElementRows] = []
    for name, records in _tables(path, data, order, size):
        if name in OTHER_ORDER:
            raise InputError(f"{path}: table {name}: expected strains per subcase (SORT1), got them per element")
        if name in STRAIN_TABLES:
            pairs = records[_HEADER_RECORDS:]
            for ident, values in zip(pairs[0::2], pairs[1::2], strict=False):
                rows.append(_block(path, name, ident, values, order, size))
    return rows


def _format(path: Path, data: bytes) -> tuple[str, int]:
    """Return byte order and bytes per word, from the first record, which is a key."""
    for order, name in (("<", "little"), (">", "big")):
        size = int.from_bytes(data[:4], "little" if name == "little" else "big")
        if size in (4, 8) and len(data) > 8 + size:
            return order, size
    raise InputError(f"{path}: not an OP2 file, or empty: its first record is no key")


def _records(path: Path, data: bytes, order: str) -> Iterator[bytes]:
    """Yield the Fortran records."""
    offset, kind = 0, np.dtype(f"{order}i4")
    while offset < len(data):
        if offset + 8 > len(data):
            raise InputError(f"{path}: OP2 file cut short at byte {offset}")
        length = int(np.frombuffer(data, kind, 1, offset)[0])
        end = offset + 4 + length
        if length < 0 or end + 4 > len(data):
            raise InputError(f"{path}: OP2 file cut short at byte {offset}, or damaged")
        if int(np.frombuffer(data, kind, 1, end)[0]) != length:
            raise InputError(f"{path}: OP2 file damaged at byte {offset}: a record's two lengths differ")
        yield data[offset + 4 : end]
        offset = end + 4


def _tables(path: Path, data: bytes, order: str, size: int) -> Iterator[tuple[str, list[bytes]]]:
    """Yield name and logical records of each table; the first key of a record, its kind, is left out."""
    records: list[bytes] = []
    parts: list[bytes] = []
    kind = np.dtype(f"{order}i{size}")
    source = _records(path, data, order)
    for record in source:
        if len(record) != size:
            raise InputError(f"{path}: OP2 file damaged: expected a key of {size} bytes, got {len(record)}")
        key = int(np.frombuffer(record, kind)[0])
        if key > 0:
            following = next(source, None)
            if following is None:
                raise InputError(f"{path}: OP2 file cut short after a key")
            parts.append(following)
        elif key < 0:
            # From the third record on a first word says what kind of record it is.
            records.append(b"".join(parts[1:] if len(records) >= 2 else parts))
            parts = []
        elif records:
            yield _text(records[0], size), records
            records, parts = [], []
    if records or parts:
        raise InputError(f"{path}: OP2 file cut short: its last table has no end")


def _text(record: bytes, size: int) -> str:
    """Return the text of a record, four characters in each word."""
    words = (record[k : k + 4] for k in range(0, len(record), size))
    return b"".join(words).decode("latin-1").strip()


def _block(path: Path, table: str, ident: bytes, values: bytes, order: str, size: int) -> ElementRows:
    """Return the rows of one subcase and type of element."""
    head = np.frombuffer(ident, np.dtype(f"{order}i{size}"), min(len(ident) // size, 12))
    if len(head) < 12:
        raise InputError(f"{path}: table {table}: damaged, its head has {len(head)} words")
    approach, code, element_type, subcase, width = (int(head[k]) for k in (0, 1, 2, 3, 9))
    where = f"{path}: table {table}, subcase {subcase}"
    if code // 1000:
        raise InputError(f"{where}: expected real strains per subcase (SORT1), got table code {code}")
    if approach // 10 not in STATICS:
        raise InputError(f"{where}: expected linear statics (approach 1), got approach {approach // 10}")
    layout = LAYOUTS.get(element_type)
    if layout is None:
        numbers = np.frombuffer(values, np.dtype(f"{order}i{size}"))[:: max(width, 1)] // 10
        return ElementRows(
            subcase=subcase,
            element_type=element_type,
            words=np.empty((0, 0)),
            element=numbers.astype(np.int64),
        )
    if width != layout.words or len(values) % (width * size):
        raise InputError(
            f"{where}: {layout.name}: expected {layout.words} words per element, got {width}; "
            "is it complex or random output?"
        )
    integer = np.frombuffer(values, np.dtype(f"{order}i{size}")).reshape(-1, width)
    words: FloatArray = np.frombuffer(values, np.dtype(f"{order}f{size}")).reshape(-1, width).astype(np.float64)
    words[:, layout.integers] = integer[:, layout.integers]
    words[:, 0] = integer[:, 0] // 10  # the rest is the device it was written for
    return known_rows(subcase, element_type, words)
