"""Whole pieces of CSV text as numbers, by pyarrow where it is installed; what it does not read is left to csv."""

from __future__ import annotations

from collections.abc import Container, Sequence
from functools import cache
from io import BytesIO
from typing import Any

import numpy as np

from strainfmu.arrays import FloatArray
from strainfmu.recorded.formats.cells import NO_READING, OVERLOAD

_NO_VALUE = [
    *("", "-", "--", "---", "----"),
    *dict.fromkeys(
        sign + form
        for text in (*OVERLOAD, *NO_READING)
        for form in (text, text.upper(), text.lower(), text.capitalize())
        for sign in ("", "+", "-")
    ),
]
"""The usual ones of the texts without a value; a piece with others is left to csv."""


@cache
def _library() -> Any:
    """Return the module pyarrow.csv, None where it is not installed."""
    try:
        import pyarrow.csv
    except ImportError:
        return None
    return pyarrow.csv


def arrow_columns(
    text: str, *, width: int, columns: Sequence[int], texts: Container[int], delimiter: str, mark: str
) -> list[Any] | None:
    """Return the columns of a piece of text, (n,) numbers each, or texts; None where csv must read it.

    Nothing is found here that csv would not find: a piece in which a cell is no plain number, a line has another
    number of cells or is empty, or a cell is in quotes, is None.

    Parameters
    ----------
    text : whole lines.
    width : number of cells of each line.
    columns : those to read.
    texts : the columns among them that are texts.
    mark : decimal mark.
    """
    arrow = _library()
    if arrow is None or '"' in text or "(" in text:  # pyarrow takes nan(1) for a number
        return None
    data = text.encode()
    names = [str(column) for column in range(width)]
    kinds = {str(column): "string" if column in texts else "float64" for column in columns}
    wanted = [str(column) for column in columns]
    try:
        table = arrow.read_csv(
            BytesIO(data),
            read_options=arrow.ReadOptions(column_names=names, use_threads=False, block_size=len(data) + 1),
            parse_options=arrow.ParseOptions(delimiter=delimiter, quote_char=False, ignore_empty_lines=True),
            convert_options=arrow.ConvertOptions(
                column_types=kinds,
                include_columns=wanted,
                null_values=_NO_VALUE,
                strings_can_be_null=False,
                decimal_point=mark or ".",
            ),
        )
    except Exception:  # pyarrow raises errors of several kinds
        return None
    if len(table) != text.count("\n") + (not text.endswith("\n")):
        return None
    found = [table.column(name) for name in wanted]
    values = [
        column.to_pylist() if int(name) in texts else _numbers(column)
        for name, column in zip(wanted, found, strict=True)
    ]
    has_infinite = any(isinstance(one, np.ndarray) and np.isinf(one).any() for one in values)
    return None if has_infinite else values


def _numbers(column: Any) -> FloatArray:
    return np.asarray(column.to_numpy(zero_copy_only=False), dtype=float)
