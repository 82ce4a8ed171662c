"""Recorded strains in the channels of a recorder, by channels.toml: found, converted, brought to one raster."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from strainfmu.arrays import FloatArray
from strainfmu.errors import InputError
from strainfmu.estimator.air_inputs import DYNAMIC_PRESSURE, MACH_NUMBER
from strainfmu.interface.parameter_variables import PREFIX
from strainfmu.interface.sensor_variables import PREFIX as SENSOR_PREFIX
from strainfmu.interface.sensor_variables import THRUST, identifier
from strainfmu.recorded.channels.bridges import BENDING
from strainfmu.recorded.channels.channel_conversion import (
    channel_strain,
    differs,
    rosette_weights,
    unit_of_channel,
)
from strainfmu.recorded.channels.channel_entries import COMPENSATIONS, ChannelMap
from strainfmu.recorded.channels.rasters import Channel, on_one_raster
from strainfmu.recorded.columns.column_names import (
    QUANTITIES,
    TIME_NAMES,
    Wanted,
    excluded_gauges,
    is_signal,
)
from strainfmu.recorded.columns.columns import StrainBlock, flow_factor
from strainfmu.recorded.columns.flight_pressure import pressure_sources
from strainfmu.recorded.columns.temperature_columns import (
    is_temperature,
    kelvin,
    sensor_of,
    temperature_quantities,
)
from strainfmu.recorded.formats.channel_file import ChannelFile, Reading, Rows, last_name
from strainfmu.recorded.formats.name_match import matched, plain_name, suggestion
from strainfmu.recorded.formats.registry import open_channels
from strainfmu.recorded.strains.channel_clock import ChannelClock
from strainfmu.recorded.strains.sample_blocks import SampleBlocks, StrainFile, column_file
from strainfmu.units import STRAIN_UNITS

_NUMBERED_TIME = re.compile(r"(?:time|zeit|temps)\s*\d+\b", re.IGNORECASE)
"""Names of columns of time of recorders with several rates, as "Time  2 - slow"."""

LARGEST_WHOLE = 64 * 2**20
"""Length [bytes] of a text up to which it is read whole."""

SPARSE = 0.5
"""Part of a channel's samples without a value above which those with one are its own, slower raster."""


@dataclass
class _Found:
    """What was found so far: values by channel, which channel is what, and lines for the user.

    ``slow`` are the channels that are mostly empty, None where that is still to be found.
    """

    channels: dict[str, Channel] = field(default_factory=dict)
    strain: dict[str, str] = field(default_factory=dict)
    unit: dict[str, str] = field(default_factory=dict)
    flow: dict[str, str] = field(default_factory=dict)
    notes: list[str] = field(default_factory=list)
    used: set[str] = field(default_factory=set)
    slow: Mapping[str, Channel] | None = None


@contextmanager
def mapped_strains(path: Path, wanted: Wanted, mapping: ChannelMap) -> Iterator[StrainFile]:
    """Open recorded strains whose channels ``mapping`` states; a long text is read in pieces, other files whole.

    Raises
    ------
    InputError
        As :func:`~strainfmu.recorded.strains.strain_files.open_strains`; or a channel, a gauge or a unit of
        ``mapping`` does not fit the recording or the map.
    """
    stated = [*(item.name for item in mapping.channels), *(item.name for item in mapping.flow)]
    stated += [one for one in (mapping.time, mapping.raster) if one is not None]
    stated += [*temperature_quantities(wanted.sensors), *wanted.sensors]
    stated += _parameters(wanted)
    known = {plain_name(name) for name in (*stated, *QUANTITIES, *TIME_NAMES)}

    def is_known(name: str) -> bool:  # or behind the name of an instance, as in recorded simulations
        return plain_name(name) in known or last_name(name) in known

    order = mapping.date_order or wanted.date_order
    if wanted.date_order not in (None, order):
        raise InputError(
            f"--date-order {wanted.date_order}: expected as in {mapping.path}, [time] date_order = '{order}'"
        )
    with open_channels(path, Reading(is_known=is_known, date_order=order)) as file:
        _check_one_clock(file, mapping)
        gauges = _gauges(mapping, wanted)
        channels = {entry.name: gauges[entry.gauge] for entry in mapping.channels}
        excluded = excluded_gauges(mapping.path, wanted, channels)
        kept = tuple(entry for entry in mapping.channels if gauges[entry.gauge] not in excluded)
        of_map = tuple(gauge for gauge in wanted.gauge_names if gauge in excluded)  # others are legs of rosettes
        wanted, mapping = replace(wanted, excluded=of_map), replace(mapping, channels=kept)
        of_pieces = None
        if file.rows is not None and file.length > LARGEST_WHOLE:
            names = [name for name in file.names if is_known(name)]
            of_pieces = _of_pieces(file, names, mapping, wanted, gauges)
        yield of_pieces or _strains_of(file, mapping, wanted, gauges)


