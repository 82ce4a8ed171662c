"""Text files of recorders: separators, header block, headings, units, then one sample a line, read in pieces.

The module csv parses the lines, pyarrow whole pieces of plain numbers. Libraries that find out a dialect know the
separator alone: no header block, no row of units, no decimal comma.
"""

import csv
import io
import re
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack
from dataclasses import dataclass, field
from functools import cache
from io import BytesIO
from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np

from strainfmu.arrays import FloatArray
from strainfmu.errors import InputError, importable
from strainfmu.recorded.names import name_and_unit, split_heading
from strainfmu.recorded.table import Column, Frame, Piece, Reading, Table
from strainfmu.text_cells import (
    NO_NUMBERS,
    NO_READING,
    NO_READING_MARKS,
    NUMBER,
    OVERLOAD,
    UNKNOWN_ORDER,
    Numerals,
    TimeForm,
    is_number,
    time_form,
)
from strainfmu.units import ALL_UNITS, NUMBER_UNITS

LONGEST_HEADER, SEEN = 200, 400
"""Lines among which the headings must be, and lines that are looked at in all."""

LONGEST_FOOTER = 100
"""Lines behind the samples that are left out."""

PIECE = 1 << 21
"""Characters that are read at a time, before the end of a line."""

BLANKS = " "
"""Separator of columns with blanks between them, of any number."""

_COMMENTS = ("#", "%", "//", "!", ";")
"""What may stand ahead of headings."""

_UNIT_LABELS = ("unit", "units", "einheit", "einheiten")
"""What stands ahead of a row of units in a column of labels, in small letters."""

_BYTE_ORDER_MARKS = (
    (b"\xef\xbb\xbf", "utf-8-sig"),
    (b"\xff\xfe\x00\x00", "utf-32"),
    (b"\x00\x00\xfe\xff", "utf-32"),
    (b"\xff\xfe", "utf-16"),
    (b"\xfe\xff", "utf-16"),
)
"""The longer ones first."""

_WORDS_WITH_UNITS = re.compile(r"[^\s\[(]+(?: ?(?:\[[^\]]*\]|\([^)]*\)))?|\S+")
"""Headings between blanks: one word each, with its unit."""

Line = tuple[int, int, list[str]]
"""Number of the line, from 1, of lines that it takes, and cells."""


