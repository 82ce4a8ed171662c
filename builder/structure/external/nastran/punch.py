"""Punch files (PCH): element strains as text, 80 columns a line.

A line has four fields of 18 columns and a line number in the last 8. Lines that begin with ``$`` say what follows;
an element's first line has its number in the first field, ``-CONT-`` continues it.
"""

import re
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from builder.structure.external.nastran.element_rows import LAYOUTS, PLATE, PLY, ROD, ElementRows, known_rows
from strainfmu.errors import InputError

FIELD, FIELDS = 18, 4
READ = (ROD, PLATE, PLY)
"""Kinds of element whose words in a punch file are known; strains of solids are read from OP2 files."""

_BARE_EXPONENT = re.compile(r"(\d)([+-]\d+)$")
_SORTED_BY_ELEMENT = ("$ELEMENT ID", "$POINT ID")
_NOT_STATIC = ("$EIGENVALUE", "$FREQUENCY", "$TIME", "$LOAD FACTOR")


@dataclass
class _Place:
    """Where in the file the reader is."""

    strains: bool = False
    subcase: int | None = None
    element_type: int | None = None
    rows: dict[tuple[int, int], list[list[float]]] = field(default_factory=dict)


def read_punch_strains(path: Path) -> list[ElementRows]:
    """Return the element strains of a punch file, a block per subcase and type of element.

    Raises
    ------
    InputError
        A line cannot be read, an element has another number of values than its type, or strains are not of linear
        statics per subcase.
    """
    place = _Place()
    with path.open(encoding="latin-1") as stream:
        for number, line in enumerate(stream, 1):
            where = f"{path}, line {number}"
            if line.startswith("$"):
                _header(line, place, where)
            elif place.strains and line.strip():
                _values(line, place, where)
    return [_rows(path, subcase, kind, rows) for (subcase, kind), rows in place.rows.items()]


def _header(line: str, place: _Place, where: str) -> None:
    text = line[: FIELD * FIELDS].strip()
    if text.startswith("$TITLE"):
        place.strains, place.subcase, place.element_type = False, None, None
    elif text == "$ELEMENT STRAINS":
        place.strains = True
    elif text.startswith("$SUBCASE ID ="):
        place.subcase = _integer(text.split("=")[1], where)
    elif text.startswith("$ELEMENT TYPE ="):
        place.element_type = _integer("".join(text.split("=")[1].split()[:1]), where)
    elif place.strains and text.startswith("$") and "OUTPUT" in text and "REAL OUTPUT" not in text:
        raise InputError(f"{where}: expected real output, got '{text}'")
    elif place.strains and text.startswith(_SORTED_BY_ELEMENT):
        raise InputError(f"{where}: expected strains per subcase (SORT1), got '{text}'")
    elif place.strains and text.startswith(_NOT_STATIC):
        raise InputError(f"{where}: expected linear statics, got '{text}'")


def _values(line: str, place: _Place, where: str) -> None:
    if place.subcase is None or place.element_type is None:
        raise InputError(f"{where}: expected $SUBCASE ID and $ELEMENT TYPE ahead of strains, got none")
    rows = place.rows.setdefault((place.subcase, place.element_type), [])
    if not line.endswith("\n") and len(line) < FIELD * FIELDS and len(line) % FIELD:
        raise InputError(f"{where}: expected fields of {FIELD} characters, the file ends in '{line.split()[-1]}'")
    cells = [line[FIELD * k : FIELD * (k + 1)].strip() for k in range(FIELDS)]
    if cells[0] == "-CONT-":
        if not rows:
            raise InputError(f"{where}: expected an element ahead of -CONT-, got none")
    else:
        rows.append([float(_integer(cells[0], where))])
    last = max((k for k in range(1, FIELDS) if cells[k]), default=0)
    rows[-1] += [_number(cell, where) for cell in cells[1 : last + 1]]


def _rows(path: Path, subcase: int, element_type: int, rows: list[list[float]]) -> ElementRows:
    layout = LAYOUTS.get(element_type)
    if layout is None or layout.kind not in READ or layout.points > 1:
        return ElementRows(
            subcase=subcase,
            element_type=element_type,
            words=np.empty((0, 0)),
            element=np.array([int(row[0]) for row in rows]),
        )
    for row in rows:
        if len(row) != layout.words:
            raise InputError(
                f"{path}: subcase {subcase}, element {row[0]:.0f}: expected {layout.words - 1} values of a "
                f"{layout.name}, got {len(row) - 1}"
            )
    return known_rows(subcase, element_type, np.array(rows))


def _integer(text: str, where: str) -> int:
    try:
        return int(text)
    except ValueError as error:
        raise InputError(f"{where}: expected a whole number, got '{text.strip()}'") from error


def _number(text: str, where: str) -> float:
    """Return a value; Fortran writes exponents of three digits without their letter, 1.000000-100."""
    if text and text[0].isalpha():
        return float("nan")
    try:
        return float(_BARE_EXPONENT.sub(r"\1e\2", text))
    except ValueError as error:
        raise InputError(f"{where}: expected a number, got '{text}'") from error
