"""OP2 and punch files of element strains, written word by word after the layouts that Nastran documents."""

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from strainfmu.arrays import FloatArray

ROD, PLATE = 1, 33


def op2_of_rods(
    strain: Mapping[int, FloatArray],
    elements: Sequence[int],
    size: int = 4,
    order: str = "<",
    table: str = "OSTR1X",
    approach: int = 1,
    sort: int = 0,
) -> bytes:
    """Return an OP2 file (PARAM,POST,-2) of axial strains (k,) of rods, by subcase, in words of ``size`` bytes."""
    integer, real = np.dtype(f"{order}i{size}"), np.dtype(f"{order}f{size}")

    def record(content: bytes) -> bytes:
        length = np.array([len(content)], f"{order}i4").tobytes()
        return length + content + length

    def key(number: int) -> bytes:
        return record(np.array([number], integer).tobytes())

    def text(words: str) -> bytes:
        return b"".join(words[k : k + 4].encode().ljust(size) for k in range(0, len(words), 4))

    def logical(number: int, content: bytes, kind: int | None = 0) -> bytes:
        """A record and the key that ends it; ``kind`` is what follows a first key from the third on."""
        first = b"" if kind is None else key(1) + key(kind)
        return first + key(len(content) // size) + record(content) + key(number)

    name = text(table.ljust(8))
    parts = [logical(-1, name, None), logical(-2, np.arange(7).astype(integer).tobytes(), None)]
    parts.append(logical(-3, name + bytes(5 * size)))
    for k, (subcase, values) in enumerate(strain.items()):
        head = np.zeros(146, integer)
        head[:4] = [10 * approach + 2, 1000 * sort + 5, ROD, subcase]
        head[[8, 9, 10]] = [1, 5, 11]
        rows = np.zeros((len(elements), 5), real)
        rows[:, 1] = values
        rows.view(integer)[:, 0] = 10 * np.asarray(elements) + 2
        parts += [logical(-4 - 2 * k, head.tobytes()), logical(-5 - 2 * k, rows.tobytes())]
    return b"".join(parts) + key(0) + key(0)


def punch_block(subcase: int, element_type: int, rows: Sequence[Sequence[float]], what: str = "STRAINS") -> str:
    """Return the lines of one subcase and type: an element's number and its values per row."""
    lines = ["$TITLE   =", "$SUBTITLE=", "$LABEL   =", f"$ELEMENT {what}", "$REAL OUTPUT"]
    lines += [f"$SUBCASE ID ={subcase:12d}", f"$ELEMENT TYPE ={element_type:12d}  NAME"]
    for element, *values in rows:
        cells = [f"{value:18d}" if isinstance(value, int) else f"{value:18.6E}" for value in values]
        for k in range(0, len(cells), 3):
            first = f"{element:10d}        " if k == 0 else "-CONT-            "
            lines.append(first + "".join(cells[k : k + 3]))
    return "".join(f"{line:72}{number:8d}\n" for number, line in enumerate(lines, 1))


def write_gauges(path: Path, columns: Sequence[str], elements: Sequence[int]) -> Path:
    """Write the table of gauges that are rods."""
    lines = [f"{column},{element}" for column, element in zip(columns, elements, strict=True)]
    path.write_text("\n".join(["column,element", *lines]) + "\n")
    return path