@dataclass(eq=False, kw_only=True)
class _Samples:
    """Where what stands in a text, and its samples, which are read once.

    Attributes
    ----------
    encoding, delimiter : of the text; between the cells.
    columns : by the headings, ``column[k]`` where the file has none.
    forms : form of each column of dates and times, which become seconds from the first one on.
    lines_ahead : lines ahead of the first sample.
    width : cells of the first sample, 0 without one.
    numerals : how numbers are written, by the first samples.
    remarks : lines for the user; it takes more on what the cells show as they are read.
    """

    path: Path
    encoding: str
    delimiter: str
    columns: tuple[Column, ...]
    forms: dict[int, TimeForm]
    lines_ahead: int
    width: int
    numerals: Numerals
    remarks: list[str]
    _indices: Sequence[int] = ()
    _needed: int = 0
    _doubtful: list[tuple[int, str, InputError]] = field(default_factory=list)
    _empty: list[int] = field(default_factory=list)

    def pieces(self, indices: Sequence[int], begin: int = 0) -> Iterator[Piece]:
        """Yield the samples of the columns ``indices``, some thousand at a time, with their lines.

        Raises
        ------
        InputError
            A line has too few or too many cells, or a cell is no number.
        """
        assert not begin, "lines are not counted ahead"
        self._indices, self._needed = indices, max(indices, default=0) + 1
        size, width = self.path.stat().st_size, 4 if "32" in self.encoding else 2 if "16" in self.encoding else 1
        line, position, has_samples = self.lines_ahead, 0, False
        with self.path.open(encoding=self.encoding, errors="replace") as stream:  # every end of a line as "\n"
            for _ in range(line):
                stream.readline()
            while text := _next_lines(stream):
                if self.delimiter == BLANKS:
                    text = "".join(f"{' '.join(row.split())}\n" for row in text.splitlines())
                read = self._plain(text, line)
                if read is None:
                    read = self._rows(text, line)
                else:
                    self._refuse_doubtful()
                line += text.count("\n")
                position = position + width * len(text) if len(text) > PIECE else size
                lines, values = self._without_empty_end(*read)
                if len(lines):
                    has_samples = True
                    yield lines, values, position
        if not has_samples or len(self._doubtful) > LONGEST_FOOTER:
            self._refuse_doubtful()
        footer = sorted({*self._empty, *(line for line, *_ in self._doubtful)})
        if footer and has_samples:
            text = next((text for _, text, _ in self._doubtful), "")
            where = f"line {footer[0]}" if len(footer) == 1 else f"lines {footer[0]} to {footer[-1]}"
            self.remarks.append(
                f"{self.path}: {where}: at the end of the file, no sample: left out ('{text[:40]}')"
            )

    def _without_empty_end(self, lines: Any, values: list[FloatArray]) -> tuple[Any, list[FloatArray]]:
        """Return samples behind the empty ones that ended the piece before, without empty ones at their end."""
        if self._empty:
            lines = np.concatenate([self._empty, lines])
            values = [np.concatenate([np.full(len(self._empty), np.nan), column]) for column in values]
        n = len(lines)
        while n and all(np.isnan(column[n - 1]) for column in values):
            n -= 1
        self._empty = lines[n:].tolist()
        return lines[:n], [column[:n] for column in values]

    def _refuse_doubtful(self) -> None:
        """Raise what is wrong with lines that are not at the end, as samples follow them."""
        for *_, error in self._doubtful:
            raise error

    def _plain(self, text: str, ahead: int) -> tuple[Any, list[FloatArray]] | None:
        """Return line and numbers of each sample of a piece of plain numbers by pyarrow, None of any other.

        Nothing is read here that csv would not read: a piece in which a cell is no plain number, a line has
        another number of cells or is empty, or a cell is in quotes, is None.
        """
        mark, arrow = self.numerals.mark, importable("pyarrow.csv")
        # Without a mark so far the cells are to show it; pyarrow takes nan(1) for a number.
        if arrow is None or '"' in text or "(" in text or (not mark and ("." in text or "," in text)):
            return None
        width = max(len(self.columns), self.width)
        surplus = range(len(self.columns), width)
        dated = self.forms.keys() & set(self._indices)
        texts = {*dated, *surplus}
        names = {i: str(i) for i in (*self._indices, *surplus)}
        data = text.encode()
        try:
            table = arrow.read_csv(
                BytesIO(data),
                read_options=arrow.ReadOptions(
                    column_names=[str(i) for i in range(width)],
                    use_threads=False,
                    block_size=len(data) + 1,
                ),
                parse_options=arrow.ParseOptions(
                    delimiter=self.delimiter, quote_char=False, ignore_empty_lines=True
                ),
                convert_options=arrow.ConvertOptions(
                    column_types={name: "string" if i in texts else "float64" for i, name in names.items()},
                    include_columns=list(names.values()),
                    null_values=_NO_VALUE,
                    strings_can_be_null=False,
                    decimal_point=mark or ".",
                ),
            )
        except Exception:  # pyarrow raises errors of several kinds
            return None
        lines = np.arange(ahead + 1, ahead + 1 + text.count("\n") + (not text.endswith("\n")))
        cells = {i: table.column(names[i]).to_pylist() for i in texts}
        if len(table) != len(lines) or any(cell.strip() for i in surplus for cell in cells[i]):
            return None
        values = {i: _array(table.column(name)) for i, name in names.items() if i not in texts}
        for column in values.values():
            wild = np.abs(column) >= min(NO_NUMBERS)
            if np.isinf(column[wild]).any():
                return None
            column[wild & np.isin(np.abs(column), NO_NUMBERS)] = np.nan
        for i in dated:
            stamps = zip(cells[i], lines.tolist(), strict=True)
            values[i] = np.array([self._number(stamp.strip(), i, line) for stamp, line in stamps])
        return lines, [values[i] for i in self._indices]

    def _rows(self, text: str, ahead: int) -> tuple[Any, list[FloatArray]]:
        """Return line and numbers of each sample of a piece; ``ahead`` lines stand above it."""
        reader = csv.reader(io.StringIO(text, newline=""), delimiter=self.delimiter)
        lines, values = list[int](), list[list[float]]()
        is_cut, end = not text.endswith("\n"), text.count("\n") + 1
        try:
            for cells in reader:
                if not cells or (len(cells) == 1 and not cells[0].strip()):
                    continue
                line = ahead + reader.line_num
                try:
                    row = self._sample(cells, line, is_last=is_cut and reader.line_num == end)
                except _NoSample as error:
                    self._doubtful.append((line, self.delimiter.join(cells), error))
                    continue
                self._refuse_doubtful()
                lines.append(line)
                values.append(row)
        except csv.Error as error:
            raise InputError(f"{self.path}: line {ahead + reader.line_num}: {error}") from error
        table = np.array(values).reshape(len(lines), len(self._indices))
        return np.array(lines, dtype=int), list(np.ascontiguousarray(table.T))

    def _sample(self, cells: Sequence[str], line: int, is_last: bool) -> list[float]:
        """Return the cells in use as numbers; an empty cell is no value.

        A line that may end the file raises _NoSample: it has too few cells, a word for its time, or is cut.
        """
        # A surplus cell shifts all after it, as a decimal comma between commas does.
        surplus = any(cell.strip() for cell in cells[len(self.columns) :])
        is_short = len(cells) < self._needed or (is_last and len(cells) < self.width)
        if surplus or is_short:
            fault = f"{self.path}: line {line}: expected {len(self.columns)} cells, got {len(cells)}"
            raise (_NoSample if is_short else InputError)(fault)
        try:
            return [self._number(cells[i].strip(), i, line) for i in self._indices]
        except InputError as error:
            if is_last or not any(mark.isdigit() for mark in cells[self._indices[0]]):
                raise _NoSample(str(error)) from error
            raise

    def _number(self, text: str, column: int, line: int) -> float:
        if not text:
            return float("nan")
        was_grouped, name = self.numerals.grouped, self.columns[column].name
        try:
            number = self.forms[column].seconds(text) if column in self.forms else self.numerals.number(text)
        except ValueError as error:
            raise InputError(f"{self.path}: line {line}, column '{name}': {error}, got '{text[:40]}'") from error
        if self.numerals.grouped != was_grouped:
            self.remarks.append(
                f"{self.path}: line {line}, column '{name}': '{text}' read as {number:.12g}: numbers with "
                "separators of thousands"
            )
        return number


