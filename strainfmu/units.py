"""Units that files may use, by name, with the factor to SI."""

from math import pi

_MICROSTRAIN = (
    *(f"{micro}{strain}" for micro in "uµμ" for strain in ("m/m", "in/in", "e", "E", "ε", "strain", "Strain")),
    *("microstrain", "ppm"),
)

STRAIN_UNITS = {
    **dict.fromkeys(_MICROSTRAIN, 1e-6),
    **dict.fromkeys(("mm/m",), 1e-3),
    **dict.fromkeys(("percent", "%"), 1e-2),
    **dict.fromkeys(("m/m", "in/in", "1", "strain", "Strain"), 1.0),
}
"""Factor to m/m."""

PRESSURE_UNITS = {
    **dict.fromkeys(("Pa",), 1.0),
    **dict.fromkeys(("hPa", "mbar"), 1e2),
    **dict.fromkeys(("kPa",), 1e3),
    **dict.fromkeys(("bar",), 1e5),
    **dict.fromkeys(("MPa",), 1e6),
    **dict.fromkeys(("psi",), 6894.757293168361),
    **dict.fromkeys(("psf", "lbf/ft2", "lbf/ft^2"), 47.88025898033584),
}
"""Factor to Pa."""

TIME_UNITS = {
    **dict.fromkeys(("ns", "nsec", "nanoseconds"), 1e-9),
    **dict.fromkeys(("us", "µs", "μs", "usec", "microseconds"), 1e-6),
    **dict.fromkeys(("ms", "msec", "milliseconds"), 1e-3),
    **dict.fromkeys(("s", "sec", "secs", "second", "seconds"), 1.0),
    **dict.fromkeys(("min", "mins", "minute", "minutes"), 60.0),
    **dict.fromkeys(("h", "hr", "hrs", "hour", "hours"), 3600.0),
    **dict.fromkeys(("d", "day", "days"), 86400.0),
}
"""Factor to s."""

LENGTH_UNITS = {"m": 1.0, "km": 1e3, "ft": 0.3048}
"""Factor to m."""

ANGLE_UNITS = {"rad": 1.0, "mrad": 1e-3, **dict.fromkeys(("deg", "°"), pi / 180.0)}
"""Factor to rad."""

READING_UNITS = {
    "Pa": PRESSURE_UNITS,
    "m/s2": {"m/s2": 1.0, "m/s^2": 1.0, "g": 9.80665},
    "rad/s2": {"rad/s2": 1.0, "rad/s^2": 1.0, "deg/s2": pi / 180.0, "deg/s^2": pi / 180.0},
    "N": {"N": 1.0, "kN": 1e3, "lbf": 4.4482216152605},
    "N.m": {**dict.fromkeys(("N.m", "N m", "Nm"), 1.0), **dict.fromkeys(("kN.m", "kN m", "kNm"), 1e3)},
    "m": {"m": 1.0, "mm": 1e-3, **dict.fromkeys(("um", "µm", "μm"), 1e-6)},
    "1": STRAIN_UNITS,
}
"""Units of a sensor's readings, by the SI unit of the sensor as FMI has it; factor to that unit."""

RATIO_UNITS = {"V/V": 1.0, "mV/V": 1e-3, **dict.fromkeys(("uV/V", "µV/V", "μV/V"), 1e-6)}
"""Factor to V/V, bridge output over excitation."""

VOLTAGE_UNITS = {"V": 1.0, "mV": 1e-3, **dict.fromkeys(("uV", "µV", "μV"), 1e-6)}
"""Factor to V."""

_CELSIUS = (1.0, 273.15)
_FAHRENHEIT = (5.0 / 9.0, 273.15 - 32.0 * 5.0 / 9.0)

TEMPERATURE_UNITS = {
    "K": (1.0, 0.0),
    **dict.fromkeys(("degC", "°C", "C", "deg C"), _CELSIUS),
    **dict.fromkeys(("degF", "°F", "F", "deg F"), _FAHRENHEIT),
}
"""Factor and offset to K."""

NUMBER_UNITS = {"1": 1.0, "-": 1.0}
"""Units of a quantity without dimension."""

UNITS_OF: dict[str, dict[str, float]] = {
    "Pa": PRESSURE_UNITS,
    "1": NUMBER_UNITS,
    "m": LENGTH_UNITS,
    "K": {"K": 1.0},
    "rad": ANGLE_UNITS,
    "rad/s": {"rad/s": 1.0, "deg/s": pi / 180.0},
    **{unit: READING_UNITS[unit] for unit in ("m/s2", "rad/s2")},
}
"""Units of flow and navigation, by the SI unit of each; factor to it."""

ALL_UNITS = frozenset(
    {
        *STRAIN_UNITS,
        *PRESSURE_UNITS,
        *TIME_UNITS,
        *LENGTH_UNITS,
        *NUMBER_UNITS,
        *RATIO_UNITS,
        *VOLTAGE_UNITS,
        *TEMPERATURE_UNITS,
        *(unit for units in READING_UNITS.values() for unit in units),
        *UNITS_OF["rad/s"],
    }
)
"""All of these."""
