"""Samples of a recording in SI units: what is read of a table, checked, on one raster, in blocks of rows.

Columns of other frames, and with a channel file columns that are mostly empty, have other times than the samples.
They get values at the times of the samples as the recording is read, from rows that are near: memory does not grow
with its length.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import NamedTuple

import numpy as np

from strainfmu.arrays import FloatArray, IntArray
from strainfmu.errors import InputError
from strainfmu.estimator.air_inputs import DYNAMIC_PRESSURE, STATIC_PRESSURE, STD
from strainfmu.recorded.channel_map import JOINS, ChannelMap, Join, load_channels
from strainfmu.recorded.formats import open_table
from strainfmu.recorded.names import QUANTITIES, Wanted, endings, plain_name, time_rank
from strainfmu.recorded.selection import Selection, Source, computed_pressure, select
from strainfmu.recorded.strain_level import level_of, likely_units
from strainfmu.recorded.table import BLOCK_ROWS, Reading

LOOK_ROWS = 4096
"""Rows at the start of a recording that show which columns are mostly empty, and the periods of rasters."""

LONGEST_GAP = 2.5
"""Longest gap that is interpolated or held over, in periods of the column's own raster."""

FARTHEST = 0.51
"""Farthest sample that is the nearest one, in periods of the column's own raster."""

SPARSE = 0.5
"""Part of a column's rows with a value below which these rows are its own, slower raster."""

LARGEST_STRAIN = 0.1
"""Strain [m/m] above which all columns are taken to be in another unit: no gauge bears it."""

_FIRST_DAY, _SHORTEST_PERIOD = 2e4, 2e-6
"""Times above the first in steps below the second are days, as a spreadsheet counts them: of 1954 and later, at
6 Hz and more. No recorder of strain takes 500,000 samples in a second."""

_SAME = 1e-3
"""Distance from a sample, in periods, that is none."""

_GAPS_LISTED = 20


class Part(NamedTuple):
    """Rows of a recording: from ``first`` up to ``stop``, counted from 0.

    Rows from ``begin`` on lead in, and the block behind the last row is read too: what an estimate of a part takes
    from its neighbours. All three are whole pieces of a recording that states its rows.
    """

    begin: int = 0
    first: int = 0
    stop: int = sys.maxsize


WHOLE = Part()
"""All rows of any recording."""


@dataclass(frozen=True, eq=False)
class Samples:
    """Successive samples of n_d gauges.

    Attributes
    ----------
    time : (n,) [s].
    strain : (n, n_d) [m/m], NaN where a gauge has no value.
    flow : (n,) of each other quantity that is read, by its name [SI units], NaN where it is not known: q_inf
        always, and what the file has of flow, motion, flow parameters, auxiliary sensors, and ``temperature[k]``.
    position : that they reach in the file.
    is_counted : whether they are of the rows to estimate, rather than of their neighbours.
    faults : n texts on strains that were taken out, "" for none; see
        :class:`~strainfmu.recorded.checks.StrainFaults`.
    """

    time: FloatArray
    strain: FloatArray
    flow: Mapping[str, FloatArray]
    position: int = 0
    is_counted: bool = True
    faults: tuple[str, ...] = ()

    def __getitem__(self, rows: slice) -> Samples:
        """Return some of the samples."""
        flow = {name: values[rows] for name, values in self.flow.items()}
        return replace(self, time=self.time[rows], strain=self.strain[rows], flow=flow, faults=self.faults[rows])

    @property
    def dynamic_pressure(self) -> FloatArray:
        """(n,) q_inf [Pa], NaN where it is not known."""
        return self.flow[DYNAMIC_PRESSURE]

    def values(self, names: Sequence[str]) -> dict[str, FloatArray]:
        """Return (n,) each of some quantities of the flow, NaN of one that is not read."""
        unknown = np.full(len(self.time), np.nan)
        return {name: self.flow.get(name, unknown) for name in names}


