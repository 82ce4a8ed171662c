"""What is read of a table: the column of each gauge and quantity of the flow, and what makes SI units of it.

Without a channel file the columns name what they are; with one (channels.toml) it says so, and quantities of the
flow may have their own names besides.
"""

import re
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import NamedTuple

import numpy as np

from strainfmu.arrays import FloatArray
from strainfmu.atmosphere import HEAT_CAPACITY_RATIO, static_pressure_at
from strainfmu.errors import InputError
from strainfmu.estimator.air_inputs import (
    ALTITUDE,
    DYNAMIC_PRESSURE,
    INERTIAL_NAMES,
    MACH_NUMBER,
    NAVIGATION_INPUTS,
    STATIC_PRESSURE,
    STD,
)
from strainfmu.estimator.arguments import positive
from strainfmu.estimator.signal_names import STRAIN, THRUST
from strainfmu.interface.parameter_variables import PREFIX
from strainfmu.interface.sensor_variables import PREFIX as SENSOR_PREFIX
from strainfmu.interface.sensor_variables import identifier
from strainfmu.recorded.channel_map import (
    COMPENSATIONS,
    Channel,
    ChannelMap,
    differs,
    strain_conversion,
    unit_of_channel,
)
from strainfmu.recorded.names import (
    CHANNEL_FILE_HINT,
    FLOW_NAMES,
    TIME,
    Wanted,
    excluded_gauges,
    is_signal,
    is_temperature,
    last_part,
    matched,
    plain_name,
    scale_of,
    some_of,
    suggestion,
    time_rank,
    unknown_text,
)
from strainfmu.recorded.table import Column, Table
from strainfmu.units import STRAIN_UNITS

Conversion = Callable[[FloatArray], FloatArray]

_NUMBERED_TIME = re.compile(
    r"(?:time|zeit|temps)[\s_-]*(?:\d+\b|slow|fast|langsam|schnell|low|high)", re.IGNORECASE
)
"""Names of columns of time of recorders with several rates, as "Time  2 - slow"."""


class Source(NamedTuple):
    """A column, and what makes SI units of its values, None in these."""

    column: Column
    convert: Conversion | None


Times = tuple[int | None, float]
"""The times of a frame: number of its column and factor to s, or None and the rate [Hz] if there is none."""


