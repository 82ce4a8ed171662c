"""The names of columns: what each one holds, which of them are read, and which are unknown."""

from __future__ import annotations

import re
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field
from difflib import get_close_matches
from pathlib import Path
from typing import Literal

from strainfmu.errors import InputError
from strainfmu.estimator.air_inputs import DYNAMIC_PRESSURE as DYNAMIC_PRESSURE
from strainfmu.estimator.air_inputs import FLOW_INPUTS, LAST_INPUTS, NAVIGATION_INPUTS, SAMPLE_INPUTS
from strainfmu.estimator.air_inputs import INERTIAL_NAMES as INERTIAL_NAMES
from strainfmu.estimator.air_inputs import STATIC_PRESSURE as STATIC_PRESSURE
from strainfmu.estimator.air_inputs import STD as STD
from strainfmu.estimator.other_loads import ROLLING
from strainfmu.estimator.signal_names import STRAIN
from strainfmu.interface.fmi_variables import COEFFICIENTS
from strainfmu.interface.sensor_variables import identifier
from strainfmu.recorded.columns.strain_level import LevelReference
from strainfmu.recorded.columns.temperature_columns import is_temperature, sensor_of
from strainfmu.units import ALL_UNITS

TIME_NAMES = ("time", "t", "timestamps", "time_s")

FLOW_NAMES = (*FLOW_INPUTS, *LAST_INPUTS)
"""Quantities other than the strains; all but the first may be missing."""

NAVIGATION_NAMES = NAVIGATION_INPUTS
"""What the nonlinear estimator takes of navigation in addition to ``FLOW_NAMES``; p_inf of it stands in, with the
Mach number, for a dynamic pressure that is missing for the others."""

QUANTITIES = (*FLOW_NAMES, *NAVIGATION_NAMES, *INERTIAL_NAMES)
"""All that is known of flow and motion; maps with masses alone take what an inertial unit measures."""

DateOrder = Literal["day", "month"]
"""What stands first in a date of figures."""

SIGNALS = frozenset(
    {
        *COEFFICIENTS,
        ROLLING,
        *("angle_of_attack", "sideslip_angle", "pitch_rate", "control_moment", "commanded_angle_of_attack"),
        *("estimated_angle_of_attack", "trusted", "isolated_gauges"),
    }
)
"""What a recorded system simulation holds besides: known, and not read."""

_SIGNAL_GROUPS = (
    *("sigma.", "force.", "moment.", "section.", "health.", "identified.", "navigation_used."),
    *("tare_state", "zero_in_use"),
)
"""Beginnings of the names of an estimator's other outputs."""

_AIR_DATA = "air_data."
"""The same of those with names of the flow; without an instance ahead it may be an instance itself."""

_OF_FLIGHT = ("autopilot.valid[", "schedule.fault_kind[", "schedule.fault_value[")
"""The same of what else the FMUs of ``strainfmu fly`` put out; of another instance it may be a mask to heed."""

CHANNEL_FILE_HINT = "name the gauges in a channel file, which 'strainfmu channels MAP DATA' proposes"
"""What to do where a recording has names of its own."""

_INDEX = re.compile(r"strain\[([0-9]+)\]")
_UNIT = re.compile(r"(?P<name>.*?)\s*\[(?P<unit>[^\[\]]*)\]")
_ROUND_UNIT = re.compile(r"(?P<name>.*\S)\s*\((?P<unit>[^()]*[^()0-9])\)")

OTHER_NAMES = {
    **{alias: one.name for one in SAMPLE_INPUTS for alias in one.aliases},
    "timestamp": "time",
}
"""Names that others give to a quantity, in small letters and digits alone: for suggestions."""