@dataclass
class Gaps:
    """Times between samples that are much longer than between the first ones.

    Attributes
    ----------
    where, counted : file and column of the times, and what its places are, ``row`` or ``line``.
    period : median time between samples of the first block [s].
    number, longest, behind : gaps, length of the longest [s], and the row or line ahead of it.
    first : begin and length [s] of the first gaps.
    """

    where: str = ""
    counted: str = "row"
    period: float = float("nan")
    number: int = 0
    longest: float = 0.0
    last_place: int = 0
    first: list[tuple[float, float]] = field(default_factory=list)
    _last: float = float("nan")
    _place: int = 0

    def add(self, time: FloatArray, places: IntArray, *, is_counted: bool = True) -> None:
        """Take the times of the next samples, and their rows or lines; count the gaps ahead of each."""
        if np.isnan(self.period) and len(time) > 1:
            self.period = float(np.median(np.diff(time)))
        ahead = np.append(self._place, places[:-1])
        before = np.append(self._last if np.isfinite(self._last) else time[0], time[:-1])
        self._last, self._place = float(time[-1]), int(places[-1])
        if not is_counted:
            return
        steps = time - before
        gaps = np.flatnonzero(steps > LONGEST_GAP * self.period)
        if len(gaps):
            longest = int(gaps[np.argmax(steps[gaps])])
            if steps[longest] > self.longest:
                self.longest, self.last_place = float(steps[longest]), int(ahead[longest])
            self.number += len(gaps)
            self.first += zip(before[gaps].tolist(), steps[gaps].tolist(), strict=True)
            del self.first[_GAPS_LISTED:]

    def take(self, later: Gaps) -> None:
        """Add the gaps of samples that come later."""
        self.period = later.period if np.isnan(self.period) else self.period
        if later.longest > self.longest:
            self.longest, self.last_place = later.longest, later.last_place
        self.number += later.number
        self.first = [*self.first, *later.first][:_GAPS_LISTED]

    def notes(self) -> list[str]:
        """Return a line for the user where there are gaps."""
        if not self.number:
            return []
        many = f"{self.number} gaps, the longest of" if self.number > 1 else "a gap of"
        return [
            f"{self.where}: {many} {self.longest:.6g} s behind {self.counted} {self.last_place}; samples are "
            f"{self.period:.6g} s apart"
        ]


@dataclass(eq=False, kw_only=True)
class Recording:
    """An open recording.

    Attributes
    ----------
    selection : what is read of it.
    blocks : its samples.
    length : position at the end.
    rows : number of rows, where it can be read from any row on; None of a text, and of several rasters.
    notes : lines for the user, complete when the blocks have been read; so are ``gaps``.
    """

    selection: Selection
    blocks: Iterator[Samples]
    length: int
    rows: int | None
    notes: list[str]
    gaps: Gaps


@contextmanager
def open_recording(
    path: Path, wanted: Wanted, channels: Path | None = None, part: Part = WHOLE
) -> Iterator[Recording]:
    """Open recorded strains for reading block by block; ``channels`` states which channel is which gauge.

    Raises
    ------
    InputError
        The file is missing, damaged or of another kind, holds no sample, or a column, a unit, a shape or a number
        is wrong.
    StrainfmuError
        The reader of its kind is not installed.
    """
    channel_map = None if channels is None else load_channels(channels)
    order, stated = wanted.date_order, channel_map.date_order if channel_map else None
    if None not in (order, stated) and order != stated:
        raise InputError(f"--date-order {order}: expected as in {channels}, [time] date_order = '{stated}'")
    reading = Reading(
        is_known=wanted.reads if channel_map is None else _known_names(channel_map, wanted),
        date_order=stated or order,
        time=(channel_map.time if channel_map else None) or "",
    )
    with open_table(path, reading) as table:
        yield _recording(select(table, wanted, channel_map), part)


def _known_names(channel_map: ChannelMap, wanted: Wanted) -> Callable[[str], bool]:
    """Return whether a name is stated in a channel file, or is a quantity's own, behind an instance's or not."""
    stated = [channel.name for channel in (*channel_map.strain, *channel_map.flow)]
    stated += [name for name in (channel_map.time, channel_map.raster) if name is not None]
    by_name = (*wanted.temperatures, *wanted.sensors, *wanted.parameters, *QUANTITIES)
    known = {plain_name(name) for name in by_name}.union(*map(endings, stated))
    return lambda name: not known.isdisjoint(endings(name)) or time_rank(name) is not None