@dataclass(eq=False, kw_only=True)
class Selection:
    """What is read of a table.

    Attributes
    ----------
    channel_map : None where columns name what they are.
    strain : source of each gauge, or leg of a rosette by its plain name.
    flow : source of each quantity of the flow, flow parameter, auxiliary sensor, and ``temperature[k]``.
    times : of each frame that is read.
    excluded : gauges that are left out.
    unused : names of the columns that are not read.
    strain_factor : of the unit of most strains, to m/m.
    pressure_source : what q_inf comes from: its column, :data:`FIXED`, or the quantity besides the Mach number; ""
        if it is not known.
    pressure_factor : of the unit of that pressure, to Pa.
    raster : gauge, leg or quantity whose samples are used for the estimates, "" where none is stated.
    """

    table: Table
    wanted: Wanted
    channel_map: ChannelMap | None = None
    strain: dict[str, Source] = field(default_factory=dict)
    flow: dict[str, Source] = field(default_factory=dict)
    times: dict[int, Times] = field(default_factory=dict)
    excluded: tuple[str, ...] = ()
    unused: tuple[str, ...] = ()
    strain_factor: float = 1.0
    pressure_source: str = ""
    pressure_factor: float = 1.0
    raster: str = ""

    @property
    def path(self) -> Path:
        """The recording."""
        return self.table.path

    @property
    def sources(self) -> dict[str, Source]:
        """Sources by gauge, leg or quantity."""
        return {**self.strain, **self.flow}

    @property
    def stated(self) -> tuple[str, ...]:
        """Quantities of flow and navigation other than q_inf that the file holds for the estimator."""
        taken = (*FLOW_NAMES[1:], *INERTIAL_NAMES, *(NAVIGATION_INPUTS if self.wanted.navigates else ()))
        return tuple(name for name in self.wanted.flow if name in self.flow and name in taken)

    @property
    def computes_pressure(self) -> bool:
        """Whether q_inf is computed from the Mach number and :attr:`pressure_source`, and no output alone."""
        return not self.wanted.navigates and self.pressure_source in _COMPUTED

    @property
    def pressure_name(self) -> tuple[str, float] | None:
        """The quantity that q_inf comes from, and the factor of its unit to Pa; None of an altitude."""
        is_stated = self.pressure_source not in ("", ALTITUDE)
        return (self.pressure_source, self.pressure_factor) if is_stated else None

    def flow_notes(self) -> list[str]:
        """Return what is to be said of the columns of the flow."""
        wanted, notes = self.wanted, list[str]()
        if self.computes_pressure:
            notes.append(f"no dynamic_pressure found: {_COMPUTED[self.pressure_source]}")
        elif wanted.navigates and self.pressure_source not in (DYNAMIC_PRESSURE, FIXED):
            pressure = next((name for name in _COMPUTED if name in self.flow), "")
            known = [name for name in (MACH_NUMBER, pressure) if name in self.flow]
            by = f"with {' and '.join(known)} as navigation" if known else "from strain alone"
            notes.append(f"no dynamic_pressure found: estimated {by}")
        if missing := [name for name in wanted.readings if name not in self.flow]:
            notes.append(f"no column for {some_of(missing)}: sensors are left out, thrust is 0")
        if cold := [sensor for quantity, sensor in wanted.temperatures.items() if quantity not in self.flow]:
            more = "" if len(cold) < len(wanted.sensors) else ", the map's modes stay nuisances"
            notes.append(
                f"no column for {len(cold)} of {len(wanted.sensors)} temperature sensors{more}: {some_of(cold)}"
            )
        return [f"{self.path}: {note}" for note in notes]


FIXED = "--dynamic-pressure"
"""Stands for the option as source of q_inf."""

_COMPUTED = {
    STATIC_PRESSURE: "computed from mach_number and static_pressure, gamma/2 p M^2",
    ALTITUDE: "computed from mach_number and altitude, gamma/2 p M^2 with p of the US Standard Atmosphere 1976; a "
    "day's air differs from it by several percent: state dynamic_pressure_std",
}
"""How q_inf was computed with the Mach number, and what that costs."""


def select(table: Table, wanted: Wanted, channel_map: ChannelMap | None = None) -> Selection:
    """Return what is read of a table.

    Raises
    ------
    InputError
        A column is missing, unknown, appears twice (under any of its names), or has an unknown unit; or a channel,
        a gauge or a unit of ``channel_map`` does not fit the recording or the map.
    """
    selection = Selection(table=table, wanted=wanted, channel_map=channel_map)
    if channel_map is None:
        _by_names(selection)
    else:
        _by_channels(selection, channel_map)
    for name in wanted.parameters:
        value = name.removesuffix(STD)
        if name in selection.flow and value not in (name, *selection.flow):
            raise InputError(f"{table.path}: {name}: expected {value} with its standard deviation, got none")
    for source in selection.sources.values():
        if source.column.place[0] not in selection.times:
            selection.times[source.column.place[0]] = _times(selection, source.column)
    table.remarks.extend(selection.flow_notes())
    return selection


