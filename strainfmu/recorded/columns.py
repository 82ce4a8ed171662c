"""The columns of a table: which is which gauge, and in which unit."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from strainfmu.arrays import FloatArray
from strainfmu.errors import InputError
from strainfmu.units import PRESSURE_UNITS, STRAIN_UNITS, TIME_UNITS

LARGEST_STRAIN = 0.1
"""Strain [m/m] above which a column is taken to be in another unit: no gauge bears it."""

_UNIT = re.compile(r"(?P<name>.*?)\s*\[(?P<unit>[^\[\]]*)\]")
_INDEX = re.compile(r"strain\[([0-9]+)\]")
_TIME_NAMES = ("time", "t", "timestamps", "time_s")


@dataclass(frozen=True, eq=False)
class StrainBlock:
    """Successive samples of n_d gauges.

    Attributes
    ----------
    time : (n,) [s].
    strain : (n, n_d) [m/m], NaN where a gauge has no value.
    dynamic_pressure : (n,) q_inf [Pa], NaN where it is not known.
    """

    time: FloatArray
    strain: FloatArray
    dynamic_pressure: FloatArray


@dataclass(frozen=True, eq=False, kw_only=True)
class ColumnPlan:
    """Columns of the samples in a table, and their factors to SI.

    Attributes
    ----------
    time : column of the time.
    strain : n_d columns, order of the map's gauges.
    dynamic_pressure : column of q_inf, or None for the ``fixed_pressure`` [Pa].
    """

    path: Path
    names: tuple[str, ...]
    time: int
    time_factor: float
    strain: tuple[int, ...]
    strain_factor: FloatArray
    dynamic_pressure: int | None
    pressure_factor: float
    fixed_pressure: float

    @property
    def columns(self) -> tuple[int, ...]:
        """All columns in use: time, strains, q_inf."""
        pressure = () if self.dynamic_pressure is None else (self.dynamic_pressure,)
        return (self.time, *self.strain, *pressure)

    def block(self, table: FloatArray, first_row: int = 1) -> StrainBlock:
        """Return the samples of ``table`` (n, k), whose k columns are :attr:`columns`; its rows count from 1.

        Raises
        ------
        InputError
            A number is infinite, a time is no number or not later than the one before, or strains are in another
            unit than stated.
        """
        self._check_finite(table, first_row)
        n_d = len(self.strain)
        time = table[:, 0] * self.time_factor
        strain = table[:, 1 : 1 + n_d] * self.strain_factor
        pressure = np.full(len(table), self.fixed_pressure)
        if self.dynamic_pressure is not None:
            pressure = table[:, 1 + n_d] * self.pressure_factor
        self._check_time(time, first_row)
        large = np.flatnonzero((np.abs(strain) > LARGEST_STRAIN) & np.isfinite(strain))
        if len(large) and self._is_other_unit(strain):
            row, gauge = divmod(int(large[0]), n_d)
            raise InputError(
                f"{self.path}: column '{self.names[self.strain[gauge]]}', row {first_row + row}: "
                f"expected at most {LARGEST_STRAIN:g} m/m, got {strain[row, gauge]:g}; state the unit, "
                "as in 'name [um/m]'"
            )
        # A strain that no gauge bears is no value.
        return StrainBlock(time, np.where(np.abs(strain) <= LARGEST_STRAIN, strain, np.nan), pressure)

    def _check_finite(self, table: FloatArray, first_row: int) -> None:
        """Refuse infinity: NaN stands for "no value" in a file, an overflow does not."""
        infinite = np.argwhere(np.isinf(table))
        if len(infinite):
            row, column = (int(one) for one in infinite[0])
            raise InputError(
                f"{self.path}: column '{self.names[self.columns[column]]}', row {first_row + row}: "
                f"expected a finite number or NaN, got {table[row, column]:g}"
            )

    def _check_time(self, time: FloatArray, first_row: int) -> None:
        wrong = np.flatnonzero(~np.isfinite(time))
        if len(wrong):
            raise InputError(
                f"{self.path}: column '{self.names[self.time]}', row {first_row + wrong[0]}: no number found"
            )
        back = np.flatnonzero(np.diff(time) <= 0.0)
        if len(back):
            raise InputError(
                f"{self.path}: column '{self.names[self.time]}', row {first_row + 1 + back[0]}: "
                f"expected increasing times, got {time[back[0] + 1]:.9g} s after {time[back[0]]:.9g} s"
            )

    @staticmethod
    def _is_other_unit(strain: FloatArray) -> bool:
        """Return whether the unit is wrong rather than single values: the median decides."""
        finite = np.abs(strain[np.isfinite(strain)])
        return len(finite) > 0 and float(np.median(finite)) > LARGEST_STRAIN


def plan_columns(
    path: Path,
    headings: Sequence[str],
    gauge_names: Sequence[str],
    fixed_pressure: float | None,
    units: Sequence[str | None] | None = None,
) -> ColumnPlan:
    """Find the columns of time, gauges and dynamic pressure.

    A gauge's column is named by the gauge, or ``strain[i]`` from 1, after an instance's name and a dot if there is
    one. The unit stands behind the name in brackets, or in ``units``; without one it is the SI unit.

    Parameters
    ----------
    headings : names of all columns.
    fixed_pressure : q_inf [Pa] of the whole file, or None to take it from its column.

    Raises
    ------
    InputError
        A column is missing, appears twice (under any of its names), or has an unknown unit.
    """
    parts = [_split(heading) for heading in headings]
    given = [unit if units is None else (units[i] or unit) for i, (_, unit) in enumerate(parts)]
    names = [name for name, _ in parts]
    time = _only(
        path, [i for i, name in enumerate(names) if name.lower() in _TIME_NAMES], what="time", names=names
    )
    indices = _gauge_columns(path, names, gauge_names)
    factors = [strain_factor(path, headings[i], given[i]) for i in indices]
    pressure = None
    if fixed_pressure is None:
        found = [i for i, name in enumerate(names) if _last(name) == "dynamic_pressure"]
        if not found:
            raise InputError(
                f"{path}: no column 'dynamic_pressure' found, it holds {_some(names)}; or state --dynamic-pressure"
            )
        pressure = _only(path, found, what="dynamic_pressure", names=names)
    return ColumnPlan(
        path=path,
        names=tuple(names),
        time=time,
        time_factor=time_factor(path, headings[time], given[time]),
        strain=indices,
        strain_factor=np.array(factors),
        dynamic_pressure=pressure,
        pressure_factor=1.0 if pressure is None else pressure_factor(path, headings[pressure], given[pressure]),
        fixed_pressure=float("nan") if fixed_pressure is None else fixed_pressure,
    )


def strain_factor(path: Path, name: str, unit: str | None) -> float:
    """Return the factor from ``unit`` to m/m, 1 without a unit.

    Raises
    ------
    InputError
        There is no such unit.
    """
    return _factor(path, name, unit, units=STRAIN_UNITS, default="1")


def pressure_factor(path: Path, name: str, unit: str | None) -> float:
    """Return the factor from ``unit`` to Pa, 1 without a unit."""
    return _factor(path, name, unit, units=PRESSURE_UNITS, default="Pa")


def time_factor(path: Path, name: str, unit: str | None) -> float:
    """Return the factor from ``unit`` to s, 1 without a unit."""
    return _factor(path, name, unit, units=TIME_UNITS, default="s")


def _split(heading: str) -> tuple[str, str | None]:
    """Return name and unit of ``name [unit]``; ``strain[3]`` is a name alone."""
    heading = heading.strip()
    match = _UNIT.fullmatch(heading)
    if match is None:
        return heading, None
    is_index = match["unit"].isdigit() and not heading[: match.start("unit") - 1].endswith((" ", "]"))
    if is_index:
        return heading, None
    return match["name"].strip(), match["unit"].strip()


def _last(name: str) -> str:
    """Return the name without an instance's name and a dot ahead of it."""
    return name.rpartition(".")[2]


