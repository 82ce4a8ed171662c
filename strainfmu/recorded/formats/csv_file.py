"""Text files of recorders as channels, read in pieces: one line of headings, one sample a line."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from functools import cache
from pathlib import Path

import numpy as np

from strainfmu.recorded.columns.column_names import name_and_unit
from strainfmu.recorded.formats.channel_file import ChannelFile, Reading, Rows
from strainfmu.recorded.formats.csv_layout import NUMBER, csv_layout
from strainfmu.recorded.formats.csv_rows import RowReader, iso_time, time_notes


@contextmanager
def csv_channels(path: Path, reading: Reading) -> Iterator[ChannelFile]:
    """Open a text file with columns; its headings are found by the names that ``reading`` knows."""
    layout = csv_layout(path, reading.is_known)
    parts = [name_and_unit(heading) for heading in layout.headings]
    names = [name for name, _ in parts]
    units = [unit if layout.units is None else layout.units[i] for i, (_, unit) in enumerate(parts)]
    known = [i for i, name in enumerate(names) if reading.is_known(name)]
    times = [i for i in known if _is_iso(layout.first_row, i)]

    def pieces(of: Sequence[int]) -> Iterator[Rows]:
        return RowReader(path=path, layout=layout, names=names, columns=of, dated=frozenset(times)).pieces()

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
        notes={names[i]: note for i in times for note in time_notes(path, layout, names=names, time=i)},
        rows=lambda of: pieces([names.index(name) for name in of]),
        length=path.stat().st_size,
        lines=lambda: table().lines,
    )


def _is_iso(row: tuple[str, ...], column: int) -> bool:
    text = row[column].strip() if column < len(row) else ""
    return NUMBER.fullmatch(text) is None and iso_time(text) is not None
