"""Enumerations among the variables of the estimator FMU: their names, and what each value means."""

from enum import IntEnum

from strainfmu.estimator.air_inputs import QSource
from strainfmu.estimator.health import HealthState
from strainfmu.estimator.tare import TareState

HEALTH_TYPE = "HealthState"

HEALTH_ITEMS = (
    (HealthState.OK, "Strains and dynamic pressure are valid and the residual is as expected"),
    (
        HealthState.INCONSISTENT,
        "The residual's chi-square is above its limit: the strains fit no known pressure; or measured angles or "
        "specific force contradict the loads",
    ),
    (
        HealthState.NO_COEFFICIENTS,
        "Dynamic pressure is not 1e-6 to 1e7 Pa, or its sigma impossible: no coefficients",
    ),
    (
        HealthState.INVALID,
        "No gauge gives a valid strain, or all read exactly zero in a flow: nothing can be computed",
    ),
    (
        HealthState.DEGRADED,
        "Gauges are missing or navigation is left out, the rest identifies the state: sigma has grown; "
        "or matrices for other zero offsets are being made, the old ones in use",
    ),
    (
        HealthState.UNIDENTIFIED,
        "Gauges are missing, the others do not identify the state: nothing is computed",
    ),
    (HealthState.SUSPECT, "The chi-square is in order, but one gauge does not fit the others"),
    (
        HealthState.OUTSIDE,
        "Dynamic pressure, navigation, a parameter of the flow or the coefficients leave what the map covers: "
        "sigma need not hold",
    ),
)

TARE_TYPE = "TareState"

TARE_ITEMS = (
    (TareState.IDLE, "No tare was asked for, or zeros were set since"),
    (TareState.AVERAGING, "Strains of the steps are averaged"),
    (TareState.DONE, "The zeros of the window are taken: they are in use as soon as their matrices are made"),
    (TareState.REFUSED, "Loads were not known, or the readings are no zeros: zeros as before"),
)

Q_SOURCE_TYPE = "QSource"

Q_SOURCE_ITEMS = (
    (QSource.AUTO, "Not stated: with a Mach number it counts as computed, without one as measured"),
    (QSource.INDEPENDENT, "Measured, or computed from neither Mach number nor static pressure"),
    (QSource.MACH_AND_PRESSURE, "Computed from Mach number and static pressure"),
    (QSource.MACH_AND_ALTITUDE, "Computed from Mach number and an atmosphere at the altitude"),
)

Items = tuple[tuple[IntEnum, str], ...]

ENUMERATIONS: dict[str, tuple[str, Items]] = {
    HEALTH_TYPE: ("How far an estimate can be trusted; the numbers are no ranks", HEALTH_ITEMS),
    TARE_TYPE: ("What has become of the last tare", TARE_ITEMS),
    Q_SOURCE_TYPE: ("What the dynamic pressure is computed from", Q_SOURCE_ITEMS),
}
"""Description and items by name."""


def used_enumerations(declared: set[str | None]) -> dict[str, tuple[str, Items]]:
    """Return the entries of :data:`ENUMERATIONS` whose names are among ``declared``."""
    return {name: enumeration for name, enumeration in ENUMERATIONS.items() if name in declared}
