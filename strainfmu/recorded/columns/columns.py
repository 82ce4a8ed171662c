"""The columns of a table: which is which gauge, and in which unit."""

from __future__ import annotations

from collections.abc import Container, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from strainfmu.arrays import FloatArray, IntArray
from strainfmu.errors import InputError
from strainfmu.estimator.air_inputs import DYNAMIC_PRESSURE, MACH_NUMBER, SAMPLE_INPUTS
from strainfmu.recorded.columns.column_names import (
    CHANNEL_FILE_HINT,
    FLOW_NAMES,
    INERTIAL_NAMES,
    NAVIGATION_NAMES,
    QUANTITIES,
    STATIC_PRESSURE,
    STD,
    TIME_NAMES,
    Wanted,
    columns_to_read,
    excluded_gauges,
    quantity_of,
    some_of,
    split_heading,
    strain_number,
)
from strainfmu.recorded.columns.flight_pressure import (
    computed_pressure,
    navigation_note,
    pressure_note,
    pressure_sources,
)
from strainfmu.recorded.columns.strain_level import LevelReference, level_of, likely_units
from strainfmu.recorded.columns.temperature_columns import (
    TemperatureColumn,
    temperature_columns,
    temperature_note,
    temperatures,
)
from strainfmu.units import NUMBER_UNITS, READING_UNITS, STRAIN_UNITS, TIME_UNITS, UNITS_OF

LARGEST_STRAIN = 0.1
"""Strain [m/m] above which all columns are taken to be in another unit: no gauge bears it."""

_FLOW_UNITS = {
    one.name: (STRAIN_UNITS if one.shown in STRAIN_UNITS else UNITS_OF[one.unit], one.unit)
    for one in SAMPLE_INPUTS
}
"""Units of a quantity, and the one that is meant without any."""

_NOT_NEGATIVE = tuple(one.name for one in SAMPLE_INPUTS if one.is_std)


