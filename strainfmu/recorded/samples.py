"""Samples of a recording in SI units: what is read of a table, checked, on one raster, in blocks of rows.

Columns of other frames, and with a channel file columns that are mostly empty, have other times than the samples.
They get values at the times of the samples as the recording is read, from rows that are near: memory does not grow
with its length.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import NamedTuple

import numpy as np

from strainfmu.arrays import BoolArray, FloatArray, IntArray
from strainfmu.errors import InputError
from strainfmu.estimator.air_inputs import DYNAMIC_PRESSURE, SAMPLE_INPUTS, STATIC_PRESSURE, STD
from strainfmu.recorded.channel_map import JOINS, Join, load_channels, rosette_weights
from strainfmu.recorded.formats import open_table
from strainfmu.recorded.names import (
    QUANTITIES,
    Wanted,
    endings,
    is_temperature,
    plain_name,
    temperature_quantities,
    time_rank,
)
from strainfmu.recorded.selection import Selection, computed_pressure, select
from strainfmu.recorded.strain_level import level_of, likely_units
from strainfmu.recorded.table import Piece, Reading, Table

BLOCK_ROWS = 2000
"""Samples in one block."""

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

_SAME = 1e-3
"""Distance from a sample, in periods, that is none."""

_GAPS_LISTED = 20

_NOT_NEGATIVE = tuple(quantity.name for quantity in SAMPLE_INPUTS if quantity.is_std)


@dataclass(frozen=True, eq=False)
class Samples:
    """Successive samples of n_d gauges.

    Attributes
    ----------
    time : (n,) [s].
    strain : (n, n_d) [m/m], NaN where a gauge has no value.
    dynamic_pressure : (n,) q_inf [Pa], NaN where it is not known.
    flow : (n,) of each other quantity of ``QUANTITIES`` that is read [SI units], NaN where it is not known.
    parameters, parameters_std : (n,) of each flow parameter that the file holds, as ``flow``, and
        its standard deviation.
    readings : (n,) of each auxiliary sensor, and thrust, that the file holds [SI unit], NaN where it has no value.
    temperature : (n, n_t) of the map's sensors [K], NaN where one gives none; None if the file holds none.
    faults : n texts on strains that were taken out, "" for none; see
        :class:`~strainfmu.recorded.checks.StrainFaults`.
    """

    time: FloatArray
    strain: FloatArray
    dynamic_pressure: FloatArray
    flow: Mapping[str, FloatArray] = field(default_factory=dict)
    temperature: FloatArray | None = None
    parameters: Mapping[str, FloatArray] = field(default_factory=dict)
    parameters_std: Mapping[str, FloatArray] = field(default_factory=dict)
    readings: Mapping[str, FloatArray] = field(default_factory=dict)
    faults: tuple[str, ...] = ()


@dataclass
class Gaps:
    """Times between samples that are much longer than between the first ones.

    Attributes
    ----------
    period : median time between samples of the first block [s].
    number, longest, behind : gaps, length of the longest [s], and the row or line ahead of it.
    first : begin and length [s] of the first gaps.
    """

    period: float = float("nan")
    number: int = 0
    longest: float = 0.0
    behind: int = 0
    first: list[tuple[float, float]] = field(default_factory=list)
    _last: float = float("nan")
    _place: int = 0

    def add(self, time: FloatArray, places: IntArray) -> None:
        """Take the times of the next samples, and their rows or lines."""
        if np.isnan(self.period) and len(time) > 1:
            self.period = float(np.median(np.diff(time)))
        ahead = np.append(self._place, places[:-1])
        before = np.append(self._last if np.isfinite(self._last) else time[0], time[:-1])
        steps = time - before
        gaps = np.flatnonzero(steps > LONGEST_GAP * self.period)
        if len(gaps):
            longest = int(gaps[np.argmax(steps[gaps])])
            if steps[longest] > self.longest:
                self.longest, self.behind = float(steps[longest]), int(ahead[longest])
            self.number += len(gaps)
            self.first += zip(before[gaps].tolist(), steps[gaps].tolist(), strict=True)
            del self.first[_GAPS_LISTED:]
        self._last, self._place = float(time[-1]), int(places[-1])


@dataclass(eq=False, kw_only=True)
class Recording:
    """An open recording.

    Attributes
    ----------
    selection : what is read of it.
    blocks : its samples, with the position that each block reaches.
    length : position at the end.
    notes : lines for the user.
    remarks : further lines, complete when the blocks have been read; so are ``gaps``.
    """

    selection: Selection
    blocks: Iterator[tuple[Samples, int]]
    length: int
    notes: tuple[str, ...]
    remarks: list[str]
    gaps: Gaps


@contextmanager
def open_recording(path: Path, wanted: Wanted, channels: Path | None = None) -> Iterator[Recording]:
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
    order, time = wanted.date_order, ""
    is_known: Callable[[str], bool] = wanted.reads
    if channel_map is not None:
        if None not in (order, channel_map.date_order) and order != channel_map.date_order:
            raise InputError(
                f"--date-order {order}: expected as in {channels}, [time] date_order = '{channel_map.date_order}'"
            )
        order, time = channel_map.date_order or order, channel_map.time or ""
        stated = [*(item.name for item in channel_map.channels), *(item.name for item in channel_map.flow)]
        stated += [name for name in (channel_map.time, channel_map.raster) if name is not None]
        is_known = _known_names(stated, wanted)
    with open_table(path, Reading(is_known=is_known, date_order=order, time=time)) as table:
        selection = select(table, wanted, channel_map)
        yield _recording(table, selection)


def _known_names(stated: Sequence[str], wanted: Wanted) -> Callable[[str], bool]:
    """Return whether a name is stated in a channel file, or is a quantity's own, behind an instance's or not."""
    own = (*temperature_quantities(wanted.sensors), *wanted.sensors, *wanted.parameters, *QUANTITIES)
    known = {plain_name(name) for name in own}.union(*map(endings, stated))
    return lambda name: not known.isdisjoint(endings(name)) or time_rank(name) is not None


def _recording(table: Table, selection: Selection) -> Recording:
    base, others = _tracks(table, selection)
    join, gaps, frame = selection.join or Join(), Gaps(), table.frames[base.reader.number]
    notes = (*table.remarks, *selection.notes, *_join_notes(table.path, base, others, join))
    table.remarks.clear()  # what follows is known when the samples have been read
    keys = (*base.keys, *(key for track in others for key in track.keys))

    def blocks() -> Iterator[tuple[Samples, int]]:
        while rows := base.next_rows():
            time, places, values = rows
            parts = [values, *(_at(track, time, join) for track in others)]
            block = _Block(selection, dict(zip(keys, np.hstack(parts).T, strict=True)), frame.counted, places)
            gaps.add(time, places)
            yield block.samples(time), base.position
        if not base.position:
            raise InputError(f"{table.path}: no samples found")
        if gaps.number:
            many = f"{gaps.number} gaps, the longest of" if gaps.number > 1 else "a gap of"
            table.remarks.append(
                f"{table.path}: column '{base.reader.time_name}': {many} {gaps.longest:.6g} s behind "
                f"{frame.counted} {gaps.behind}; samples are {gaps.period:.6g} s apart"
            )
        table.remarks[:] = [remark for remark in table.remarks if remark not in notes]

    return Recording(
        selection=selection,
        blocks=blocks(),
        length=frame.length,
        notes=notes,
        remarks=table.remarks,
        gaps=gaps,
    )


# --- rows of frames as tracks, each with times of its own ------------------------------------------------------


class _Reader:
    """Reads a frame piece by piece, and hands its rows, in SI units, to its tracks."""

    def __init__(self, table: Table, selection: Selection, number: int) -> None:
        self.number, self._path, self._frame = number, table.path, table.frames[number]
        sources = {**selection.strain, **selection.flow}
        self.sources = {key: source for key, source in sources.items() if source.frame == number}
        self._factor, self.tracks = selection.times[number][1], list[_Track]()
        column, columns = selection.times[number][0], [source.column for source in self.sources.values()]
        self.names = [self._frame.columns[i].full for i in columns]
        self._has_times = column is not None
        self.time_name = "time" if column is None else self._frame.columns[column].name
        self._pieces = self._frame.pieces(columns if column is None else [column, *columns])
        self._rows, self.reach, self.is_done = 0, -np.inf, False

    def advance(self) -> None:
        """Read the next piece."""
        if (rows := self.read()) is not None:
            for track in self.tracks:
                track.take(rows)

    def read(self) -> _Rows | None:
        """Return times (n,) [s], rows or lines, values (n, n_c) of the next piece; None at the end."""
        piece = next(self._pieces, None)
        if piece is None:
            self.is_done, self.reach = True, np.inf
            return None
        n, values = len(piece.places), piece.values
        time = np.arange(self._rows, self._rows + n) / self._factor
        if self._has_times:
            stated, values = values[0], values[1:]
            time = stated * self._factor
            self._check_time(stated, time, piece)
        for name, column in zip(self.names, values, strict=True):
            if np.isinf(column).any():  # NaN stands for "no value" in a file, an overflow does not
                row = int(np.argmax(np.isinf(column)))
                raise InputError(
                    f"{self._path}: column '{name}', {self._frame.counted} {piece.places[row]}: "
                    f"expected a finite number or NaN, got {column[row]:g}"
                )
        self._rows += n
        if n:
            self.reach = float(time[-1])
        sources = zip(self.sources.values(), values, strict=True)
        return _Rows(time, piece.places, np.column_stack([one.convert(of) for one, of in sources]), piece.position)

    def _check_time(self, stated: FloatArray, time: FloatArray, piece: Piece) -> None:
        """Refuse times that are none, or not later than those before."""
        where = f"{self._path}: column '{self.time_name}', {self._frame.counted}"
        wrong = np.flatnonzero(~np.isfinite(time))
        if len(wrong):
            number = stated[wrong[0]]
            what = "no number found" if np.isnan(number) else f"expected a finite number or NaN, got {number:g}"
            raise InputError(f"{where} {piece.places[wrong[0]]}: {what}")
        before = np.append(self.reach, time[:-1])
        back = np.flatnonzero(~(time > before))
        if len(back):
            raise InputError(
                f"{where} {piece.places[back[0]]}: expected increasing times, got {time[back[0]]:.9g} s after "
                f"{before[back[0]]:.9g} s"
            )

    def open(self, looks_for_sparse: bool, looks_ahead: bool) -> list[_Track]:
        """Return the tracks: one of the frame's raster, and one of each column that is mostly empty."""
        ahead = list[_Rows]()
        while looks_ahead and not self.is_done and sum(len(rows.time) for rows in ahead) < LOOK_ROWS:
            if (rows := self.read()) is not None:
                ahead.append(rows)
        every = range(len(self.sources))
        sparse = list[int]()
        if looks_for_sparse and ahead:
            start = np.vstack([rows.values for rows in ahead])[:LOOK_ROWS]
            known = np.isfinite(start).sum(axis=0)
            sparse = [i for i in every if known[i] < (1.0 - SPARSE) * len(start)]
        columns = [[i for i in every if i not in sparse], *([i] for i in sparse)]
        self.tracks = [_Track(self, of, is_sparse=number > 0) for number, of in enumerate(columns)]
        for track in self.tracks:
            for rows in ahead:
                track.take(rows)
            track.look()
        return self.tracks