def _check_one_clock(file: ChannelFile, mapping: ChannelMap) -> None:
    """Refuse a text with numbered columns of time, as of recorders with several rates."""
    if file.lines is None:
        return
    numbered = [name for name in file.names if _NUMBERED_TIME.match(name)]
    if len(numbered) > 1:
        raise InputError(
            f"{file.path}: columns '{numbered[0]}' and '{numbered[1]}': expected one time for all columns of a "
            "text, got two; record a file for each rate, or one rate for all"
        )


def _strains_of(
    file: ChannelFile,
    mapping: ChannelMap,
    wanted: Wanted,
    gauges: dict[str, str],
    *,
    ahead: int = 0,
    slow: Mapping[str, Channel] | None = None,
    samples: SampleBlocks | None = None,
) -> StrainFile:
    """Return the samples of a file, or of a piece of it with ``ahead`` samples above it.

    ``slow`` are the channels of the whole file that are mostly empty, None where they are still to be found.
    """
    found = _Found(slow=slow)
    clock = _clock(file, mapping, ahead)
    _read_strains(file, mapping, gauges, clock, found)
    _read_flow(file, mapping, wanted, clock, found)
    found.notes += [*file.remarks, *clock.notes]
    found.used.update(clock.used)
    return _strain_file(file, mapping, wanted, found, samples)


def _clock(file: ChannelFile, mapping: ChannelMap, ahead: int) -> ChannelClock:
    return ChannelClock(
        file, mapping.path, channel=mapping.time, unit=mapping.time_unit, rate=mapping.rate, ahead=ahead
    )


def _of_pieces(
    file: ChannelFile, names: Sequence[str], mapping: ChannelMap, wanted: Wanted, gauges: dict[str, str]
) -> StrainFile | None:
    """Return the samples of a text that is read in pieces, twice; None where it must be read whole.

    That is where a gauge is mostly empty, so that the samples may belong to a slower channel.
    """
    assert file.rows is not None
    read_rows = file.rows

    def pieces() -> Iterator[tuple[ChannelFile, int, int]]:
        """Yield each piece as a file, the number of samples ahead of it, and the position behind it."""
        ahead = 0
        for rows in read_rows(names):
            yield _piece(file, names, rows), ahead, rows.done
            ahead += len(rows.lines)

    slow = _slow_channels(pieces, names, mapping)
    stated = [entry.name for entry in mapping.channels] + ([mapping.raster] if mapping.raster else [])
    if slow and any(matched(file.path, "channel", name, [*slow]) for name in stated):
        return None
    first = next(pieces(), None)
    if first is None:
        return None
    opened = _strains_of(first[0], mapping, wanted, gauges, slow=slow)
    notes = tuple(dict.fromkeys(opened.notes))
    file.remarks.clear()
    samples = SampleBlocks(opened.plan, file.remarks)

    def blocks() -> Iterator[tuple[StrainBlock, int]]:
        done = 0
        for piece, ahead, end in pieces():
            part = _strains_of(piece, mapping, wanted, gauges, ahead=ahead, slow=slow, samples=samples)
            for block, row in part.blocks:
                yield block, done + (end - done) * row // part.length
            done = end
        samples.finish()
        file.remarks[:] = [line for line in file.remarks if line not in notes]

    return StrainFile(file.length, blocks(), opened.plan, notes, file.remarks)


def _piece(file: ChannelFile, names: Sequence[str], rows: Rows) -> ChannelFile:
    """Return a piece of a text as a file."""
    column = {name: i for i, name in reversed(list(enumerate(names)))}
    return replace(file, values=lambda name: rows.values[:, column[name]], rows=None, lines=lambda: rows.lines)


