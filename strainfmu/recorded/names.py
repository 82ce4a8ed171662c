"""Names and units of columns: what a column of a recording is, by one rule for all formats.

A column is a gauge by its name in the map or as ``strain[i]``, a quantity of the flow by its name in the signal
table, or a time. The name of an instance and a dot, or of a group and a slash, may stand ahead.
"""

import re
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from difflib import get_close_matches
from functools import cached_property
from pathlib import Path

from strainfmu.errors import InputError
from strainfmu.estimator.air_inputs import (
    FLOW_INPUTS,
    INERTIAL_NAMES,
    LAST_INPUTS,
    NAVIGATION_INPUTS,
    SAMPLE_INPUTS,
)
from strainfmu.estimator.other_loads import ROLLING
from strainfmu.estimator.signal_names import STRAIN, TEMPERATURE
from strainfmu.interface.fmi_variables import COEFFICIENTS
from strainfmu.interface.sensor_variables import identifier
from strainfmu.recorded.strain_level import LevelReference
from strainfmu.text_cells import DateOrder
from strainfmu.units import (
    ALL_UNITS,
    NUMBER_UNITS,
    READING_UNITS,
    STRAIN_UNITS,
    TEMPERATURE_UNITS,
    TIME_UNITS,
    UNITS_OF,
)

FLOW_NAMES = (*FLOW_INPUTS, *LAST_INPUTS)
"""Quantities other than the strains; all but the first may be missing."""

QUANTITIES = (*FLOW_NAMES, *NAVIGATION_INPUTS, *INERTIAL_NAMES)
"""All that is known of flow and motion; the nonlinear estimator takes navigation, maps with masses an inertial
unit's readings."""

TIME = "time"

_TIME_NAMES = (
    ("time", "t", "timestamps"),
    ("timestamp", "reltime", "relativetime", "elapsedtime", "elapsed", "testtime", "sampletime", "xvalue", "zeit"),
    (
        *("flighttime", "missiontime", "missionelapsedtime", "met", "logtime", "recordtime"),
        *("temps", "tiempo", "tempo"),
    ),
    (
        *("abstime", "absolutetime", "datetime", "dateandtime", "irigtime", "irig", "gpstime"),
        *("utc", "utctime", "uhrzeit"),
    ),
    ("seconds", "secs", "sec"),
)
"""Names of a column of times, in small letters without marks; of several columns the first of these counts."""