@dataclass(frozen=True, eq=False)
class StrainBlock:
    """Successive samples of n_d gauges.

    Attributes
    ----------
    time : (n,) [s].
    strain : (n, n_d) [m/m], NaN where a gauge has no value.
    dynamic_pressure : (n,) q_inf [Pa], NaN where it is not known.
    flow : (n,) of each other quantity of ``FLOW_NAMES``, and of ``NAVIGATION_NAMES`` for an estimator that takes
        them, that the file holds [Pa, 1, m], NaN where it is not known.
    parameters, parameters_std : (n,) of each flow parameter that the file holds, as ``flow``, and
        its standard deviation.
    readings : (n,) of each auxiliary sensor, and thrust, that the file holds [SI unit], NaN where it has no value.
    temperature : (n, n_t) of the map's sensors [K], NaN where one gives none; None if the file holds none.
    faults : n texts on strains that were taken out, "" for none; see
        :class:`~strainfmu.recorded.strains.strain_faults.StrainFaults`.
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


@dataclass(frozen=True, eq=False, kw_only=True)
class ColumnPlan:
    """Columns of the samples in a table, and their factors to SI.

    Attributes
    ----------
    time : column of the time.
    strain : n_d columns, order of the map's gauges; None of a gauge that is left out.
    flow : column and factor of each quantity of ``FLOW_NAMES`` that is read, of ``STATIC_PRESSURE``, and of
        flow parameters.
    fixed_pressure : q_inf [Pa] where the file's is not read; NaN where the file's is, and where it is computed or
        not known.
    navigates : as of :class:`~strainfmu.recorded.columns.column_names.Wanted`.
    unused : names of the columns that are not read.
    reference : strains that the map expects, None if they are not known.
    temperature : column of each temperature sensor of the map, None of one without.
    sensors : names of those sensors.
    readings : names of auxiliary sensors of the map, and thrust, which may be in ``flow``.
    counted : what the samples are counted by in messages, "row", or "line" of a text.
    """

    path: Path
    names: tuple[str, ...]
    time: int
    time_factor: float
    strain: tuple[int | None, ...]
    strain_factor: FloatArray
    flow: Mapping[str, tuple[int, float]]
    fixed_pressure: float
    unused: tuple[str, ...] = ()
    reference: LevelReference | None = None
    temperature: tuple[TemperatureColumn | None, ...] = ()
    sensors: tuple[str, ...] = ()
    readings: tuple[str, ...] = ()
    navigates: bool = False
    counted: str = "row"

    @property
    def columns(self) -> tuple[int, ...]:
        """All columns in use: time, strains, columns of ``flow``, then of temperatures."""
        of_flow = (column for column, _ in self.flow.values())
        of_gauges = (column for column in self.strain if column is not None)
        return (self.time, *of_gauges, *of_flow, *(one.column for one in self.temperature if one is not None))

    @property
    def stated(self) -> tuple[str, ...]:
        """Quantities of flow and navigation other than q_inf that the file holds for the estimator."""
        taken = (*FLOW_NAMES[1:], *INERTIAL_NAMES, *(NAVIGATION_NAMES if self.navigates else ()))
        return tuple(name for name in self.flow if name in taken)

    @property
    def computed_from(self) -> tuple[str, ...]:
        """Quantities that q_inf is computed from, nothing where it is read or fixed, or an output alone."""
        return () if self.navigates or self._is_given else pressure_sources(self.flow)

    @property
    def _is_given(self) -> bool:
        return DYNAMIC_PRESSURE in self.flow or bool(np.isfinite(self.fixed_pressure))

    @property
    def notes(self) -> tuple[str, ...]:
        """What is to be said of the columns."""
        notes = [f"{self.path}: {pressure_note(self.computed_from)}"] if self.computed_from else []
        if self.navigates and not self._is_given:
            notes = [f"{self.path}: {navigation_note(self.flow)}"]
        missing = [name for name in self.readings if name not in self.flow]
        if missing:
            shown = ", ".join(missing[:6]) + (" .." if len(missing) > 6 else "")
            notes.append(f"{self.path}: no column for {shown}: sensors are left out, thrust is 0")
        return (*notes, *temperature_note(self.path, self.temperature, self.sensors))

    def block(self, table: FloatArray, places: IntArray) -> StrainBlock:
        """Return the samples of ``table`` (n, k), whose k columns are :attr:`columns`.

        ``places`` are their (n,) rows or lines in the file, for messages.

        Raises
        ------
        InputError
            A number is infinite, a time is no number or not later than the one before, a quantity is negative that
            cannot be, or strains are in another unit than stated.
        """
        self._check_finite(table, places)
        n_d, read = len(self.strain), [gauge for gauge, column in enumerate(self.strain) if column is not None]
        time = table[:, 0] * self.time_factor
        strain = table[:, 1 : 1 + len(read)] * self.strain_factor[read]
        if len(read) < n_d:
            strain, of_read = np.full((len(table), n_d), np.nan), strain
            strain[:, read] = of_read
        behind = table[:, 1 + len(read) :]
        flow = {name: behind[:, i] * factor for i, (name, (_, factor)) in enumerate(self.flow.items())}
        self._check_time(time, places)
        self._check_signs(flow, places)
        large = np.abs(strain) > LARGEST_STRAIN  # none is infinite
        if large.any() and self._is_other_unit(strain):
            row, gauge = divmod(int(np.argmax(large)), n_d)
            raise InputError(
                f"{self.path}: column '{self.names[self.strain[gauge] or 0]}', {self.counted} {places[row]}: "
                f"expected at most {LARGEST_STRAIN:g} m/m, got {strain[row, gauge]:g}; {self._unit_hint(strain)}"
            )
        if self.computed_from:
            flow[DYNAMIC_PRESSURE] = computed_pressure(flow)
        if not self.navigates:
            flow.pop(STATIC_PRESSURE, None)
        pressure = flow.pop(DYNAMIC_PRESSURE, np.full(len(table), self.fixed_pressure))
        warm = temperatures(self.temperature, behind[:, len(self.flow) :])
        readings = {name: flow.pop(name) for name in self.readings if name in flow}
        parameters = {name: flow.pop(name) for name in tuple(flow) if name not in QUANTITIES}
        stated = [name for name in parameters if name.endswith(STD) and name.removesuffix(STD) in parameters]
        return StrainBlock(
            time,
            strain,
            pressure,
            flow,
            temperature=warm,
            parameters_std={name.removesuffix(STD): parameters.pop(name) for name in stated},
            parameters=parameters,
            readings=readings,
        )

    def _unit_hint(self, strain: FloatArray) -> str:
        """Return what to do about strains that no gauge bears, with the unit that the map's strains suggest."""
        factor = float(np.nanmedian(self.strain_factor))
        units: tuple[str, ...] = ()
        if self.reference is not None:
            units = likely_units(self.reference.ratio(level_of(strain)), factor)
        if not units:
            return "state the unit, as in 'name [um/m]'"
        return f"likely in {' or '.join(units)}, by the map's strains; state the unit, as in 'name [{units[0]}]'"

    def _check_signs(self, flow: Mapping[str, FloatArray], places: IntArray) -> None:
        deviations = (f"{name}{STD}" for name in flow)
        for name in dict.fromkeys((*_NOT_NEGATIVE, *deviations)):
            negative = np.flatnonzero(flow.get(name, np.empty(0)) < 0.0)
            if len(negative):
                row = int(negative[0])
                raise InputError(
                    f"{self.path}: column '{self.names[self.flow[name][0]]}', {self.counted} {places[row]}: "
                    f"expected at least 0, got {flow[name][row]:g}"
                )

    def _check_finite(self, table: FloatArray, places: IntArray) -> None:
        """Refuse infinity: NaN stands for "no value" in a file, an overflow does not."""
        infinite = np.isinf(table)
        if infinite.any():
            row, column = (int(one) for one in np.argwhere(infinite)[0])
            raise InputError(
                f"{self.path}: column '{self.names[self.columns[column]]}', {self.counted} {places[row]}: "
                f"expected a finite number or NaN, got {table[row, column]:g}"
            )

    def _check_time(self, time: FloatArray, places: IntArray) -> None:
        wrong = np.flatnonzero(~np.isfinite(time))
        if len(wrong):
            raise InputError(
                f"{self.path}: column '{self.names[self.time]}', {self.counted} {places[wrong[0]]}: "
                "no number found"
            )
        back = np.flatnonzero(np.diff(time) <= 0.0)
        if len(back):
            raise InputError(
                f"{self.path}: column '{self.names[self.time]}', {self.counted} {places[back[0] + 1]}: "
                f"expected increasing times, got {time[back[0] + 1]:.9g} s after {time[back[0]]:.9g} s"
            )

    @staticmethod
    def _is_other_unit(strain: FloatArray) -> bool:
        """Return whether the unit is wrong rather than single values: the median decides."""
        finite = np.abs(strain[np.isfinite(strain)])
        return len(finite) > 0 and float(np.median(finite)) > LARGEST_STRAIN


