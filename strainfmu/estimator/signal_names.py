"""Names of signals for programs that single one out: of arrays, and of settings of the core.

They are the names in the core's records, in FMUs and, where files hold such arrays, in files. Flow and navigation
are in :mod:`~strainfmu.estimator.air_inputs`, settings of the vehicle in
:mod:`~strainfmu.estimator.settings`.
"""

from dataclasses import dataclass, fields

STRAIN = "strain"
VALID = "valid"
"""Of each gauge: its reading, and whether it may be used."""

LOAD_NAMES = ("axial_force", "normal_force", "side_force", "pitching_moment", "yawing_moment")
LOAD_UNITS = ("N", "N", "N", "N m", "N m")
COEFFICIENT_NAMES = ("C_A", "C_N", "C_Y", "M_P", "M_Y")
"""The five loads of every map, and their coefficients."""

COEFFICIENT_ARRAY = "coefficients"
FORCE, MOMENT = "force", "moment"
"""Loads, in FMI 3.0 as arrays."""

TEMPERATURE = "temperature"
THRUST = "thrust"
"""Of each temperature sensor, and of the engine."""

TARE = "tare"
"""Whether a tare is asked for, and what belongs to it."""


@dataclass(frozen=True, kw_only=True)
class OperatingSettings:
    """Settings of the core that change from run to run.

    A field's name is the setting's name everywhere, its value what a C program reads of it.
    """

    zero: str = "[m/m] zero offset of each gauge"
    zero_std: str = "[m/m] its standard deviation"
    zero_common_std: str = "[m/m] standard deviation of an offset that all gauges have in common"
    filter_time_constant: str = "[s] of the filter over time; 0: no filter"


ZERO, ZERO_STD, ZERO_COMMON_STD, FILTER_TIME_CONSTANT = (item.name for item in fields(OperatingSettings))

NOT_KNOWN = -9999.0
"""Start value of what may be 0 and has either sign, in its unit, where it is not known. NaN means the same.

NaN alone would do, were there no importers that take it for an error (OMSimulator).
"""