def _times(selection: Selection, column: Column) -> Times:
    """Return the times of a column's frame: the stated channel, its own, by a rate, or its column of times."""
    table, path, channel_map = selection.table, selection.path, selection.channel_map
    frame = table.frames[column.place[0]]
    times, stated, elsewhere = frame.times, channel_map.time if channel_map else None, _named_times(table)
    if channel_map is not None and stated is not None:
        elsewhere = [
            _stated_column(selection, "channel of time", stated, f"{channel_map.path}: time.channel").full
        ]
        times = [i for i, candidate in enumerate(frame.columns) if candidate.full in elsewhere]
    elif channel_map is not None and channel_map.rate is not None and not frame.has_clock:
        return None, channel_map.rate
    if not times and elsewhere:
        full = elsewhere[0]
        rows = next(table.frames[time.place[0]].rows for time in table.columns if time.full == full)
        raise InputError(
            f"{path}: column '{column.full}': expected {rows} values, as many as times in '{full}', got "
            f"{frame.rows}"
        )
    if len(times) != 1:
        got = " and ".join(f"'{frame.columns[i].heading}'" for i in times) or "none"
        advice = f"state [time] channel or rate_hz in {channel_map.path}" if channel_map else CHANNEL_FILE_HINT
        raise InputError(
            f"{path}: column of times: expected one, got {got}, it holds {some_of(table.names)}; {advice}"
        )
    time = frame.columns[times[0]]
    if time.dated:
        table.remarks.append(f"{path}: {time.dated}")
        return times[0], 1.0
    unit = channel_map.time_unit if channel_map and (stated is not None or not frame.has_clock) else None
    return times[0], scale_of(path, time.heading, TIME, unit or time.unit)[0]


def _named_times(table: Table) -> list[str]:
    """Return the full names of the columns of times, of all frames."""
    return [frame.columns[i].full for frame in table.frames if not frame.has_clock for i in frame.times]


def _stated_column(selection: Selection, what: str, name: str, where: str) -> Column:
    """Return the column of a channel that the entry ``where`` of a channel file names; refuse any other."""
    path, table = selection.path, selection.table
    full = matched(path, what, name, table.names)
    if full is None:
        raise InputError(f"{path}: no channel '{name}' of {where}, {suggestion(name, table.names)}")
    return table.columns[table.names.index(full)]


# --- columns that name what they are ---------------------------------------------------------------------------


def _by_names(selection: Selection) -> None:
    """Select columns by their names and units.

    A gauge's column is named by the gauge, or ``strain[i]`` from 1, after an instance's name and a dot if there is
    one. Without a unit a column is in the SI unit.
    """
    table, wanted, path = selection.table, selection.wanted, selection.path
    names = [column.name for column in table.columns]
    for entry in wanted.ignored:
        if "*" not in entry and entry not in (*names, *table.names):
            raise InputError(f"{path}: --ignore-columns: no column '{entry}' found, it holds {some_of(names)}")
    columns: dict[str, list[Column]] = {}
    unused, unknown = [], []
    for column in table.columns:
        name, frame = column.name, table.frames[column.place[0]]
        if name in wanted.ignored or column.full in wanted.ignored:
            unused.append(name)
        elif name not in wanted.gauge_names and time_rank(name) is not None:
            if frame.has_clock or column.place[1] not in frame.times:
                unused.append(name)
        elif (quantity := wanted.quantity(name)) is not None:
            columns.setdefault(quantity, []).append(column)
        elif is_signal(name) or wanted.passes(name):
            unused.append(name)
        else:
            unknown.append(name)
    if unknown:
        raise InputError(f"{path}: {unknown_text(unknown, names=names, wanted=wanted)}")
    selection.excluded = excluded = excluded_gauges(path, wanted)
    factors = []
    for i, gauge in enumerate(wanted.gauge_names, start=1):
        if gauge in excluded:
            continue
        if gauge not in columns:
            raise InputError(
                f"{path}: no column '{gauge}' or 'strain[{i}]' found for a gauge, it holds {some_of(names)}; "
                f"{CHANNEL_FILE_HINT}"
            )
        selection.strain[gauge], factor = _source(selection, columns[gauge], STRAIN, gauge)
        factors.append(factor)
    selection.strain_factor = float(np.median(factors))
    passed = _select_flow(
        selection, columns, f"no column '{DYNAMIC_PRESSURE}' found, it holds {some_of(names)}; or state"
    )
    selection.unused = (*unused, *(column.name for column in passed))