def plan_columns(
    path: Path, headings: Sequence[str], wanted: Wanted, units: Sequence[str | None] | None = None
) -> ColumnPlan:
    """Find the columns of time, gauges, dynamic pressure and what else is known of the flow.

    A gauge's column is named by the gauge, or ``strain[i]`` from 1, after an instance's name and a dot if there is
    one. The unit stands behind the name in brackets, or in ``units``; without one it is the SI unit.

    Parameters
    ----------
    headings : names of all columns.

    Raises
    ------
    InputError
        A column is missing, unknown, appears twice (under any of its names), or has an unknown unit.
    """
    parts = [split_heading(heading) for heading in headings]
    given = [unit if units is None else (units[i] or unit) for i, (_, unit) in enumerate(parts)]
    names = [name for name, _ in parts]
    read, unused = columns_to_read(path, names, wanted)
    time = _only(path, [i for i in read if names[i].lower() in TIME_NAMES], what="time", names=headings)
    excluded = excluded_gauges(path, wanted)
    indices = _gauge_columns(path, names, headings, gauge_names=wanted.gauge_names, excluded=excluded, read=read)
    factors = [np.nan if i is None else strain_factor(path, headings[i], given[i]) for i in indices]
    flow, passed = {}, []
    quantity = {i: quantity_of(names[i], wanted.readings) for i in read if i not in indices}
    by_name = {name: [i for i, held in quantity.items() if held == name] for name in wanted.flow}
    held = [name for name, found in by_name.items() if found]
    is_computed = wanted.computes_pressure and bool(pressure_sources(held))
    for name, found in by_name.items():
        if passes_over(name, held, wanted):
            passed += [names[i] for i in found]
        elif found or (name == DYNAMIC_PRESSURE and wanted.needs_pressure and not is_computed):
            column = _flow_column(path, found, name=name, names=headings, wanted=wanted)
            flow[name] = (column, flow_factor(path, headings[column], name, given[column], wanted.readings))
    refuse_lone_deviations(path, flow, wanted)
    return ColumnPlan(
        path=path,
        names=tuple(names),
        time=time,
        time_factor=time_factor(path, headings[time], given[time]),
        strain=indices,
        strain_factor=np.array(factors),
        flow=flow,
        fixed_pressure=float("nan") if wanted.fixed_pressure is None else wanted.fixed_pressure,
        unused=(*unused, *passed),
        reference=wanted.reference,
        temperature=temperature_columns(path, names, given, list(quantity), wanted.sensors),
        sensors=wanted.sensors,
        readings=tuple(wanted.readings),
        navigates=wanted.navigates,
    )