def _gauge_columns(path: Path, names: Sequence[str], gauge_names: Sequence[str]) -> tuple[int, ...]:
    """Return the column of each gauge, by its name or its number; both at once are two columns for one gauge."""
    own: dict[str, list[int]] = {gauge: [] for gauge in gauge_names}
    by_number: dict[int, list[int]] = {}
    for column, name in enumerate(names):
        if name in own:
            own[name].append(column)
        elif match := _INDEX.fullmatch(_last(name)):
            by_number.setdefault(int(match[1]), []).append(column)
    indices = []
    for number, gauge in enumerate(gauge_names, start=1):
        found = [*own[gauge], *by_number.get(number, ())]
        if not found:
            raise InputError(
                f"{path}: no column '{gauge}' or 'strain[{number}]' found for a gauge, it holds {_some(names)}"
            )
        indices.append(_only(path, found, what=gauge, names=names))
    return tuple(indices)


def _only(path: Path, found: Sequence[int], what: str, names: Sequence[str]) -> int:
    if not found:
        raise InputError(f"{path}: no column '{what}' found, it holds {_some(names)}")
    if len(found) > 1:
        same = " and ".join(f"'{name}'" for name in dict.fromkeys(names[column] for column in found))
        raise InputError(f"{path}: expected one column for {what}, got {len(found)}: {same}")
    return found[0]


def _some(names: Sequence[str]) -> str:
    return ", ".join(names[:6]) + (" ..." if len(names) > 6 else "")


def _factor(path: Path, name: str, unit: str | None, units: dict[str, float], default: str) -> float:
    text = default if unit is None or not unit.strip() else unit.strip()
    if text not in units:
        raise InputError(f"{path}: column '{name}': unit: expected one of {', '.join(units)}, got '{text}'")
    return units[text]