def _slow_channels(
    pieces: Callable[[], Iterator[tuple[ChannelFile, int, int]]], names: Sequence[str], mapping: ChannelMap
) -> dict[str, Channel]:
    """Return the channels among ``names`` of a whole text that are mostly empty: their samples with a value."""
    n, known = 0, np.zeros(len(names))
    for piece, _, _ in pieces():
        table = np.column_stack([piece.numbers(name) for name in names])
        n, known = n + len(table), known + np.isfinite(table).sum(axis=0)
    slow = [name for name, count in zip(names, known.tolist(), strict=True) if _is_slow(count, n)]
    parts: dict[str, list[Channel]] = {name: [] for name in slow}
    for piece, ahead, _ in pieces() if slow else ():
        clock = _clock(piece, mapping, ahead)
        for name in slow:
            values = piece.numbers(name)
            has_value = np.isfinite(values)
            parts[name].append(Channel(clock.of(name, len(values))[has_value], values[has_value]))
    return {
        name: Channel(np.concatenate([one.time for one in held]), np.concatenate([one.values for one in held]))
        for name, held in parts.items()
    }


def _is_slow(known: float, n: int) -> bool:
    """Return whether ``known`` of n samples have so few values that these are a slower raster."""
    return 2 <= known < (1.0 - SPARSE) * n


def _parameters(wanted: Wanted) -> list[str]:
    """Return the flow parameters that are read."""
    return [name for name in wanted.flow if name not in QUANTITIES]


def _gauges(mapping: ChannelMap, wanted: Wanted) -> dict[str, str]:
    """Return what each stated gauge is: a gauge of the map, or a leg of a rosette under its own plain name."""
    legs = {plain_name(leg) for rosette in mapping.rosettes for leg in rosette.legs}
    stated = [(f"{entry.where}.gauge", entry.gauge) for entry in mapping.channels]
    stated += [(f"{one.where}.gauges_deg", gauge) for one in mapping.rosettes for gauge in one.gauges]
    gauges, seen = dict[str, str](), dict[str, str]()
    for where, name in stated:
        is_leg = plain_name(name) in legs
        gauge = plain_name(name) if is_leg else matched(mapping.path, "gauge", name, wanted.gauge_names)
        if gauge is None:
            near = suggestion(name, wanted.gauge_names)
            raise InputError(f"{mapping.path}: {where}: no gauge '{name}' in the map, {near}")
        if gauge in seen:
            raise InputError(
                f"{mapping.path}: {where}: expected one channel for gauge '{name}', got another in {seen[gauge]}"
            )
        seen[gauge], gauges[name] = where, gauge
    for missing in sorted(legs - seen.keys()):
        raise InputError(f"{mapping.path}: rosette: no channel whose gauge is its leg '{missing}'")
    for entry in mapping.channels:
        if entry.bridge in BENDING and gauges[entry.gauge] not in wanted.combined:
            raise InputError(
                f"{mapping.path}: {entry.where}.bridge: '{entry.bridge}' gives half the difference of the strains "
                f"at two positions, and gauge '{entry.gauge}' of the map is at one: expected a channel for each"
            )
    return gauges


def _read(file: ChannelFile, name: str, clock: ChannelClock, found: _Found) -> Channel:
    """Return times and values of a channel; of one that is mostly empty those that have a value."""
    values = file.numbers(name)
    infinite = np.flatnonzero(np.isinf(values))
    if len(infinite):
        raise InputError(
            f"{file.path}: channel '{name}', {file.place(int(infinite[0]))}: expected a finite number or NaN, "
            f"got {values[infinite[0]]:g}"
        )
    time = clock.of(name, len(values))
    has_value = np.isfinite(values)
    if found.slow is not None:
        return found.slow.get(name, Channel(time, values))
    if _is_slow(has_value.sum(), len(values)):
        return Channel(time[has_value], values[has_value])
    return Channel(time, values)