@dataclass(frozen=True, kw_only=True)
class Wanted:
    """What is to be read from a file.

    Attributes
    ----------
    gauge_names : n_d names, the order of the strains in the blocks.
    fixed_pressure : q_inf of the whole file [Pa], NaN where it is not known, None to take it from the file.
    flow : the quantities of ``QUANTITIES`` that are read, and flow parameters by name.
    combined : gauges that are combinations of positions, which a bending bridge may feed.
    computes_pressure : whether a missing q_inf is computed from Mach number and p_inf or altitude.
    navigates : whether these are navigation by themselves, so that q_inf may be missing and is not computed.
    needs_pressure : whether a file that neither holds q_inf nor allows computing it is refused.
    sensors : names of the n_t temperature sensors that are read.
    ignored : names of columns not to read; with ``*`` for any text, of columns that are not known otherwise.
    reference : strains that the map expects, which show the likely unit; None if they are not known.
    readings : SI unit, as FMI has it, of each auxiliary sensor and of thrust, by name; they are among ``flow``.
    passed : quantities that are known and not read, since another estimator takes them.
    excluded : gauges to leave out, as the user names them: see :func:`excluded_gauges`.
    date_order : of day and month in dates of figures, None where it is not stated.
    """

    gauge_names: tuple[str, ...]
    fixed_pressure: float | None = None
    flow: tuple[str, ...] = FLOW_NAMES
    ignored: tuple[str, ...] = ()
    reference: LevelReference | None = None
    computes_pressure: bool = False
    navigates: bool = False
    combined: frozenset[str] = frozenset()
    needs_pressure: bool = True
    sensors: tuple[str, ...] = ()
    readings: Mapping[str, str] = field(default_factory=dict)
    passed: tuple[str, ...] = ()
    excluded: tuple[str, ...] = ()
    date_order: DateOrder | None = None

    @property
    def pressure_option(self) -> str:
        """The option that stands in for a missing q_inf, in words."""
        return "--dynamic-pressure" + (", nan where it is not known" if self.navigates else "")


def split_heading(heading: str) -> tuple[str, str | None]:
    """Return name and unit of ``name [unit]`` or ``name (unit)``; ``strain[3]`` is a name alone.

    Round brackets belong to the name unless they hold a known unit.
    """
    heading = heading.strip()
    if not heading.endswith(("]", ")")):
        return heading, None
    rounded = _ROUND_UNIT.fullmatch(heading)
    if rounded is not None and rounded["unit"].strip() in ALL_UNITS:
        return rounded["name"], rounded["unit"].strip()
    match = _UNIT.fullmatch(heading)
    if match is None:
        return heading, None
    is_index = match["unit"].isdigit() and not heading[: match.start("unit") - 1].endswith((" ", "]"))
    if is_index:
        return heading, None
    return match["name"].strip(), match["unit"].strip()


def name_and_unit(heading: str) -> tuple[str, str | None]:
    """Return name and unit of a heading; brackets that hold no unit belong to the name."""
    name, unit = split_heading(heading)
    return (name, unit) if unit in ALL_UNITS else (heading.strip(), None)


def last_part(name: str) -> str:
    """Return the name without an instance's name and a dot ahead of it."""
    return name.rpartition(".")[2]


def quantity_of(name: str, readings: Collection[str]) -> str:
    """Return the quantity that a column's name states behind an instance's name and a dot.

    One of ``readings``, which are identifiers, may be written as the sensor is called: ``port_0.2m`` is
    ``port_0_2m``.
    """
    if not readings:
        return last_part(name)
    parts = name.split(".")
    ends = (identifier(".".join(parts[first:])) for first in range(len(parts)))
    return next((end for end in ends if end in readings), parts[-1])


def strain_number(name: str) -> int | None:
    """Return i of ``strain[i]`` or ``instance.strain[i]``, None for another name."""
    match = _INDEX.fullmatch(last_part(name))
    return None if match is None else int(match[1])


def columns_to_read(
    path: Path, names: Sequence[str], wanted: Wanted, known: Sequence[str] | None = None
) -> tuple[list[int], tuple[str, ...]]:
    """Return the columns that may be read, by index, and the names of all others.

    ``known`` are the names to read; None for time, gauges and ``FLOW_NAMES`` as columns name them.

    Raises
    ------
    InputError
        A name is unknown and not to be ignored, or one to be ignored is not there.
    """
    for entry in wanted.ignored:
        if "*" not in entry and entry not in names:
            raise InputError(f"{path}: --ignore-columns: no column '{entry}' found, it holds {some_of(names)}")
    patterns = [_pattern(entry) for entry in wanted.ignored if "*" in entry]
    read, unused, unknown = [], [], []
    for column, name in enumerate(names):
        if name in wanted.ignored:
            unused.append(name)
        elif is_read(name, wanted) if known is None else name in known:
            read.append(column)
        elif (
            is_signal(name)
            or last_part(name) in wanted.passed
            or (is_temperature(name) and not wanted.sensors)
            or any(pattern.fullmatch(name) for pattern in patterns)
        ):
            unused.append(name)
        else:
            unknown.append(name)
    if unknown:
        raise InputError(f"{path}: {_unknown_text(unknown, names=names, wanted=wanted)}")
    return read, tuple(unused)