def _recording(selection: Selection, part: Part) -> Recording:
    table, (base, tracks) = selection.table, _tracks(selection, part.begin)
    join = selection.channel_map.join if selection.channel_map else Join()
    frame, time_column = table.frames[base.frame], selection.times[base.frame][0]
    time = "time" if time_column is None else frame.columns[time_column].name
    gaps = Gaps(f"{table.path}: column '{time}'", frame.counted)
    table.remarks.extend(_join_notes(table.path, base, tracks, join))
    keys = (*base.keys, *(key for track in tracks for key in track.keys))

    def blocks() -> Iterator[Samples]:
        place = 0
        while place <= part.stop and len((rows := base.next_rows()).time):
            columns = [rows.values, *(track.values_at(rows.time, join) for track in tracks)]
            place = int(rows.places[-1])
            is_counted = part.first < place <= part.stop
            gaps.add(rows.time, rows.places, is_counted=is_counted)
            values = np.hstack(columns) if tracks else rows.values
            samples = _samples(selection, keys, rows._replace(values=values), frame.counted)
            yield samples if is_counted else replace(samples, is_counted=False)
        if not base.position:
            raise InputError(f"{table.path}: no samples found")
        if part == WHOLE:
            table.remarks.extend(gaps.notes())

    rows = None if tracks or base.is_sparse else frame.rows
    return Recording(
        selection=selection, blocks=blocks(), length=frame.length, rows=rows, notes=table.remarks, gaps=gaps
    )


# --- rows of frames as tracks, each with times of its own ------------------------------------------------------


class _Rows(NamedTuple):
    """Rows of a frame: (n,) times [s], (n,) rows or lines, (n, n_c) values, and the position reached."""

    time: FloatArray
    places: IntArray
    values: FloatArray
    position: int


def _frame_rows(selection: Selection, number: int, sources: Sequence[Source], begin: int) -> Iterator[_Rows]:
    """Yield the rows of some columns of a frame from one on, in SI units, piece by piece; refuse infinite ones."""
    path, frame, (time_column, factor) = selection.path, selection.table.frames[number], selection.times[number]
    columns = [source.column.place[1] for source in sources]
    read, last = begin, -np.inf
    for places, values, position in frame.pieces(
        columns if time_column is None else [time_column, *columns], begin
    ):
        n = len(places)
        time = np.arange(read, read + n) / factor
        if time_column is not None:
            stated, *values = values
            time = stated * factor
            where = f"{path}: column '{frame.columns[time_column].name}', {frame.counted}"
            _check_time(where, stated, time, places, last)
            if factor == 1.0 and n > 1 and time[0] > _FIRST_DAY and np.median(np.diff(time)) < _SHORTEST_PERIOD:
                raise InputError(
                    f"{where} {places[0]}: expected seconds, got {time[0]:.9g} and steps of "
                    f"{time[1] - time[0]:.3g}: likely days of a spreadsheet; state the unit, as in 'time [d]'"
                )
        series = np.array(values)  # of each column contiguous, up to the records of the estimator
        if np.isinf(series).any():  # NaN stands for "no value" in a file, an overflow does not
            column, row = divmod(int(np.argmax(np.isinf(series))), n)
            raise InputError(
                f"{path}: column '{sources[column].column.full}', {frame.counted} {places[row]}: expected a "
                f"finite number or NaN, got {series[column, row]:g}"
            )
        read, last = read + n, float(time[-1]) if n else last
        for i, (_, convert) in enumerate(sources):
            if convert is not None:
                series[i] = convert(series[i])
        yield _Rows(time, places, series.T, position)


def _check_time(where: str, stated: FloatArray, time: FloatArray, places: IntArray, last: float) -> None:
    """Refuse times (n,) that are none, or not later than those before, the first than ``last``."""
    wrong = np.flatnonzero(~np.isfinite(time))
    if len(wrong):
        number = stated[wrong[0]]
        what = "no number found" if np.isnan(number) else f"expected a finite number or NaN, got {number:g}"
        raise InputError(f"{where} {places[wrong[0]]}: {what}")
    before = np.append(last, time[:-1])
    back = np.flatnonzero(~(time > before))
    if len(back):
        raise InputError(
            f"{where} {places[back[0]]}: expected increasing times, got {time[back[0]]:.9g} s after "
            f"{before[back[0]]:.9g} s"
        )


