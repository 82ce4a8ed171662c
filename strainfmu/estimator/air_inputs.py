"""Air data: the inputs of an estimator for flow and navigation, one table, and the air data that it gives.

Python's arguments, the record of the compiled core, variables of FMUs, columns of recordings, entries of a bus and
their units follow :data:`AIR_INPUTS`. The core's own list is fmus/native/estimator/sample/sample.h.
"""

from dataclasses import dataclass
from enum import IntEnum
from math import radians

from strainfmu.estimator.signal_names import NOT_KNOWN
from strainfmu.flight_condition import ALTITUDE as ALTITUDE
from strainfmu.flight_condition import MACH_NUMBER as MACH_NUMBER

STD = "_std"
"""Ends the name of the input for a standard deviation."""


class QSource(IntEnum):
    """What a dynamic pressure is computed from, the input ``q_source``."""

    AUTO = 0
    """Not stated: with a Mach number it counts as computed from that and from the static pressure, or else an
    atmosphere; without, as measured."""
    INDEPENDENT = 1
    """Measured, or computed from neither Mach number nor static pressure."""
    MACH_AND_PRESSURE = 2
    """Computed from Mach number and static pressure."""
    MACH_AND_ALTITUDE = 3
    """Computed from Mach number and the standard atmosphere, or the atmosphere of the day, at the altitude."""


@dataclass(frozen=True, kw_only=True)
class AirInput:
    """An input for flow or navigation.

    Attributes
    ----------
    name : everywhere.
    label, symbol : short name and symbol, of tables and figures.
    unit, shown : unit as FMI has it, and the one that people read.
    text : description; in braces ``of`` with attributes of the tables, and ``not_given``.
    text_of_linear : the same of a linear map, with ``of`` the map; "" of an input that tables alone take.
    note : what a C program reads of it.
    aliases : names that others give to it, in small letters and digits alone: for suggestions.
    is_signed : whether it may be 0 and has either sign; it is :data:`NOT_KNOWN` where it is not given.
    is_later : whether it stands behind all other variables of an FMU, whose numbers stay as they were without it.
    largest, smallest : values that may be used, in ``unit``; a bus takes others for errors.
    """

    name: str
    label: str
    symbol: str
    unit: str
    shown: str | None
    text: str
    text_of_linear: str = ""
    note: str = ""
    aliases: tuple[str, ...] = ()
    smallest: float = 0.0
    largest: float = 1e8
    is_later: bool = False
    is_signed: bool = False

    @property
    def is_last(self) -> bool:
        """Whether every map takes it, and it stands behind those that tables alone take."""
        return self.is_later and not self.of_tables

    @property
    def start(self) -> float:
        """Value that stands for one that is not given."""
        return NOT_KNOWN if self.is_signed else 0.0

    @property
    def of_tables(self) -> bool:
        """Whether tables over the flight state alone take it."""
        return not self.text_of_linear

    @property
    def is_std(self) -> bool:
        """Whether it is the standard deviation of another one."""
        return self.name.endswith(STD)


_DYNAMIC_PRESSURE = AirInput(
    name="dynamic_pressure",
    label="Dynamic pressure",
    symbol="q_inf",
    unit="Pa",
    shown="kPa",
    text="Dynamic pressure by navigation; {not_given} where not given",
    text_of_linear="Free-stream dynamic pressure, at most 1e7 Pa; {use}",
    aliases=("q", "qinf", "qbar", "pdyn", "pressure"),
    smallest=1e-6,
    largest=1e7,
)
_MACH_NUMBER = AirInput(
    name=MACH_NUMBER,
    label="Mach number",
    symbol="M",
    unit="1",
    shown=None,
    text="Mach number by navigation; {not_given} where not given",
    text_of_linear="Mach number by navigation, for health alone; {not_given} where not given",
    aliases=("mach", "ma", "machnumber", "machinf"),
    largest=100.0,
)
_ALTITUDE = AirInput(
    name=ALTITUDE,
    label="Altitude",
    symbol="h",
    unit="m",
    shown="km",
    text="Geopotential altitude by navigation, for the static pressure; {not_given} where not given",
    text_of_linear="Geopotential altitude by navigation, for health alone; {not_given} where not given",
    note=" geopotential; static pressure of the standard atmosphere",
    aliases=("alt", "h", "height", "geopotentialaltitude"),
    smallest=-2e3,
    largest=2e5,
)
_STATIC_PRESSURE = AirInput(
    name="static_pressure",
    label="Static pressure",
    symbol="p_inf",
    unit="Pa",
    shown=None,
    text="Static pressure by navigation, goes before altitude; {not_given} takes the standard atmosphere "
    "at altitude",
    aliases=("p", "pinf", "ps", "pstatic", "ambientpressure"),
    smallest=1e-6,
    largest=1e7,
)