def excluded_gauges(path: Path, wanted: Wanted, channels: Mapping[str, str] | None = None) -> frozenset[str]:
    """Return the gauges to leave out; each is named as in the map, as ``strain[i]``, or by its channel.

    ``channels`` are the gauges of channels that have other names, which may be no gauges of the map.

    Raises
    ------
    InputError
        A name is none of these, or all gauges are left out.
    """
    gauges, held = wanted.gauge_names, channels or {}
    found = set[str]()
    for name in wanted.excluded:
        number = strain_number(name)
        if name in gauges:
            found.add(name)
        elif name in held:
            found.add(held[name])
        elif number is not None and 1 <= number <= len(gauges):
            found.add(gauges[number - 1])
        else:
            near = get_close_matches(name, [*gauges, *held], n=1, cutoff=0.65)
            hint = f"did you mean '{near[0]}'" if near else f"there are {some_of([*held] or gauges)}"
            raise InputError(f"{path}: --exclude: no gauge '{name}' found, {hint}")
    if found >= set(gauges):
        raise InputError(f"{path}: --exclude: expected some gauges to be left, got all {len(gauges)}")
    return frozenset(found)


def some_of(names: Sequence[str]) -> str:
    """Return the first names as one text."""
    return ", ".join(names[:6]) + (" ..." if len(names) > 6 else "")


def _pattern(entry: str) -> re.Pattern[str]:
    return re.compile(".*".join(re.escape(part) for part in entry.split("*")))


def is_read(name: str, wanted: Wanted) -> bool:
    """Return whether a column of this name is one of time, gauges and flow."""
    if name in wanted.gauge_names or name.lower() in TIME_NAMES:
        return True
    if quantity_of(name, wanted.readings) in wanted.flow:
        return not _is_output(name)
    if sensor_of(name, wanted.sensors) is not None:
        return True
    number = strain_number(name)
    return number is not None and 1 <= number <= len(wanted.gauge_names)


def is_signal(name: str) -> bool:
    """Return whether this is an output of an estimator, a plant or an autopilot; an instance may stand ahead."""
    of_instance = name.partition(".")[2]
    return _is_output(name) or name.startswith(_OF_FLIGHT) or name in SIGNALS or of_instance in SIGNALS


def _is_output(name: str) -> bool:
    """Return whether this is an output of an estimator: what it makes of the flow is not what flew."""
    of_instance = name.partition(".")[2]
    return name.startswith(_SIGNAL_GROUPS) or of_instance.startswith((*_SIGNAL_GROUPS, _AIR_DATA))


def _unknown_text(unknown: Sequence[str], names: Sequence[str], wanted: Wanted) -> str:
    """Return what to say of unknown columns: the names, the nearest known ones, the ways to pass over them."""
    first, way = unknown[0], CHANNEL_FILE_HINT
    if not first:
        return (
            f"column {list(names).index(first) + 1}: no name found; leave it out by --ignore-columns '*', or {way}"
        )
    nearest = _nearest(first, names=names, wanted=wanted)
    number = strain_number(first)
    if nearest is not None:
        hint = f"did you mean '{nearest}'"
    elif number is not None:
        hint = f"expected strain[1] to strain[{len(wanted.gauge_names)}]"
    else:
        hint = f"expected a gauge, strain[i], time, {', '.join(wanted.flow)}"
    others = "" if len(unknown) == 1 else f", and of {len(unknown) - 1} others: {some_of(unknown[1:])}"
    strains = (one for one in names if one in (*wanted.gauge_names, STRAIN) or strain_number(one) is not None)
    if next(strains, None) is None:
        return f"column '{first}': unknown name{others}; no column is a gauge or strain[i]: {way}"
    return f"column '{first}': unknown name{others}; {hint}, leave it out by --ignore-columns '{first}', or {way}"


def _nearest(name: str, names: Sequence[str], wanted: Wanted) -> str | None:
    """Return the known name that ``name`` most resembles, None without one; names that are there are no choice."""
    there = {quantity_of(other, wanted.readings) for other in names} | set(names)
    known = [one for one in ("time", *wanted.flow, *wanted.gauge_names) if one not in there]
    plain = last_part(name).lower()
    other = OTHER_NAMES.get(re.sub("[^a-z0-9]", "", plain))
    if other in known:
        return other
    by_small = {one.lower(): one for one in reversed(known)}
    found = get_close_matches(plain, by_small, n=1, cutoff=0.65) or get_close_matches(
        name.lower(), by_small, n=1, cutoff=0.65
    )
    return by_small[found[0]] if found else None