class _Rows(NamedTuple):
    """Rows of a frame: (n,) times [s], (n,) rows or lines, (n, n_c) values, and the position reached."""

    time: FloatArray
    places: IntArray
    values: FloatArray
    position: int


class _Track:
    """Columns with times of their own: rows that have been read and not yet used.

    Attributes
    ----------
    keys : names of the quantities, in the order of the columns of ``values`` (k, n_c).
    time, places : (k,) [s], rows or lines of the file.
    period : median time between rows [s], NaN of fewer than two.
    is_sparse : whether rows without a value are left out.
    """

    def __init__(self, reader: _Reader, columns: Sequence[int], is_sparse: bool) -> None:
        keys = list(reader.sources)
        self.reader, self._columns, self.is_sparse = reader, list(columns), is_sparse
        self.keys, self.names = [keys[i] for i in columns], [reader.names[i] for i in columns]
        self.time, self.places = np.empty(0), np.empty(0, dtype=np.int64)
        self.values = np.empty((0, len(columns)))
        self.position, self.period = 0, float("nan")

    def take(self, rows: _Rows) -> None:
        """Take rows of the frame."""
        whole = len(self._columns) == rows.values.shape[1]
        time, places, values = rows.time, rows.places, rows.values if whole else rows.values[:, self._columns]
        if self.is_sparse:
            has_value = np.isfinite(values[:, 0])
            time, places, values = time[has_value], places[has_value], values[has_value]
        self.time, self.places = np.append(self.time, time), np.append(self.places, places)
        self.values = np.vstack([self.values, values]) if len(self.values) else values
        self.position = rows.position

    def next_rows(self) -> tuple[FloatArray, IntArray, FloatArray] | None:
        """Return times, places and values of the next block of rows and forget them; None at the end."""
        while len(self.time) < BLOCK_ROWS and not self.reader.is_done:
            self.reader.advance()
        if not len(self.time):
            return None
        rows = self.time[:BLOCK_ROWS], self.places[:BLOCK_ROWS], self.values[:BLOCK_ROWS]
        self.drop(len(rows[0]))
        return rows

    def look(self) -> None:
        """Take the period from the rows at the start."""
        if len(self.time) > 1:
            self.period = float(np.median(np.diff(self.time[:LOOK_ROWS])))

    def is_like(self, other: _Track) -> bool:
        """Return whether the times at the start equal another track's, but for rounding."""
        n = min(len(self.time), len(other.time), LOOK_ROWS)
        ends = self.reader.is_done and other.reader.is_done and len(self.time) != len(other.time)
        period = self.period if np.isfinite(self.period) else other.period
        apart = np.abs(self.time[:n] - other.time[:n])
        return bool(n and not ends and (not apart.any() or (apart <= _SAME * period).all()))

    def drop(self, rows: int) -> None:
        """Forget the first rows."""
        self.time, self.places, self.values = self.time[rows:], self.places[rows:], self.values[rows:]