TOTAL_TEMPERATURE_ERROR, STATIC_TEMPERATURE_ERROR = 0.01, 0.03
"""Relative standard deviations of a total temperature without its own, and of the temperature at an altitude about
the standard atmosphere: 0.02 to 0.04 over latitudes and seasons from 10 to 40 km."""

_TOTAL_TEMPERATURE = AirInput(
    name="total_temperature",
    label="Total temperature",
    symbol="T_0",
    unit="K",
    shown=None,
    text="Total temperature of a perfect gas, gamma 1.4: a Mach number by the static one of the standard "
    "atmosphere at altitude, which it needs; {not_given} where not given",
    note=" of a perfect gas; with altitude states the Mach number",
    aliases=("t0", "tt", "ttot", "tat", "stagnationtemperature", "totaltemp"),
    smallest=1.0,
    largest=2e4,
    is_later=True,
)

ANGLE_ERROR = radians(1.0)
"""Standard deviation of measured angles without their own [rad]."""

LARGEST_ANGLE = 1.5
"""Size from which a measured angle is no value [rad]."""

_Q_SOURCE_TEXT = "Source of the dynamic pressure: " + ", ".join(f"{item.value} {item.name}" for item in QSource)
_Q_SOURCE = AirInput(
    name="q_source",
    label="Source of the dynamic pressure",
    symbol="source(q_inf)",
    unit="1",
    shown=None,
    text=f"{_Q_SOURCE_TEXT}; not stated, with a Mach number, it counts as computed and is no measurement: state 1 "
    "where it is measured, for smaller sigmas",
    text_of_linear=f"{_Q_SOURCE_TEXT}; not stated, with a Mach number, it counts as computed and has the error of "
    "what it is computed from: state 1 where it is measured, for smaller sigmas",
    note=" " + ", ".join(f"{item.value} {item.name}" for item in QSource),
    aliases=("qsource", "dynamicpressuresource", "pressuresource"),
    largest=float(max(QSource)),
    is_later=True,
)


def _measured(name: str, label: str, symbol: str, aliases: tuple[str, ...]) -> AirInput:
    """Return the input for an angle by an inertial system, vanes or flush ports."""
    text = f"{label} by an inertial system, vanes or flush ports"
    return AirInput(
        name=name,
        label=label,
        symbol=symbol,
        unit="rad",
        shown="deg",
        text=f"{text}; counts where its {STD} is above 0",
        text_of_linear=f"{text}, for health alone; counts where its {STD} is above 0",
        note=f" measured; {NOT_KNOWN:g} or NaN where not given",
        aliases=aliases,
        smallest=-LARGEST_ANGLE,
        largest=LARGEST_ANGLE,
        is_later=True,
        is_signed=True,
    )


_MEASURED_ATTACK = _measured(
    "measured_angle_of_attack", "Measured angle of attack", "alpha", ("alphameasured", "measuredalpha", "aoavane")
)
_MEASURED_SIDESLIP = _measured(
    "measured_sideslip_angle", "Measured sideslip angle", "beta", ("betameasured", "measuredbeta", "aosvane")
)


def _std_of(
    quantity: AirInput, text: str, of_linear: str = "", note: str = "", aliases: tuple[str, ...] = ()
) -> AirInput:
    """Return the input for the standard deviation of ``quantity``."""
    return AirInput(
        name=f"{quantity.name}{STD}",
        label=f"Standard deviation of {quantity.label[:1].lower()}{quantity.label[1:]}",
        symbol=f"sigma({quantity.symbol})",
        unit=quantity.unit,
        shown=quantity.shown,
        text=f"Standard deviation of the error of {quantity.name}; {{not_given}} {text}",
        text_of_linear=of_linear and f"Standard deviation of the error of {quantity.name}, {of_linear}",
        is_later=quantity.is_later,
        note=note,
        aliases=aliases,
    )


_AXIS_WORDS = {"x": "aft", "y": "to starboard", "z": "up"}


def _inertial(quantity: str, axis: str, symbol: str, unit: str, largest: float) -> AirInput:
    """Return the input for what an inertial unit measures along or about an axis of the body."""
    label = f"{quantity} {'along' if unit == 'm/s2' else 'about'} {axis}"
    text = f"{label}, {_AXIS_WORDS[axis]}, by an inertial unit; {NOT_KNOWN:g} or NaN where not known"
    name = label.lower().replace(" along ", "_").replace(" about ", "_").replace(" ", "_")
    return AirInput(
        name=name,
        label=label,
        symbol=symbol,
        unit=unit,
        shown=None,
        text=text,
        text_of_linear=text,
        note=f" {NOT_KNOWN:g} or NaN where not known",
        smallest=-largest,
        largest=largest,
        is_later=True,
        is_signed=True,
    )