@dataclass(eq=False)
class _Track:
    """Columns with times of their own: rows that have been read and not yet used.

    Attributes
    ----------
    frame, columns : number of the frame, and of the columns among those that are read of it.
    keys, names : quantities, and names of the columns, in the order of the columns of ``values`` (k, n_c).
    is_sparse : whether rows without a value are left out.
    advance : reads the next rows of the frame for all its tracks.
    time, places : (k,) [s], rows or lines of the file.
    position, reach : position and time [s] that have been read.
    period : median time between rows [s], NaN of fewer than two.
    is_done : whether all has been read.
    """

    frame: int
    columns: Sequence[int]
    keys: list[str]
    names: list[str]
    is_sparse: bool
    advance: Callable[[], None]
    time: FloatArray = field(default_factory=lambda: np.empty(0))
    places: IntArray = field(default_factory=lambda: np.empty(0, dtype=np.int64))
    values: FloatArray = field(default_factory=lambda: np.empty((0, 0)))
    position: int = 0
    reach: float = -np.inf
    period: float = float("nan")
    is_done: bool = False

    def take(self, rows: _Rows | None) -> None:
        """Take rows of the frame, None at its end."""
        if rows is None:
            self.is_done, self.reach = True, np.inf
            return
        time, places, values, self.position = rows
        self.reach = float(time[-1]) if len(time) else self.reach
        values = values if len(self.columns) == values.shape[1] else values[:, self.columns]
        if self.is_sparse:
            has_value = np.isfinite(values[:, 0])
            time, places, values = time[has_value], places[has_value], values[has_value]
        self.time, self.places = np.append(self.time, time), np.append(self.places, places)
        self.values = np.vstack([self.values, values]) if len(self.values) else values

    def next_rows(self) -> _Rows:
        """Return the next block of rows and forget them; none at the end."""
        while len(self.time) < BLOCK_ROWS and not self.is_done:
            self.advance()
        n = BLOCK_ROWS
        rows = _Rows(self.time[:n], self.places[:n], self.values[:n], self.position)
        self._drop(n)
        return rows

    def look(self) -> None:
        """Take the period from the rows at the start."""
        if len(self.time) > 1:
            self.period = float(np.median(np.diff(self.time[:LOOK_ROWS])))

    def is_like(self, second: _Track) -> bool:
        """Return whether the times at the start equal another track's, but for rounding."""
        n = min(len(self.time), len(second.time), LOOK_ROWS)
        ends = self.is_done and second.is_done and len(self.time) != len(second.time)
        period = self.period if np.isfinite(self.period) else second.period
        apart = np.abs(self.time[:n] - second.time[:n])
        return bool(n and not ends and (not apart.any() or (apart <= _SAME * period).all()))

    def values_at(self, times: FloatArray, join: Join) -> FloatArray:
        """Return the values (m, n_c) at times (m,) [s]; forget rows that are not needed again.

        Ahead of the first row and in gaps longer than the limit of ``join`` they are NaN, and behind the last
        unless that is held: a gap remains a gap.
        """
        while not self.is_done and not (len(self.time) > 1 and self.time[-1] > times[-1] + _SAME * self.period):
            if self.is_sparse and self.reach > times[-1] + 2.0 * np.nan_to_num(self._limit(join)):
                break
            self.advance()
        if not len(self.time):
            return np.full((len(times), len(self.keys)), np.nan)
        values = self._joined(times, join.rule, self._limit(join))
        self._drop(max(int(np.searchsorted(self.time, times[-1], side="right")) - 2, 0))
        return values

    def _drop(self, rows: int) -> None:
        self.time, self.places, self.values = self.time[rows:], self.places[rows:], self.values[rows:]

    def _limit(self, join: Join) -> float:
        if np.isnan(self.period):
            self.look()
        periods = FARTHEST if join.rule == "nearest" else LONGEST_GAP
        return periods * self.period if join.limit is None else join.limit

    def _joined(self, times: FloatArray, rule: str, limit: float) -> FloatArray:
        """Return (m, n_c) values at the (m,) times [s] by a rule of :data:`JOINS`; NaN beyond ``limit`` [s].

        A row at such a time has the value; else the row before or the nearest, or a straight line between two.
        """
        time, same = self.time, np.nan_to_num(_SAME * self.period)
        last = np.searchsorted(time, times + same, side="right") - 1
        row, following = np.maximum(last, 0), np.minimum(last + 1, len(time) - 1)
        if rule == "nearest":
            row = np.where(np.abs(time[following] - times) < np.abs(times - time[row]), following, row)
        reach = same if rule == "linear" else np.nan_to_num(limit) + same
        is_near = (np.abs(times - time[row]) <= reach) & ((last >= 0) | (rule != "hold"))
        values = np.where(is_near[:, None], self.values[row], np.nan)
        gap = time[following] - time[row]
        is_between = (rule == "linear") & ~is_near & (last >= 0) & (gap > 0.0) & (gap <= limit)
        if is_between.any():
            row, following = row[is_between], following[is_between]
            weight = ((times[is_between] - time[row]) / gap[is_between])[:, None]
            values[is_between] = (1.0 - weight) * self.values[row] + weight * self.values[following]
        return values