def _select_flow(selection: Selection, columns: Mapping[str, Sequence[Column]], lacks: str) -> list[Column]:
    """Select the columns of the flow; return those that are passed over, as q_inf is known without them.

    ``lacks`` is what to say where q_inf is missing, ahead of the option for it.
    """
    wanted, passed, factors = selection.wanted, list[Column](), dict[str, float]()
    is_fixed = wanted.fixed_pressure is not None
    is_known = is_fixed or DYNAMIC_PRESSURE in columns or MACH_NUMBER not in columns
    for name in wanted.quantities:
        if name not in columns:
            continue
        is_passed = name == STATIC_PRESSURE and not wanted.navigates and is_known
        if is_passed or (name == DYNAMIC_PRESSURE and is_fixed):
            passed += columns[name]
            continue
        sensor = f"sensor {wanted.temperatures[name]}" if name in wanted.temperatures else name
        selection.flow[name], factors[name] = _source(selection, columns[name], name, sensor)
    computed_from = pressure_sources(selection.flow)[1:]
    if wanted.fixed_pressure is not None and np.isfinite(wanted.fixed_pressure):
        selection.pressure_source = FIXED
    else:
        selection.pressure_source = next(filter(factors.__contains__, (DYNAMIC_PRESSURE, *computed_from)), "")
    selection.pressure_factor = factors.get(selection.pressure_source, 1.0)
    is_computed = wanted.computes_pressure and bool(computed_from)
    if wanted.needs_pressure and not (is_fixed or DYNAMIC_PRESSURE in selection.flow or is_computed):
        option = FIXED + (", nan where it is not known" if wanted.navigates else "")
        raise InputError(f"{selection.path}: {lacks} {option}")
    return passed


def _source(selection: Selection, columns: Sequence[Column], quantity: str, what: str) -> tuple[Source, float]:
    """Return the source of a quantity by the only one of its columns, and the factor of its unit."""
    column, path = columns[0], selection.path
    if len(columns) > 1:
        headings = dict.fromkeys(column.heading for column in columns)
        same = " and ".join(f"'{heading}'" for heading in headings)
        advice = "; --ignore-columns leaves columns out" if len(headings) > 1 else ""
        raise InputError(f"{path}: expected one column for {what}, got {len(columns)}: {same}{advice}")
    factor, offset = scale_of(path, column.heading, quantity, column.unit, selection.wanted.readings)
    if offset:
        return Source(column, lambda values: values * factor + offset), factor
    return Source(column, None if factor == 1.0 else lambda values: values * factor), factor


# --- columns that a channel file names --------------------------------------------------------------------------


def _by_channels(selection: Selection, channel_map: ChannelMap) -> None:
    """Select the channels that a channel file states."""
    table, wanted, path = selection.table, selection.wanted, channel_map.path
    is_text = any(frame.counted == "line" and not frame.has_clock for frame in table.frames)
    numbered = [name for name in table.names if _NUMBERED_TIME.match(name)]
    if is_text and len(numbered) > 1:
        raise InputError(
            f"{table.path}: columns '{numbered[0]}' and '{numbered[1]}': expected one time for all columns of "
            "a text, got two; record a file for each rate, or one rate for all"
        )
    gauges = _gauges(channel_map, wanted)
    by_channel = {channel.name: gauges[channel.quantity] for channel in channel_map.strain}
    selection.excluded = excluded = excluded_gauges(path, wanted, by_channel)
    _select_strains(selection, channel_map, gauges)
    _select_stated_flow(selection, channel_map)
    used = {source.column.full: key for key, source in selection.sources.items()}
    if channel_map.raster is not None:
        name = matched(table.path, "raster", channel_map.raster, [*used])
        if name is None:
            near = suggestion(channel_map.raster, [*used])
            raise InputError(f"{path}: join.raster: no channel '{channel_map.raster}' in use, {near}")
        selection.raster = used[name]
    without = [gauge for gauge in wanted.gauge_names if gauge not in gauges.values() and gauge not in excluded]
    if without:
        table.remarks.append(
            f"{path}: no channel for {len(without)} gauges of the map, left out: {some_of(without)}"
        )
    time = channel_map.time and matched(table.path, "channel of time", channel_map.time, table.names)
    times = [time] if time else _named_times(table)
    selection.unused = tuple(name for name in table.names if name not in used and name not in times)