def _read_strains(
    file: ChannelFile, mapping: ChannelMap, gauges: dict[str, str], clock: ChannelClock, found: _Found
) -> None:
    """Read the channels of strain, in m/m."""
    other_units, taken = [], dict[str, str]()
    for entry in mapping.channels:
        name = matched(file.path, "channel", entry.name, file.names)
        if name is None:
            near = suggestion(entry.name, file.names)
            found.notes.append(
                f"{file.path}: no channel '{entry.name}' found, {near}; gauge '{entry.gauge}' is left out"
            )
            continue
        if name in taken:
            raise InputError(
                f"{mapping.path}: {entry.where}.name: channel '{name}' belongs to {taken[name]} already"
            )
        taken[name] = entry.where
        recorded = file.units.get(name)
        unit = unit_of_channel(mapping.path, entry, recorded)
        if differs(unit, recorded):
            other_units.append(f"'{name}' {unit}, not {recorded}")
        raw = _read(file, name, clock, found)
        found.channels[name] = Channel(raw.time, channel_strain(mapping.path, entry, raw.values, unit))
        found.strain[gauges[entry.gauge]], found.unit[gauges[entry.gauge]] = name, unit
        found.used.add(name)
    if not found.strain:
        raise InputError(
            f"{file.path}: none of the channels of {mapping.path} found, the recording holds "
            f"{', '.join(file.names[:6]) or 'none'}{' ..' if len(file.names) > 6 else ''}"
        )
    if other_units:
        shown = ", ".join(other_units[:3]) + (" .." if len(other_units) > 3 else "")
        found.notes.append(
            f"{mapping.path}: units other than the recording's are used in {len(other_units)} channels: {shown}"
        )
    found.notes += _compensation(mapping)


def _compensation(mapping: ChannelMap) -> list[str]:
    """Return a line on the temperature compensation that is stated, none where nothing is."""
    counts = Counter(entry.compensation for entry in mapping.channels)
    kinds = ", ".join(f"{kind} {counts[kind]}" for kind in COMPENSATIONS if counts[kind])
    if not kinds:
        return []
    rest = f", not stated {counts[None]}" if counts[None] else ""
    return [f"{mapping.path}: temperature compensation of the channels: {kinds}{rest}; nothing else is taken off"]


def _read_flow(file: ChannelFile, mapping: ChannelMap, wanted: Wanted, clock: ChannelClock, found: _Found) -> None:
    """Read the channels of the flow, in SI units: first ``[[flow]]``, then channels with a quantity's own name."""
    stated = set[str]()
    for entry in mapping.flow:
        name = matched(file.path, "channel", entry.name, file.names)
        if name is None:
            near = suggestion(entry.name, file.names)
            raise InputError(
                f"{file.path}: no channel '{entry.name}' of {mapping.path}: {entry.where} found, {near}"
            )
        quantity = entry.quantity.removeprefix(PREFIX)
        if quantity.startswith(SENSOR_PREFIX):
            quantity = identifier(quantity.removeprefix(SENSOR_PREFIX))
        if quantity in stated:
            raise InputError(f"{mapping.path}: {entry.where}: expected one channel of {entry.quantity}, got two")
        unit = entry.unit or file.units.get(name)
        parameter = entry.quantity.removeprefix(PREFIX) if entry.quantity.startswith(PREFIX) else None
        if unit is None and entry.quantity != MACH_NUMBER and parameter is None:
            raise InputError(f"{mapping.path}: {entry.where}.unit: entry is missing, the recording states none")
        if parameter is not None and parameter not in (*_parameters(wanted), *wanted.passed):
            held = ", ".join(_parameters(wanted)) or "none"
            raise InputError(
                f"{mapping.path}: {entry.where}.quantity: expected a parameter of the map, {held}, "
                f"got '{parameter}'"
            )
        is_reading = entry.quantity.startswith(SENSOR_PREFIX) or entry.quantity == THRUST
        if is_reading and quantity not in wanted.readings:
            held = ", ".join(wanted.readings) or "none"
            raise InputError(
                f"{mapping.path}: {entry.where}.quantity: expected a sensor of the map, {held}, got '{quantity}'"
            )
        stated.add(quantity)
        if is_temperature(entry.quantity) and sensor_of(entry.quantity, wanted.sensors) is None:
            raise InputError(
                f"{mapping.path}: {entry.where}.quantity: expected one of {len(wanted.sensors)} sensors of the "
                f"map, got '{entry.quantity}'"
            )
        _add_flow(file, name, quantity, unit=unit, clock=clock, found=found, readings=wanted.readings)
    of_flow = [quantity for quantity in QUANTITIES if quantity in wanted.flow]
    for quantity in (*of_flow, *_parameters(wanted), *temperature_quantities(wanted.sensors)):
        names = _own_names(quantity, wanted.sensors)
        own = [name for name in file.names if last_name(name) in names and not is_signal(name)]
        if quantity not in stated and len(own) == 1:
            unit = file.units.get(own[0])
            _add_flow(file, own[0], quantity, unit=unit, clock=clock, found=found, readings=wanted.readings)
    is_known = DYNAMIC_PRESSURE in found.flow or wanted.fixed_pressure is not None
    if not is_known and wanted.needs_pressure and not (wanted.computes_pressure and pressure_sources(found.flow)):
        raise InputError(
            f"{file.path}: no channel of dynamic_pressure found, nor of mach_number with static_pressure or "
            f"altitude; state one as [[flow]] in {mapping.path}, or {wanted.pressure_option}"
        )