def _frame_tracks(selection: Selection, number: int, looks_ahead: bool, begin: int) -> list[_Track]:
    """Return the tracks of a frame: one of its raster, and with a channel file one of each mostly empty column."""
    sources = {key: source for key, source in selection.sources.items() if source.column.place[0] == number}
    frame_rows = _frame_rows(selection, number, [*sources.values()], begin)
    ahead, tracks = list[_Rows](), list[_Track]()
    n = 0
    while looks_ahead and n < LOOK_ROWS and (rows := next(frame_rows, None)) is not None:
        ahead.append(rows)
        n += len(rows.time)

    def advance() -> None:
        rows = next(frame_rows, None)
        for track in tracks:
            track.take(rows)

    keys, sparse = [*sources], list[int]()
    if selection.channel_map is not None and n:
        start = np.vstack([rows.values for rows in ahead])[:LOOK_ROWS]
        known = np.isfinite(start).sum(axis=0)
        sparse = [i for i in range(len(keys)) if known[i] < (1.0 - SPARSE) * len(start)]
    for columns in filter(None, [[i for i in range(len(keys)) if i not in sparse], *([i] for i in sparse)]):
        of_track = [keys[i] for i in columns]
        names = [sources[key].column.full for key in of_track]
        track = _Track(number, columns, of_track, names, columns[0] in sparse, advance)
        for rows in ahead:
            track.take(rows)
        if looks_ahead and n < LOOK_ROWS:
            track.take(None)
        track.look()
        tracks.append(track)
    return tracks


def _tracks(selection: Selection, begin: int) -> tuple[_Track, list[_Track]]:
    """Return the track with the times of the samples, and all others.

    The former has the raster that is stated, or of most gauges, of two the slower. Rows that do not ``begin`` with
    the first belong to a recording of one raster, as its first rows have shown.
    """
    looks_ahead = not begin and (selection.channel_map is not None or len(selection.times) > 1)
    tracks = [
        track for number in selection.times for track in _frame_tracks(selection, number, looks_ahead, begin)
    ]
    if selection.raster:
        base = next(track for track in tracks if selection.raster in track.keys)
    else:
        gauges = {track: len(selection.strain.keys() & set(track.keys)) for track in tracks}

        def rank(track: _Track) -> tuple[int, float]:
            alike = (n for second, n in gauges.items() if second is track or second.is_like(track))
            return sum(alike) if gauges[track] else 0, float(np.nan_to_num(track.period))

        base = max(tracks, key=rank)
    for track in tracks:
        if track is not base and not track.is_sparse and len(track.time) < 2 and not track.is_like(base):
            n = len(track.time)
            expected = f"two samples or more, got {n}" if n else "samples, got none"
            raise InputError(f"{selection.path}: column '{track.names[0]}': expected {expected}")
    return base, [track for track in tracks if track is not base]


