"""Text files of recorders as channels, read in pieces: one line of headings, one sample a line."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from functools import cache
from pathlib import Path

import numpy as np

from strainfmu.errors import InputError
from strainfmu.recorded.columns.column_names import name_and_unit
from strainfmu.recorded.formats.cells import is_number
from strainfmu.recorded.formats.channel_file import ChannelFile, Reading, Rows
from strainfmu.recorded.formats.csv_layout import CsvLayout, csv_layout
from strainfmu.recorded.formats.csv_rows import RowReader
from strainfmu.recorded.formats.date_times import Order, TimeForm, time_form


@contextmanager
def csv_channels(path: Path, reading: Reading) -> Iterator[ChannelFile]:
    """Open a text file with columns; its headings are found by the names that ``reading`` knows."""
    layout = csv_layout(path, reading.is_known)
    parts = [name_and_unit(heading) for heading in layout.headings]
    names = [name for name, _ in parts]
    units = [unit if layout.units is None else layout.units[i] for i, (_, unit) in enumerate(parts)]
    known = [i for i, name in enumerate(names) if reading.is_known(name)]
    dated = _dated(path, layout, names, known, reading)
    remarks = _passed_over(path, layout)

    def pieces(of: Sequence[int]) -> Iterator[Rows]:
        return RowReader(path, layout, names=names, columns=of, dated=dated, remarks=remarks).pieces()

    @cache
    def table() -> Rows:
        held = list(pieces(known)) if known else []
        return Rows(
            np.concatenate([np.empty(0, dtype=int), *(one.lines for one in held)]),
            np.concatenate([np.empty((0, len(known))), *(one.values for one in held)]),
            path.stat().st_size,
        )

    yield ChannelFile(
        path=path,
        names=tuple(names),
        headings=layout.headings,
        units={name: unit for name, unit in zip(names, units, strict=True) if unit},
        values=lambda name: table().values[:, known.index(names.index(name))],
        notes={
            names[i]: f"{path}: column '{names[i]}': times {form.order.value}, read as seconds since "
            f"{layout.first_row[i].strip()}"
            for i, form in dated.items()
        },
        rows=lambda of: pieces([names.index(name) for name in of]),
        length=path.stat().st_size,
        lines=lambda: table().lines,
        remarks=remarks,
    )


def _dated(
    path: Path, layout: CsvLayout, names: Sequence[str], known: Sequence[int], reading: Reading
) -> dict[int, TimeForm]:
    """Return the form of each column that begins with a date or time.

    Raises
    ------
    InputError
        The order of day and month is not known.
    """
    found = dict[int, TimeForm]()
    for column in known:
        text = layout.first_row[column].strip() if column < len(layout.first_row) else ""
        form = None if not text or is_number(text) else time_form(text, reading.date_order)
        if form is not None and form.order is Order.UNKNOWN:
            raise InputError(
                f"{path}: line {layout.first_line}, column '{names[column]}': expected a date whose order of day "
                f"and month is known, got '{text}'; state --date-order day or month, or [time] date_order in "
                "channels.toml"
            )
        if form is not None:
            found[column] = form
    return found


def _passed_over(path: Path, layout: CsvLayout) -> list[str]:
    """Return a line for the user on rows of channel information that were not read."""
    if not layout.passed_over:
        return []
    shown = ", ".join(f"{line} ('{first[:30]}')" for line, first in layout.passed_over[:6])
    more = f" and {len(layout.passed_over) - 6} more" if len(layout.passed_over) > 6 else ""
    return [f"{path}: between headings and samples, not read: line {shown}{more}"]