def _tracks(table: Table, selection: Selection) -> tuple[_Track, list[_Track]]:
    """Return the track with the times of the samples, and all others.

    The former has the raster that is stated, or of most gauges, of two the slower.
    """
    looks_ahead = selection.join is not None or len(selection.times) > 1
    readers = [_Reader(table, selection, number) for number in selection.times]
    tracks = [track for one in readers for track in one.open(selection.join is not None, looks_ahead)]
    tracks = [track for track in tracks if track.keys]
    if selection.raster is not None:
        base = next(
            track for track in tracks for key in track.keys if track.reader.sources[key] is selection.raster
        )
    else:
        gauges = [len(selection.strain.keys() & set(track.keys)) for track in tracks]
        counts = [
            sum(n for one, n in zip(tracks, gauges, strict=True) if one is track or one.is_like(track))
            if n_own
            else 0
            for track, n_own in zip(tracks, gauges, strict=True)
        ]
        number = max(range(len(tracks)), key=lambda i: (counts[i], np.nan_to_num(tracks[i].period)))
        base = tracks[number]
    for track in tracks:
        if track is not base and not track.is_sparse and len(track.time) < 2 and not track.is_like(base):
            n = len(track.time)
            expected = f"two samples or more, got {n}" if n else "samples, got none"
            raise InputError(f"{table.path}: column '{track.names[0]}': expected {expected}")
    return base, [track for track in tracks if track is not base]