def _name_and_unit(
    path: Path, heading: str, stated: str, is_known: Callable[[str], bool]
) -> tuple[str, str | None]:
    """Return name and unit of a column by its heading, and by the unit that is ``stated`` below it."""
    name, unit = name_and_unit(heading, is_known)
    if unit and stated and unit != stated:
        raise InputError(
            f"{path}: column '{heading}': unit: expected one, got '{unit}' in the heading and '{stated}' below"
        )
    return name, stated or unit


def text_table(path: Path, reading: Reading, stack: ExitStack) -> Table:
    """Open a text with columns.

    The headings are the line with most names that ``reading`` knows, the first of several. Without any, they are
    the line ahead of the first line of numbers, and of a row of units, if it has as many cells; else the columns
    are ``column[k]``.

    Raises
    ------
    InputError
        There are no headings, the file is no text, a column has two units, or the order of a date is not
        known.
    """
    encoding, is_known = text_encoding(path), cache(reading.is_known)
    lines = _first_lines(path, encoding)
    if any("\x00" in line.rstrip("\x00") for line in lines):
        raise InputError(f"{path}: damaged, or not a CSV file: expected text, got bytes of 0")
    delimiter, index, rows = _heading_row(lines, is_known)
    below = rows if index is None else rows[index + 1 :]
    width = len(next((cells for *_, cells in below if _is_row_of_numbers(cells)), []))
    start = 1
    if index is None:
        headings = [f"column[{i}]" for i in range(1, width + 1)]
    else:
        number, n_lines, cells = rows[index]
        headings, start = _headings(cells, lines[number - 1], delimiter, width), number + n_lines
    while headings and not headings[-1].strip():
        headings.pop()  # what stands below is refused unless it is empty too
    if not headings:
        raise InputError(f"{path}: no headings found in the first line")
    used = [i for i, heading in enumerate(headings) if is_known(split_heading(heading)[0])]
    used = used or list(range(len(headings)))
    ahead, units, passed = _rows_of_information([cells for *_, cells in below], used)
    filled = [line for line in below[ahead:] if any(cell.strip() for cell in line[2])]
    numerals = Numerals("," if delimiter == "," else "")
    numerals.learn(cells[i].strip() for *_, cells in filled for i in used if i < len(cells))
    if below:
        start = below[ahead][0] if ahead < len(below) else sum(below[-1][:2])
    first_line, _, first_row = filled[0] if filled else (start, 0, [])
    columns, forms, remarks = list[Column](), dict[int, TimeForm](), list[str]()
    for i, heading in enumerate(headings):
        stated = _unit(units[i]) if i < len(units) else ""
        first = first_row[i].strip() if i < len(first_row) else ""
        name, unit = _name_and_unit(path, heading, stated, is_known)
        is_time = is_known(name) and bool(first) and not is_number(first)
        form = time_form(first, reading.date_order) if is_time else None
        if form is None:
            columns.append(Column(name=name, unit=unit, heading=heading))
            continue
        if form.words == UNKNOWN_ORDER:
            raise InputError(
                f"{path}: line {first_line}, column '{name}': expected a date whose order of day and month is "
                f"known, got '{first}'; state --date-order day or month, or [time] date_order in channels.toml"
            )
        forms[i], dated = form, f"column '{name}': times {form.words}, read as seconds since {first}"
        columns.append(Column(name=name, unit="s", heading=heading, dated=dated))
    if passed:
        shown = ", ".join(f"{below[row][0]} ('{label[:30]}')" for row, label in passed[:6])
        more = f" and {len(passed) - 6} more" if len(passed) > 6 else ""
        remarks.append(f"{path}: between headings and samples, not read: line {shown}{more}")
    samples = _Samples(
        path=path,
        encoding=encoding,
        delimiter=delimiter,
        columns=tuple(columns),
        forms=forms,
        lines_ahead=start - 1,
        width=len(first_row),
        numerals=numerals,
        remarks=remarks,
    )
    length = path.stat().st_size
    frame = Frame(columns=samples.columns, pieces=samples.pieces, length=length, counted="line")
    return Table(path, (frame,), remarks)