def _gauges(channel_map: ChannelMap, wanted: Wanted) -> dict[str, str]:
    """Return what each stated gauge is: a gauge of the map, or a leg of a rosette under its own plain name."""
    path = channel_map.path
    legs = {leg for rosette in channel_map.rosettes for leg in rosette.legs}
    stated = [(f"{channel.where}.gauge", channel.quantity) for channel in channel_map.strain]
    stated += [
        (f"{rosette.where}.gauges_deg", gauge) for rosette in channel_map.rosettes for gauge in rosette.weights
    ]
    gauges, entries = dict[str, str](), dict[str, str]()
    for where, name in stated:
        is_leg = plain_name(name) in legs
        gauge = plain_name(name) if is_leg else matched(path, "gauge", name, wanted.gauge_names)
        if gauge is None:
            near = suggestion(name, wanted.gauge_names)
            raise InputError(f"{path}: {where}: no gauge '{name}' in the map, {near}")
        if gauge in entries:
            raise InputError(
                f"{path}: {where}: expected one channel for gauge '{name}', got another in {entries[gauge]}"
            )
        entries[gauge], gauges[name] = where, gauge
    for missing in sorted(legs - entries.keys()):
        raise InputError(f"{path}: rosette: no channel whose gauge is its leg '{missing}'")
    return gauges


def _select_strains(selection: Selection, channel_map: ChannelMap, gauges: Mapping[str, str]) -> None:
    """Select the channels of strain."""
    path, table, stated_in = selection.path, selection.table, channel_map.path
    differing, taken, units = [], dict[str, str](), list[str]()
    for channel in channel_map.strain:
        if gauges[channel.quantity] in selection.excluded:
            continue
        name = matched(path, "channel", channel.name, table.names)
        if name is None:
            near = suggestion(channel.name, table.names)
            table.remarks.append(
                f"{path}: no channel '{channel.name}' found, {near}; gauge '{channel.quantity}' is left out"
            )
            continue
        if name in taken:
            raise InputError(
                f"{stated_in}: {channel.where}.name: channel '{name}' belongs to {taken[name]} already"
            )
        taken[name] = channel.where
        column = table.columns[table.names.index(name)]
        units.append(unit_of_channel(stated_in, channel, column.unit))
        if differs(units[-1], column.unit):
            differing.append(f"'{name}' {units[-1]}, not {column.unit}")
        convert = strain_conversion(stated_in, channel, units[-1])
        selection.strain[gauges[channel.quantity]] = Source(column, convert)
    if not selection.strain:
        holds = some_of(table.names) or "none"
        raise InputError(f"{path}: none of the channels of {stated_in} found, the recording holds {holds}")
    selection.strain_factor = float(np.median([STRAIN_UNITS.get(unit, 1.0) for unit in units]))
    if differing:
        shown = ", ".join(differing[:3]) + (" .." if len(differing) > 3 else "")
        table.remarks.append(
            f"{stated_in}: units other than the recording's are used in {len(differing)} channels: {shown}"
        )
    counts = Counter(channel.compensation for channel in channel_map.strain)
    kinds = ", ".join(f"{kind} {counts[kind]}" for kind in COMPENSATIONS if counts[kind])
    if kinds:
        rest = f", not stated {counts[None]}" if counts[None] else ""
        table.remarks.append(
            f"{stated_in}: temperature compensation of the channels: {kinds}{rest}; nothing else is taken off"
        )