_VIBRATION = AirInput(
    name="vibration",
    label="Vibration",
    symbol="sigma(vibration)",
    unit="1",
    shown="um/m",
    text="Standard deviation of the strain by vibration at the gauge that it strains most; widens sigma; "
    f"{NOT_KNOWN:g} or NaN takes the value of the map",
    text_of_linear="-",
    note=f" of the gauge that vibrates most; {NOT_KNOWN:g} or NaN takes the value of the map",
    aliases=("vibrationstrain", "strainvibration"),
    largest=1e-2,
    is_later=True,
    is_signed=True,
)

MEASURED_MOTION = (
    *(_inertial("Specific force", axis, f"f_{axis}", "m/s2", 2e3) for axis in "xyz"),
    *(_inertial("Angular rate", axis, f"w_{axis}", "rad/s", 200.0) for axis in "xyz"),
    *(_inertial("Angular acceleration", axis, f"dw_{axis}/dt", "rad/s2", 2e3) for axis in "yz"),
)
"""What an inertial unit measures."""

INERTIAL_INPUTS = (*MEASURED_MOTION, _VIBRATION)
"""Those of maps with masses alone, of an inertial unit and of vibration, in their order in a record of the core.

Specific force is acceleration without gravity, as an accelerometer reads it."""

INERTIAL_NAMES = tuple(item.name for item in INERTIAL_INPUTS)
VIBRATION = _VIBRATION.name

_NO_MEASUREMENT = ("leaves the angle out", "{not_given} leaves the angle out")
"""Of the standard deviations of angles in FMUs, whose hosts fill in 0 for inputs that nothing is connected to."""

AIR_INPUTS = (
    _DYNAMIC_PRESSURE,
    _std_of(
        _DYNAMIC_PRESSURE,
        "takes {of.dynamic_pressure_error:g} of it",
        "widens sigma; {not_given} takes {of.dynamic_pressure_error:g} of dynamic_pressure",
        note=" its standard deviation; not given: the value of the map",
        aliases=("qstd", "qinfstd", "sigmaq", "qsigma", "dynamicpressuresigma"),
    ),
    _MACH_NUMBER,
    _ALTITUDE,
    _std_of(_MACH_NUMBER, "takes {of.mach_number_error:g}"),
    _STATIC_PRESSURE,
    _std_of(
        _STATIC_PRESSURE, "takes {of.static_pressure_error:g} of it, {of.altitude_error:g} of that at altitude"
    ),
    _TOTAL_TEMPERATURE,
    _std_of(_TOTAL_TEMPERATURE, f"takes {TOTAL_TEMPERATURE_ERROR:g} of it"),
    _Q_SOURCE,
    _MEASURED_ATTACK,
    _std_of(_MEASURED_ATTACK, *_NO_MEASUREMENT),
    _MEASURED_SIDESLIP,
    _std_of(_MEASURED_SIDESLIP, *_NO_MEASUREMENT),
)
"""Those of flow and navigation, in their order in a record of the core."""

SAMPLE_INPUTS = (*AIR_INPUTS, *INERTIAL_INPUTS)
"""All there is."""

AIR_INPUT_NAMES = tuple(item.name for item in AIR_INPUTS)

FLOW_INPUTS = tuple(item.name for item in AIR_INPUTS if not item.of_tables and not item.is_last)
"""Inputs of every map."""

NAVIGATION_INPUTS = tuple(item.name for item in AIR_INPUTS if item.of_tables)
"""Inputs of maps with tables besides."""

LAST_INPUTS = tuple(item.name for item in AIR_INPUTS if item.is_last)
"""Inputs of every map that stand behind all others."""

FLOW_QUANTITIES = tuple(item.name for item in AIR_INPUTS if item.name in FLOW_INPUTS and not item.is_std)
"""Quantities of every map, without standard deviations."""

DYNAMIC_PRESSURE, STATIC_PRESSURE, TOTAL_TEMPERATURE = (
    item.name for item in (_DYNAMIC_PRESSURE, _STATIC_PRESSURE, _TOTAL_TEMPERATURE)
)
"""Those that something is computed from, besides :data:`MACH_NUMBER` and :data:`ALTITUDE`."""

Q_SOURCE = _Q_SOURCE.name
MEASURED_ANGLES = (_MEASURED_ATTACK.name, _MEASURED_SIDESLIP.name)

AIR_DATA_NAMES = (
    "angle_of_attack",
    "sideslip_angle",
    "total_incidence",
    "wind_roll_angle",
    MACH_NUMBER,
    STATIC_PRESSURE,
    DYNAMIC_PRESSURE,
)
AIR_DATA_UNITS = ("rad", "rad", "rad", "rad", "1", "Pa", "Pa")
"""Units of :data:`AIR_DATA_NAMES`."""

NAVIGATION = (MACH_NUMBER, STATIC_PRESSURE, DYNAMIC_PRESSURE)
"""Air data that are inputs, in this order."""