def _first_lines(path: Path, encoding: str) -> list[str]:
    with path.open(newline="", encoding=encoding, errors="replace") as stream:
        return list(islice(stream, SEEN))


def is_table(path: Path) -> bool:
    """Return whether a file is a text with a line of several numbers, whatever its suffix."""
    lines = _first_lines(path, text_encoding(path))
    tables = (_rows(lines, delimiter) for delimiter in (*",;\t|", BLANKS))
    return not any("\x00" in line for line in lines) and any(_first_numbers(rows) is not None for rows in tables)


def text_encoding(path: Path) -> str:
    """Return the encoding: by a byte-order mark, by zeros of UTF-16, UTF-8 where that is valid, else Latin-1."""
    with path.open("rb") as stream:
        head = stream.read(1 << 18)
    marked = next((name for mark, name in _BYTE_ORDER_MARKS if head.startswith(mark)), None)
    if marked is not None:
        return marked
    even, odd = head[0:2000:2].count(0), head[1:2000:2].count(0)
    if max(even, odd) > len(head[:2000]) // 8 and min(even, odd) == 0:
        return "utf-16-le" if odd else "utf-16-be"
    try:
        head[: head.rfind(b"\n") + 1].decode("utf-8")
    except UnicodeDecodeError:
        return "cp1252"  # Latin-1 with what Windows adds to it
    return "utf-8"