def _join_notes(path: Path, base: _Track, tracks: Sequence[_Track], join: Join) -> list[str]:
    """Return a line on each raster whose columns are joined with the samples."""
    rasters: dict[float, list[str]] = {}
    for track in tracks:
        if len(track.time) > 1 and not track.is_like(base):
            rasters.setdefault(round(track.period, 9), []).extend(track.names)
    where = f"at the samples of '{base.names[0]}', every {1e3 * base.period:.6g} ms"
    return [
        f"{path}: {len(names)} columns of {1e3 * period:.6g} ms ('{names[0]}'{', ..' if names[1:] else ''}) "
        f"{JOINS[join.rule]} {where}"
        for period, names in rasters.items()
    ]


# --- samples of the signal table -------------------------------------------------------------------------------


def _samples(selection: Selection, keys: Sequence[str], rows: _Rows, counted: str) -> Samples:
    """Return the samples of rows, whose columns are gauges, legs or quantities by the ``keys``.

    A standard deviation that is negative is refused, and so are strains in another unit than stated.
    """

    def where(column: str, row: int) -> str:
        return f"{selection.path}: column '{column}', {counted} {rows.places[row]}"

    n, wanted = len(rows.time), selection.wanted
    strain = _strains(selection, keys, rows.values)
    flow = {name: np.ascontiguousarray(rows.values[:, keys.index(name)]) for name in selection.flow}
    for name, values in flow.items():
        negative = np.flatnonzero((values < 0.0) & name.endswith(STD))
        if len(negative):
            row, column = int(negative[0]), selection.flow[name].column.name
            raise InputError(f"{where(column, row)}: expected at least 0, got {values[row]:g}")
    _check_unit(selection, strain, where)
    if selection.computes_pressure:
        flow[DYNAMIC_PRESSURE] = computed_pressure(flow)
    if not wanted.navigates:
        flow.pop(STATIC_PRESSURE, None)
    fixed = float("nan") if wanted.fixed_pressure is None else wanted.fixed_pressure
    return Samples(rows.time, strain, {DYNAMIC_PRESSURE: np.full(n, fixed), **flow}, rows.position)


def _strains(selection: Selection, keys: Sequence[str], values: FloatArray) -> FloatArray:
    """Return (n, n_d) strains of the map's gauges by columns of ``values``; of rosettes they follow from legs."""
    gauges, unknown = selection.wanted.gauge_names, np.full(len(values), np.nan)
    rosettes = selection.channel_map.rosettes if selection.channel_map else ()
    if tuple(keys[: len(gauges)]) == gauges and not rosettes:
        return values[:, : len(gauges)]
    strain = np.full((len(gauges), len(values)), np.nan).T
    for i, gauge in enumerate(gauges):
        if gauge in selection.strain:
            strain[:, i] = values[:, keys.index(gauge)]
    names = {plain_name(gauge): i for i, gauge in enumerate(gauges)} if rosettes else {}
    for _, legs, weights in rosettes:
        of_legs = [values[:, keys.index(leg)] if leg in selection.strain else unknown for leg in legs]
        for name, of_gauge in weights.items():
            if plain_name(name) in names:
                # A leg without weight has no say, also where it has no value.
                parts = [w * leg for w, leg in zip(of_gauge, of_legs, strict=True) if w]
                strain[:, names[plain_name(name)]] = np.sum(parts, axis=0)
    return strain


def _check_unit(selection: Selection, strain: FloatArray, where: Callable[[str, int], str]) -> None:
    """Refuse strains that no gauge bears, if their median is so: single values are faults."""
    if not max(np.fmax.reduce(strain, axis=None), -np.fmin.reduce(strain, axis=None)) > LARGEST_STRAIN:
        return
    size = np.abs(strain)
    if not float(np.median(size[np.isfinite(size)])) > LARGEST_STRAIN:
        return
    reference, units = selection.wanted.reference, tuple[str, ...]()
    row, gauge = divmod(int(np.argmax(size > LARGEST_STRAIN)), strain.shape[1])
    name = selection.wanted.gauge_names[gauge]
    column = selection.strain[name].column.name if name in selection.strain else name
    if reference is not None:
        units = likely_units(reference.ratio(level_of(strain)), selection.strain_factor)
    likely = f"likely in {' or '.join(units)}, by the map's strains; " if units else ""
    raise InputError(
        f"{where(column, row)}: expected at most {LARGEST_STRAIN:g} m/m, got {strain[row, gauge]:g}; "
        f"{likely}state the unit, as in 'name [{units[0] if units else 'um/m'}]'"
    )