_SIGNALS = frozenset(
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

OTHER_NAMES = {
    **{alias: quantity.name for quantity in SAMPLE_INPUTS for alias in quantity.aliases},
    **{name: TIME for names in _TIME_NAMES for name in names},
}
"""Names that recorders give to a quantity, in small letters and digits alone: for suggestions."""

_INDEX = re.compile(r"strain\[([0-9]+)\]")
_UNIT = re.compile(r"(?P<name>.*?)\s*\[(?P<unit>[^\[\]]*)\]")
_ROUND_UNIT = re.compile(r"(?P<name>.*\S)\s*\((?P<unit>[^()]*[^()0-9])\)")
_TIME_AND_UNIT = re.compile(r"(?P<name>.+?)(?:_|\s*[/,]\s*|\s+in\s+|\s+)(?P<unit>[^\W\d_]+)")
_TIME_IN_BRACKETS = re.compile(r"(?P<name>[^()]+)\((?P<unit>[^()]+)\)")
_GROUPS = re.compile(r"[/\\.]")

Scale = tuple[float, float]
"""Factor and offset from a unit to its SI unit."""

_UNITS: dict[str, tuple[Mapping[str, float | Scale], str]] = {
    STRAIN: (STRAIN_UNITS, "1"),
    TIME: (TIME_UNITS, "s"),
    TEMPERATURE: (TEMPERATURE_UNITS, "K"),
    **{
        quantity.name: (STRAIN_UNITS if quantity.shown in STRAIN_UNITS else UNITS_OF[quantity.unit], quantity.unit)
        for quantity in SAMPLE_INPUTS
    },
}
"""Units of a quantity, and the one that is meant without any."""


@dataclass(frozen=True, kw_only=True)
class Wanted:
    """What is to be read from a file.

    Attributes
    ----------
    gauge_names : n_d names, the order of the strains in the blocks.
    fixed_pressure : q_inf of the whole file [Pa], NaN where it is not known, None to take it from the file.
    flow : the quantities of ``QUANTITIES`` that are read, flow parameters and auxiliary sensors by name.
    navigates : whether q_inf may be missing and is not computed, as Mach number and p_inf are navigation.
    computes_pressure : whether a missing q_inf is computed from Mach number and p_inf or altitude.
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
    needs_pressure: bool = True
    sensors: tuple[str, ...] = ()
    readings: Mapping[str, str] = field(default_factory=dict)
    passed: tuple[str, ...] = ()
    excluded: tuple[str, ...] = ()
    date_order: DateOrder | None = None

    @cached_property
    def temperatures(self) -> dict[str, str]:
        """Name of the sensor of each ``temperature[k]``."""
        return dict(zip(temperature_quantities(self.sensors), self.sensors, strict=True))

    @property
    def quantities(self) -> tuple[str, ...]:
        """All that is read in addition to time and gauges."""
        return (*self.flow, *self.temperatures)

    @property
    def parameters(self) -> tuple[str, ...]:
        """Flow parameters and their standard deviations that are read."""
        return tuple(name for name in self.flow if name not in QUANTITIES and name not in self.readings)

    def reads(self, name: str) -> bool:
        """Return whether a column of this name is one of time, gauges and flow."""
        return time_rank(name) is not None or self.quantity(name) is not None

    def passes(self, name: str) -> bool:
        """Return whether a column that is none of these is known and not read, or not to be read."""
        is_cold = is_temperature(name) and not self.sensors
        patterns = (".*".join(map(re.escape, entry.split("*"))) for entry in self.ignored if "*" in entry)
        return (
            last_part(name) in self.passed or is_cold or any(re.fullmatch(pattern, name) for pattern in patterns)
        )

    def quantity(self, name: str) -> str | None:
        """Return the gauge or quantity of the signal table that a column's name states; None if it is none.

        Temperatures are ``temperature[k]``, whatever their sensors are called.
        """
        if name in self.gauge_names:
            return name
        if (quantity := quantity_of(name, self.readings)) in self.flow:
            return None if is_output(name) else quantity
        for quantity, sensor in self.temperatures.items():
            if sensor == name or quantity == last_part(name):
                return quantity
        number = strain_number(name)
        return self.gauge_names[number - 1] if number and number <= len(self.gauge_names) else None


def split_heading(heading: str) -> tuple[str, str | None]:
    """Return name and unit of ``name [unit]`` or ``name (unit)``; ``strain[3]`` is a name alone.

    Round brackets belong to the name unless they hold a known unit.
    """
    heading = " ".join(heading.split())
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


def name_and_unit(heading: str, is_known: Callable[[str], bool]) -> tuple[str, str | None]:
    """Return name and unit of a heading; brackets that hold no unit belong to the name, unless it is known."""
    name, unit = split_heading(heading)
    return (name, unit) if unit in ALL_UNITS or is_known(name) else (" ".join(heading.split()), None)


def plain_name(name: str) -> str:
    """Return a name in small letters without blanks."""
    return "".join(name.split()).casefold()


def last_part(name: str) -> str:
    """Return the name without an instance's name and a dot ahead of it."""
    return name.rpartition(".")[2]


def endings(name: str) -> set[str]:
    """Return a plain name, and its ends without groups ahead: of 'a/b.c' also 'b.c' and 'c'."""
    return {plain_name(name), *(plain_name(name[match.end() :]) for match in _GROUPS.finditer(name))}


def _time_parts(name: str) -> tuple[str, str | None]:
    """Return the plain name of a time, and the unit that ends it, as in ``time_ms``, ``Time / s``."""
    match = _TIME_IN_BRACKETS.fullmatch(name.strip())
    if match is None and (match := _TIME_AND_UNIT.fullmatch(name.strip())) is not None:
        match = match if time_unit(match["unit"]) is not None else None
    text, unit = (name, None) if match is None else (match["name"], match["unit"])
    return "".join(letter for letter in text.casefold() if letter.isalnum()), unit


def time_rank(name: str) -> int | None:
    """Return where the name of a column of times stands among such names, 0 for the first; None for no time."""
    stem = _time_parts(name)[0]
    return next((rank for rank, names in enumerate(_TIME_NAMES) if stem in names), None)


def times_among(names: Iterable[str]) -> list[str]:
    """Return the times among ``names``, of the first names alone that are there."""
    ranks = {name: rank for name in names if (rank := time_rank(name)) is not None}
    return [name for name, rank in ranks.items() if rank == min(ranks.values())]


def time_unit(unit: str) -> float | None:
    """Return the factor from a unit of time to s, in letters of any size; None for none."""
    text = unit.strip(" .")
    return TIME_UNITS.get(text, TIME_UNITS.get(text.casefold()))


def scale_of(
    path: Path, heading: str, quantity: str, unit: str | None, readings: Mapping[str, str] | None = None
) -> Scale:
    """Return factor and offset from ``unit`` to the SI unit of ``quantity``, without a unit that itself.

    ``quantity`` is :data:`STRAIN`, :data:`TIME`, ``temperature[k]``, or a name of the flow; ``readings`` are the
    SI units of auxiliary sensors by name. A flow parameter is in the unit of the vehicle file and has none. The
    name of a column of times may state its unit.

    Raises
    ------
    InputError
        There is no such unit.
    """
    name = TEMPERATURE if is_temperature(quantity) else quantity
    units, default = _UNITS.get(name, (NUMBER_UNITS, "1"))
    if readings and quantity in readings:
        units, default = READING_UNITS[readings[quantity]], readings[quantity]
    stated = _time_parts(heading)[1] if quantity == TIME else None
    text = (unit or stated or "").strip() or default
    scale = units.get(text)
    if scale is None and units is STRAIN_UNITS:
        scale = units.get(text.casefold())
    if scale is None and quantity == TIME:
        scale = time_unit(text)
    if scale is None:
        raise InputError(f"{path}: column '{heading}': unit: expected one of {', '.join(units)}, got '{text}'")
    return scale if isinstance(scale, tuple) else (scale, 0.0)


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


def is_temperature(name: str) -> bool:
    """Return whether a column of this name is ``temperature[k]``, of an instance or not."""
    return re.fullmatch(rf"{TEMPERATURE}\[[0-9]+\]", last_part(name)) is not None


def temperature_quantities(sensors: Sequence[str]) -> tuple[str, ...]:
    """Return ``temperature[1]`` .. of the sensors."""
    return tuple(f"{TEMPERATURE}[{i}]" for i in range(1, len(sensors) + 1))


def is_signal(name: str) -> bool:
    """Return whether this is an output of an estimator, a plant or an autopilot; an instance may stand ahead."""
    of_instance = name.partition(".")[2]
    return is_output(name) or name.startswith(_OF_FLIGHT) or name in _SIGNALS or of_instance in _SIGNALS


def is_output(name: str) -> bool:
    """Return whether this is an output of an estimator: what it makes of the flow is not what flew."""
    of_instance = name.partition(".")[2]
    return name.startswith(_SIGNAL_GROUPS) or of_instance.startswith((*_SIGNAL_GROUPS, _AIR_DATA))


def some_of(names: Sequence[str]) -> str:
    """Return the first names as one text."""
    return ", ".join(names[:6]) + (" .." if len(names) > 6 else "")


def matched(path: Path, what: str, name: str, names: Sequence[str]) -> str | None:
    """Return the only one of ``names`` that is ``name``, None if none is.

    The same text comes first, then the same but for case and blanks, then that behind the name of a group and a
    slash or dot.

    Raises
    ------
    InputError
        Several names fit equally well.
    """
    small = plain_name(name)
    fits: tuple[Callable[[str], bool], ...] = (
        lambda candidate: candidate == name,
        lambda candidate: plain_name(candidate) == small,
        lambda candidate: small in endings(candidate),
    )
    candidates = next(filter(None, ([*filter(fit, names)] for fit in fits)), [])
    if len(candidates) > 1:
        shown = " and ".join(f"'{candidate}'" for candidate in candidates[:3])
        raise InputError(
            f"{path}: {what} '{name}': expected one of that name, got {len(candidates)}: {shown}; a name with its "
            "group ahead chooses"
        )
    return candidates[0] if candidates else None


def nearest(name: str, names: Iterable[str], cutoff: float = 0.65) -> str | None:
    """Return the one of ``names`` that ``name`` most resembles, but for case and blanks; None without one."""
    by_plain = {plain_name(candidate): candidate for candidate in reversed([*names])}
    near = get_close_matches(plain_name(name), by_plain, n=1, cutoff=cutoff)
    return by_plain[near[0]] if near else None


def suggestion(name: str, names: Sequence[str]) -> str:
    """Return what to say of the nearest of ``names``: 'did you mean ..', or some of them."""
    near = nearest(name, names, cutoff=0.6)
    return f"there are {some_of(names) or 'none'}" if near is None else f"did you mean '{near}'"


def excluded_gauges(path: Path, wanted: Wanted, channels: Mapping[str, str] | None = None) -> tuple[str, ...]:
    """Return the gauges to leave out; each is named as in the map, as ``strain[i]``, or by its channel.

    ``channels`` are the gauges of channels that have other names, which may be no gauges of the map.

    Raises
    ------
    InputError
        A name is none of these, or all gauges are left out.
    """
    gauges = wanted.gauge_names
    numbered = {f"{STRAIN}[{number}]": gauge for number, gauge in enumerate(gauges, start=1)}
    known = {**numbered, **(channels or {}), **dict(zip(gauges, gauges, strict=True))}
    for name in wanted.excluded:
        if name not in known:
            hint = suggestion(name, [*(channels or ()), *gauges])
            raise InputError(f"{path}: --exclude: no gauge '{name}' found, {hint}")
    excluded = {known[name] for name in wanted.excluded}
    if excluded >= set(gauges):
        raise InputError(f"{path}: --exclude: expected some gauges to be left, got all {len(gauges)}")
    return tuple(gauge for gauge in gauges if gauge in excluded)


def unknown_text(unknown: Sequence[str], names: Sequence[str], wanted: Wanted) -> str:
    """Return what to say of unknown columns: the names, the nearest known ones, the ways to pass over them."""
    first, advice = unknown[0], CHANNEL_FILE_HINT
    if not first:
        number = list(names).index(first) + 1
        return f"column {number}: no name found; leave it out by --ignore-columns '*', or {advice}"
    more = "" if len(unknown) == 1 else f", and of {len(unknown) - 1} others: {some_of(unknown[1:])}"
    if not any(name in (*wanted.gauge_names, STRAIN) or strain_number(name) is not None for name in names):
        return f"column '{first}': unknown name{more}; no column is a gauge or strain[i]: {advice}"
    present = {quantity_of(candidate, wanted.readings) for candidate in names} | set(names)
    known = [name for name in (TIME, *wanted.flow, *wanted.gauge_names) if name not in present]
    alias = OTHER_NAMES.get(re.sub("[^a-z0-9]", "", last_part(first).lower()))
    near = alias if alias in known else nearest(last_part(first), known) or nearest(first, known)
    if near is not None:
        hint = f"did you mean '{near}'"
    elif strain_number(first) is not None:
        hint = f"expected strain[1] to strain[{len(wanted.gauge_names)}]"
    else:
        hint = f"expected a gauge, strain[i], time, {', '.join(wanted.flow)}"
    return f"column '{first}': unknown name{more}; {hint}, leave it out by --ignore-columns '{first}', or {advice}"