def _rows(lines: Sequence[str], delimiter: str) -> list[Line]:
    """Return the rows of lines; cells in quotes may take several. A line that csv refuses is an empty one."""
    if delimiter == BLANKS:
        return [(number, 1, line.split()) for number, line in enumerate(lines, start=1)]
    rows, last = list[Line](), 0
    reader = csv.reader(lines, delimiter=delimiter)
    while last < len(lines):
        try:
            cells = next(reader, None)
        except csv.Error:
            cells = []
        if cells is None or reader.line_num == last:
            break
        rows.append((last + 1, reader.line_num - last, cells))
        last = reader.line_num
    return rows


def _heading_row(lines: Sequence[str], is_known: Callable[[str], bool]) -> tuple[str, int | None, list[Line]]:
    """Return the delimiter, the index of the row of headings, None of a file without, and all rows."""
    tables = {delimiter: _rows(lines, delimiter) for delimiter in ",;\t|"}
    best, chosen = 0, ("", 0, list[Line]())
    for delimiter, rows in tables.items():
        for index, (number, _, cells) in enumerate(rows):
            if number <= LONGEST_HEADER and len(cells) > best and (score := _known(cells, is_known)) > best:
                best, chosen = score, (delimiter, index, rows)
    if best:
        return chosen
    first = {delimiter: _first_numbers(rows) for delimiter, rows in tables.items()}
    if all(index is None for index in first.values()):
        blanks = _rows(lines, BLANKS)
        of_blanks = _first_numbers(blanks)
        if of_blanks is None:
            delimiter = max(tables, key=lines[0].count) if lines else ","
            return delimiter, 0 if tables[delimiter] else None, tables[delimiter]
        width = len(blanks[of_blanks][2])
        scores = [_known(_among_blanks(line, width), is_known) for line in lines[:LONGEST_HEADER]]
        if any(scores):
            return BLANKS, scores.index(max(scores)), blanks
        tables, first = {BLANKS: blanks}, {BLANKS: of_blanks}
    delimiter, index = next((delimiter, index) for delimiter, index in first.items() if index is not None)
    rows = tables[delimiter]
    filled = [row for row in range(index) if any(cell.strip() for cell in rows[row][2])]
    if len(filled) > 1 and _is_row_of_units(rows[filled[-1]][2]):
        filled.pop()
    is_heading = filled and (delimiter == BLANKS or len(_uncommented(rows[filled[-1]][2])) >= len(rows[index][2]))
    return delimiter, filled[-1] if is_heading else None, rows


def _known(cells: Sequence[str], is_known: Callable[[str], bool]) -> int:
    """Return how many of the cells are known names, with or without a unit."""
    names = (cell for cell in _uncommented(cells) if cell and not NUMBER.fullmatch(cell))
    return sum(is_known(split_heading(cell)[0]) for cell in names)


def _first_numbers(rows: Sequence[Line]) -> int | None:
    """Return the index of the first row of numbers, None without one."""
    return next((index for index, row in enumerate(rows) if _is_row_of_numbers(row[2])), None)


def _among_blanks(line: str, width: int) -> list[str]:
    """Return the ``width`` headings of a line with blanks between them; words as they are if none fits."""
    text = " ".join(_uncommented([line]))
    splits = (re.split(r"\s{2,}", text.strip()), _WORDS_WITH_UNITS.findall(text), text.split())
    return next((cells for cells in splits if len(cells) == width), splits[-1])


def _headings(cells: Sequence[str], line: str, delimiter: str, width: int) -> list[str]:
    """Return the headings of a row, ``line`` as it stands in the file, above rows of ``width`` numbers."""
    if delimiter == BLANKS:
        return _among_blanks(line, width or len(cells))
    headings = [" ".join(cell.split()) for cell in _uncommented(cells)]
    is_mark = len(headings) == width + 1 > 1 and not headings[0] and cells[0].strip() in _COMMENTS
    return headings[1:] if is_mark else headings