def _join_notes(path: Path, base: _Track, tracks: Sequence[_Track], join: Join) -> list[str]:
    """Return a line on each raster whose columns are joined with the samples."""
    others: dict[float, list[str]] = {}
    for track in tracks:
        if len(track.time) > 1 and not track.is_like(base):
            others.setdefault(round(track.period, 9), []).extend(track.names)
    at = f"at the samples of '{base.names[0]}', every {1e3 * base.period:.6g} ms"
    return [
        f"{path}: {len(names)} columns of {1e3 * period:.6g} ms ('{names[0]}'{', ..' if names[1:] else ''}) "
        f"{JOINS[join.rule]} {at}"
        for period, names in others.items()
    ]


def _at(track: _Track, at: FloatArray, join: Join) -> FloatArray:
    """Return the values (m, n_c) of a track at times (m,) [s]; forget rows that are not needed again.

    Ahead of the first row and in gaps longer than the limit of ``join`` they are NaN, and behind the last unless
    that is held: a gap remains a gap.
    """
    while not track.reader.is_done and not (
        len(track.time) > 1 and track.time[-1] > at[-1] + _SAME * track.period
    ):
        if track.is_sparse and track.reader.reach > at[-1] + 2.0 * np.nan_to_num(_limit(track, join)):
            break
        track.reader.advance()
    if not len(track.time):
        return np.full((len(at), len(track.keys)), np.nan)
    rule = _interpolated if join.rule == "linear" else _taken
    values = rule(track, at, join, _limit(track, join))
    track.drop(max(int(np.searchsorted(track.time, at[-1], side="right")) - 2, 0))
    return values