def _own_names(quantity: str, sensors: Sequence[str]) -> tuple[str, ...]:
    """Return the plain names that a channel of ``quantity`` may have by itself: a sensor's own name, too."""
    sensor = sensor_of(quantity, sensors)
    return (plain_name(quantity), *(() if sensor is None else (plain_name(sensors[sensor]),)))


def _add_flow(
    file: ChannelFile,
    name: str,
    quantity: str,
    *,
    unit: str | None,
    clock: ChannelClock,
    found: _Found,
    readings: Mapping[str, str],
) -> None:
    if name in found.used:
        raise InputError(f"{file.path}: channel '{name}': expected one use, got two, the second as {quantity}")
    raw = _read(file, name, clock, found)
    is_warm = is_temperature(quantity)
    factor, offset = (
        kelvin(file.path, name, unit) if is_warm else (flow_factor(file.path, name, quantity, unit, readings), 0.0)
    )
    found.channels[name] = Channel(raw.time, raw.values * factor + offset)
    found.flow[quantity] = name
    found.used.add(name)


def _strain_file(
    file: ChannelFile, mapping: ChannelMap, wanted: Wanted, found: _Found, samples: SampleBlocks | None
) -> StrainFile:
    """Return the samples of the map's gauges on one raster."""
    raster = None
    if mapping.raster is not None:
        raster = matched(file.path, "raster", mapping.raster, [*found.channels])
        if raster is None:
            near = suggestion(mapping.raster, [*found.channels])
            raise InputError(f"{mapping.path}: join.raster: no channel '{mapping.raster}' in use, {near}")
    empty = [name for name, channel in found.channels.items() if not len(channel.time)]
    if 0 < len(empty) < len(found.channels):
        raise InputError(f"{file.path}: channel '{empty[0]}': expected samples, got none")
    strains = set(found.strain.values())
    merged = on_one_raster(file.path, found.channels, strains, join=mapping.join, raster=raster)
    strain = {gauge: merged.values[name] for gauge, name in found.strain.items()}
    _add_rosettes(mapping, wanted, strain, n=len(merged.time))
    without = [gauge for gauge in wanted.gauge_names if gauge not in strain]
    stated = {plain_name(entry.gauge) for entry in mapping.channels}
    unstated = [gauge for gauge in without if plain_name(gauge) not in stated and gauge not in wanted.excluded]
    if unstated:
        shown = ", ".join(unstated[:6]) + (" .." if len(unstated) > 6 else "")
        found.notes.append(f"{mapping.path}: no channel for {len(unstated)} gauges of the map, left out: {shown}")
    columns, units = {"time": merged.time}, dict[str, str | None]({"time": "s"})
    for gauge in wanted.gauge_names:
        unit = found.unit.get(gauge, "m/m")
        units[gauge] = unit if unit in STRAIN_UNITS else "m/m"
        values = strain.get(gauge)
        columns[gauge] = (
            np.full(len(merged.time), np.nan) if values is None else values / STRAIN_UNITS[units[gauge] or "1"]
        )
    columns |= {quantity: merged.values[name] for quantity, name in found.flow.items()}
    lines = None if file.lines is None else file.lines()
    notes = (*found.notes, *merged.notes)
    opened = column_file(file.path, columns, units=units, wanted=wanted, notes=notes, lines=lines, samples=samples)
    unused = tuple(name for name in file.names if name not in found.used)
    return replace(opened, plan=replace(opened.plan, unused=(*unused, *opened.plan.unused)))


def _add_rosettes(mapping: ChannelMap, wanted: Wanted, strain: dict[str, FloatArray], n: int) -> None:
    """Add the strains of gauges that rosettes give."""
    for rosette in mapping.rosettes:
        legs = [strain.get(plain_name(leg), np.full(n, np.nan)) for leg in rosette.legs]
        for name, weights in rosette_weights(rosette).items():
            gauge = matched(mapping.path, "gauge", name, wanted.gauge_names)
            # A leg without weight has no say, also where it has no value.
            parts: Sequence[FloatArray] = [w * leg for w, leg in zip(weights, legs, strict=True) if w]
            strain[gauge or name] = np.sum(parts, axis=0)