def _select_stated_flow(selection: Selection, channel_map: ChannelMap) -> None:
    """Select the channels of the flow: first ``[[flow]]``, then channels with a quantity's own name."""
    path, wanted, table, stated_in = selection.path, selection.wanted, selection.table, channel_map.path
    columns = dict[str, Sequence[Column]]()
    for channel in channel_map.flow:
        column = _stated_column(selection, "channel", channel.name, f"{stated_in}: {channel.where} found")
        column = replace(column, unit=channel.unit or column.unit)
        quantity = _stated_quantity(channel, stated_in, wanted)
        if quantity in columns:
            raise InputError(f"{stated_in}: {channel.where}: expected one channel of {channel.quantity}, got two")
        columns[quantity] = [column]
        needs_unit = channel.quantity != MACH_NUMBER and not channel.quantity.startswith(PREFIX)
        if column.unit is None and needs_unit and quantity in wanted.quantities:
            raise InputError(f"{stated_in}: {channel.where}.unit: entry is missing, the recording states none")
    for quantity in wanted.quantities:
        names = {plain_name(quantity), plain_name(wanted.temperatures.get(quantity, quantity))}
        of_name = [
            column
            for column in table.columns
            if names & {plain_name(column.name), plain_name(last_part(column.name))} and not is_signal(column.name)
        ]
        if len(of_name) == 1:
            columns.setdefault(quantity, of_name)
    uses = {source.column.place: STRAIN for source in selection.strain.values()}
    for quantity, (column,) in columns.items():
        if quantity in wanted.quantities and uses.setdefault(column.place, quantity) != quantity:
            raise InputError(
                f"{path}: column '{column.full}': expected one use, got two, the second as {quantity}"
            )
    _select_flow(
        selection,
        columns,
        f"no column of {DYNAMIC_PRESSURE} found, nor of {MACH_NUMBER} with {STATIC_PRESSURE} or {ALTITUDE}; "
        f"state one as [[flow]] in {stated_in}, or",
    )


def _stated_quantity(channel: Channel, path: Path, wanted: Wanted) -> str:
    """Return the name of the quantity of an entry among the flow; refuse what the map does not have."""
    quantity, kind, known = channel.quantity, "", tuple[str, ...]()
    if quantity.startswith(PREFIX):
        quantity = quantity.removeprefix(PREFIX)
        kind, known = "a parameter", wanted.parameters
    elif quantity.startswith(SENSOR_PREFIX) or quantity == THRUST:
        quantity = identifier(quantity.removeprefix(SENSOR_PREFIX))
        kind, known = "a sensor", tuple(wanted.readings)
    elif is_temperature(quantity) and quantity not in wanted.temperatures:
        kind = f"one of {len(wanted.sensors)} sensors"
    if kind and quantity not in (*known, *wanted.passed):
        names = f", {', '.join(known) or 'none'}" if not is_temperature(quantity) else ""
        raise InputError(f"{path}: {channel.where}.quantity: expected {kind} of the map{names}, got '{quantity}'")
    return quantity


# --- dynamic pressure from the Mach number ----------------------------------------------------------------------


def pressure_sources(names: Mapping[str, object]) -> tuple[str, ...]:
    """Return which of the quantities ``names`` q_inf is computed from; nothing if they do not suffice."""
    if MACH_NUMBER not in names:
        return ()
    return next(((MACH_NUMBER, name) for name in (STATIC_PRESSURE, ALTITUDE) if name in names), ())


def computed_pressure(flow: Mapping[str, FloatArray]) -> FloatArray:
    """Return (n,) q_inf = gamma/2 p M^2 [Pa] by the sources of ``flow`` [1, Pa, m]; NaN where one is not given.

    p is the static pressure that was measured, or the US Standard Atmosphere's of 1976 at the altitude.
    """
    _, pressure = pressure_sources(flow)
    mach, stated = flow[MACH_NUMBER], positive(flow[pressure])
    static = stated if pressure == STATIC_PRESSURE else static_pressure_at(stated)
    return np.asarray(np.where(mach == 0.0, 0.0, 0.5 * HEAT_CAPACITY_RATIO * static * positive(mach) ** 2))


def flown_pressure(flow: Mapping[str, FloatArray]) -> FloatArray:
    """Return (n,) q_inf of ``flow`` [Pa], where it is not known by the Mach number; NaN where neither is."""
    dynamic_pressure = flow[DYNAMIC_PRESSURE]
    unknown = np.isnan(dynamic_pressure)
    if not pressure_sources(flow) or not unknown.any():
        return dynamic_pressure
    return np.where(unknown, computed_pressure(flow), dynamic_pressure)