def _uncommented(cells: Sequence[str]) -> list[str]:
    """Return cells without a mark of a comment ahead of the first."""
    first = cells[0].strip() if cells else ""
    mark = next((mark for mark in _COMMENTS if first.startswith(mark)), "")
    return [first.removeprefix(mark).strip(), *cells[1:]] if mark else list(cells)


def _rows_of_information(
    rows: Sequence[Sequence[str]], used: Sequence[int]
) -> tuple[int, Sequence[str], list[tuple[int, str]]]:
    """Return the number of rows ahead of the first sample, a row of units, empty without one, and the other rows.

    Ahead of the samples may stand, for each channel, its unit, rate, range or date. No row is passed over where no
    sample follows it: what is wrong in a file without samples is said of its first row.
    """
    samples = (index for index, row in enumerate(rows) if _is_sample(row, used) and not _is_row_of_units(row))
    first = next(samples, None)
    units, passed, ahead = list[str](), list[tuple[int, str]](), 0
    for index, row in enumerate(rows[:first]):
        if not any(cell.strip() for cell in row):
            continue
        if not units and _is_row_of_units(row):
            units, ahead = list(row), index + 1
        elif first is not None:
            passed.append((index, row[0].strip()))
    return (ahead if first is None else first), units, passed


def _is_sample(row: Sequence[str], used: Sequence[int]) -> bool:
    """Return whether a row is a sample rather than a text for each channel, or numbers behind a label."""
    cells = [row[i].strip() if i < len(row) else "" for i in used]
    values = [is_number(cell) or time_form(cell, None) is not None for cell in cells]
    label = row[0].strip() if row else ""
    has_label = bool(label) and used[0] == 0 and not values[0]
    return any(values) and not has_label


def _is_row_of_numbers(cells: Sequence[str]) -> bool:
    """Return whether there are several cells, all of them numbers, times or empty."""
    texts = [text for cell in cells if (text := cell.strip())]
    kinds = (is_number(text) or (":" in text and time_form(text, None) is not None) for text in texts)
    return len(cells) > 1 and bool(texts) and all(kinds)


def _unit(cell: str) -> str:
    """Return the unit that a cell states, without brackets; "" for a label of such a row."""
    text = cell.strip()
    if text.casefold().rstrip(":") in _UNIT_LABELS:
        return ""
    return text[1:-1].strip() if text[:1] + text[-1:] in ("[]", "()") else text


def _is_row_of_units(cells: Sequence[str]) -> bool:
    """Return whether the cells are units: at least one known unit that is no number, and no number."""
    units = [unit for cell in cells if (unit := _unit(cell))]
    return not any(unit != "1" and is_number(unit) and unit not in NUMBER_UNITS for unit in units) and any(
        unit in ALL_UNITS and unit not in NUMBER_UNITS for unit in units
    )


class _NoSample(InputError):
    """A line is no sample, as lines at the end of a file may be."""


def _next_lines(stream: io.TextIOBase) -> str:
    """Return the next whole lines of a text, "" at its end; a cell in quotes may hold the end of a line."""
    text = stream.read(PIECE) + stream.readline()
    while text.count('"') % 2 and len(text) < 2 * PIECE and (more := stream.readline()):
        text += more
    return text.rstrip("\x00")  # of a recorder that takes room ahead


_NO_VALUE = [
    *("", *(n * mark for mark in NO_READING_MARKS for n in range(1, 9))),
    *dict.fromkeys(
        sign + form
        for text in (*OVERLOAD, *NO_READING)
        for form in (text, text.upper(), text.lower(), text.capitalize())
        for sign in ("", "+", "-")
    ),
]
"""The usual ones of the texts without a value; a piece with others is read by csv."""


def _array(column: Any) -> FloatArray:
    """Return numbers, NaN for none; Arrow's own conversion would import pandas."""
    chunks = [chunk.fill_null(np.nan) if chunk.null_count else chunk for chunk in column.chunks]
    return np.concatenate([np.empty(0), *map(np.from_dlpack, chunks)])