def _limit(track: _Track, join: Join) -> float:
    if np.isnan(track.period):
        track.look()
    periods = FARTHEST if join.rule == "nearest" else LONGEST_GAP
    return periods * track.period if join.limit is None else join.limit


def _taken(track: _Track, at: FloatArray, join: Join, limit: float) -> FloatArray:
    """Return (m, n_c) values of the last row before the (m,) times [s], or of the nearest; NaN of one too far."""
    time, same = track.time, np.nan_to_num(_SAME * track.period)
    last = np.searchsorted(time, at + same, side="right") - 1
    taken = np.maximum(last, 0)
    if join.rule == "nearest":
        following = np.minimum(last + 1, len(time) - 1)
        taken = np.where(np.abs(time[following] - at) < np.abs(at - time[taken]), following, taken)
        last = taken
    is_near = (last >= 0) & (np.abs(at - time[taken]) <= np.nan_to_num(limit) + same)
    return np.where(is_near[:, None], track.values[taken], np.nan)


def _interpolated(track: _Track, at: FloatArray, join: Join, limit: float) -> FloatArray:
    """Return (m, n_c) values at the (m,) times [s]; NaN where the neighbours are more than ``limit`` [s] apart."""
    time, values = track.time, track.values
    if len(time) == 1:
        return np.where((at == time[0])[:, None], values[0], np.nan)
    row = np.clip(np.searchsorted(time, at, side="right") - 1, 0, len(time) - 2)
    gap = time[row + 1] - time[row]
    weight = ((at - time[row]) / gap)[:, None]
    near = (_SAME * track.period / gap)[:, None]
    between = (1.0 - weight) * values[row] + weight * values[row + 1]
    is_inside = (weight > 0.0) & (weight < 1.0) & (gap <= limit)[:, None]
    joined = np.where(is_inside, between, np.nan)
    joined = np.where(np.abs(weight) <= near, values[row], joined)
    return np.where(np.abs(weight - 1.0) <= near, values[row + 1], joined)