def refuse_lone_deviations(path: Path, held: Mapping[str, object], wanted: Wanted) -> None:
    """Refuse the standard deviation of a flow parameter whose value is not among those ``held``.

    Raises
    ------
    InputError
        There is one.
    """
    for name in held:
        parameter = name.removesuffix(STD)
        is_parameter = parameter in wanted.flow and parameter not in QUANTITIES
        if is_parameter and parameter not in held:
            raise InputError(f"{path}: {name}: expected {parameter} with its standard deviation, got none")


def passes_over(name: str, held: Sequence[str], wanted: Wanted) -> bool:
    """Return whether a quantity of the flow is not read, because q_inf is known without it; ``held`` are all."""
    is_fixed = wanted.fixed_pressure is not None
    if name == STATIC_PRESSURE:
        return not wanted.navigates and (is_fixed or DYNAMIC_PRESSURE in held or MACH_NUMBER not in held)
    return name == DYNAMIC_PRESSURE and is_fixed


def strain_factor(path: Path, name: str, unit: str | None) -> float:
    """Return the factor from ``unit`` to m/m, 1 without a unit.

    Raises
    ------
    InputError
        There is no such unit.
    """
    return _factor(path, name, unit, units=STRAIN_UNITS, default="1")


def flow_factor(
    path: Path, heading: str, name: str, unit: str | None, readings: Mapping[str, str] | None = None
) -> float:
    """Return the factor from ``unit`` to the SI unit of ``name``, one of ``FLOW_NAMES``; 1 without a unit.

    ``readings`` are the SI units of auxiliary sensors by name. A flow parameter is in the unit of the vehicle file
    and has none.
    """
    units, default = _FLOW_UNITS.get(name, (NUMBER_UNITS, "1"))
    if readings and name in readings:
        units, default = READING_UNITS[readings[name]], readings[name]
    return _factor(path, heading, unit, units=units, default=default)


def time_factor(path: Path, name: str, unit: str | None) -> float:
    """Return the factor from ``unit`` to s, 1 without a unit."""
    return _factor(path, name, unit, units=TIME_UNITS, default="s")


def _gauge_columns(
    path: Path,
    names: Sequence[str],
    headings: Sequence[str],
    *,
    gauge_names: Sequence[str],
    excluded: Container[str],
    read: Sequence[int],
) -> tuple[int | None, ...]:
    """Return the column of each gauge, by its name or its number, None of one that is left out.

    Both at once are two columns for one gauge.
    """
    own: dict[str, list[int]] = {gauge: [] for gauge in gauge_names}
    by_number: dict[int, list[int]] = {}
    for column in read:
        if names[column] in own:
            own[names[column]].append(column)
        elif (number := strain_number(names[column])) is not None:
            by_number.setdefault(number, []).append(column)
    indices: list[int | None] = []
    for number, gauge in enumerate(gauge_names, start=1):
        if gauge in excluded:
            indices.append(None)
            continue
        found = [*own[gauge], *by_number.get(number, ())]
        if not found:
            raise InputError(
                f"{path}: no column '{gauge}' or 'strain[{number}]' found for a gauge, it holds {some_of(names)}; "
                f"{CHANNEL_FILE_HINT}"
            )
        indices.append(_only(path, found, what=gauge, names=headings))
    return tuple(indices)


def _flow_column(path: Path, found: Sequence[int], name: str, names: Sequence[str], wanted: Wanted) -> int:
    if not found:
        raise InputError(
            f"{path}: no column '{name}' found, it holds {some_of(names)}; or state {wanted.pressure_option}"
        )
    return _only(path, found, what=name, names=names)


def _only(path: Path, found: Sequence[int], what: str, names: Sequence[str]) -> int:
    if not found:
        raise InputError(f"{path}: no column '{what}' found, it holds {some_of(names)}")
    if len(found) > 1:
        same = " and ".join(f"'{name}'" for name in dict.fromkeys(names[column] for column in found))
        raise InputError(f"{path}: expected one column for {what}, got {len(found)}: {same}")
    return found[0]


def _factor(path: Path, name: str, unit: str | None, units: dict[str, float], default: str) -> float:
    text = default if unit is None or not unit.strip() else unit.strip()
    if text not in units:
        raise InputError(f"{path}: column '{name}': unit: expected one of {', '.join(units)}, got '{text}'")
    return units[text]