# --- samples of the signal table -------------------------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class _Block:
    """Rows on one raster: values (n,) in SI units by gauge, leg or quantity, and where they stand in the file."""

    selection: Selection
    values: Mapping[str, FloatArray]
    counted: str
    places: IntArray

    def samples(self, time: FloatArray) -> Samples:
        """Return the samples at ``time`` (n,) [s].

        Raises
        ------
        InputError
            A quantity is negative that cannot be, or strains are in another unit than stated.
        """
        selection, wanted, unknown = self.selection, self.selection.wanted, np.full(len(time), np.nan)
        strain, flow = self._strains(), {name: self.values[name] for name in selection.flow}
        self._check_signs(flow)
        self._check_unit(strain)
        if selection.computed_from:
            flow[DYNAMIC_PRESSURE] = computed_pressure(flow)
        if not wanted.navigates:
            flow.pop(STATIC_PRESSURE, None)
        fixed = float("nan") if wanted.fixed_pressure is None else wanted.fixed_pressure
        pressure = flow.pop(DYNAMIC_PRESSURE, np.full(len(time), fixed))
        warm = {name: flow.pop(name) for name in tuple(flow) if is_temperature(name)}
        sensors = [warm.get(name, unknown) for name in temperature_quantities(wanted.sensors)]
        readings = {name: flow.pop(name) for name in wanted.readings if name in flow}
        parameters = {name: flow.pop(name) for name in tuple(flow) if name not in QUANTITIES}
        stated = [name for name in parameters if name.endswith(STD) and name.removesuffix(STD) in parameters]
        return Samples(
            time,
            strain,
            pressure,
            flow,
            temperature=np.column_stack(sensors) if warm else None,
            parameters_std={name.removesuffix(STD): parameters.pop(name) for name in stated},
            parameters=parameters,
            readings=readings,
        )

    def _strains(self) -> FloatArray:
        """Return (n, n_d) strains of the map's gauges; gauges of rosettes follow from the legs."""
        gauges, unknown = self.selection.wanted.gauge_names, np.full(len(self.places), np.nan)
        values = {name: self.values.get(name, unknown) for name in gauges}
        names = {plain_name(gauge): gauge for gauge in gauges}
        for rosette in self.selection.rosettes:
            legs = [self.values.get(plain_name(leg), unknown) for leg in rosette.legs]
            for name, weights in rosette_weights(rosette).items():
                if plain_name(name) in names:
                    # A leg without weight has no say, also where it has no value.
                    parts = [w * leg for w, leg in zip(weights, legs, strict=True) if w]
                    values[names[plain_name(name)]] = np.sum(parts, axis=0)
        return np.ascontiguousarray(np.array([*values.values()]).T)

    def _where(self, column: str, row: int) -> str:
        return f"{self.selection.path}: column '{column}', {self.counted} {self.places[row]}"

    def _check_signs(self, flow: Mapping[str, FloatArray]) -> None:
        for name in dict.fromkeys((*_NOT_NEGATIVE, *(f"{name}{STD}" for name in flow))):
            negative = np.flatnonzero(flow.get(name, np.empty(0)) < 0.0)
            if len(negative):
                row = int(negative[0])
                where = self._where(self.selection.column(self.selection.flow[name]).name, row)
                raise InputError(f"{where}: expected at least 0, got {flow[name][row]:g}")

    def _check_unit(self, strain: FloatArray) -> None:
        """Refuse strains that no gauge bears, if their median is so: single values are faults."""
        large: BoolArray = np.abs(strain) > LARGEST_STRAIN
        if not large.any() or not float(np.median(np.abs(strain[np.isfinite(strain)]))) > LARGEST_STRAIN:
            return
        selection, reference, units = self.selection, self.selection.wanted.reference, tuple[str, ...]()
        row, gauge = divmod(int(np.argmax(large)), strain.shape[1])
        name = selection.wanted.gauge_names[gauge]
        column = selection.column(selection.strain[name]).name if name in selection.strain else name
        if reference is not None:
            units = likely_units(reference.ratio(level_of(strain)), selection.strain_factor)
        likely = f"likely in {' or '.join(units)}, by the map's strains; " if units else ""
        raise InputError(
            f"{self._where(column, row)}: expected at most {LARGEST_STRAIN:g} m/m, got {strain[row, gauge]:g}; "
            f"{likely}state the unit, as in 'name [{units[0] if units else 'um/m'}]'"
        )
