"""Units and pressure conventions of CFD results, and how they become p/p_inf."""

from strainfmu.arrays import FloatArray
from strainfmu.atmosphere import HEAT_CAPACITY_RATIO
from strainfmu.errors import InputError
from strainfmu.flight_condition import FlightCondition

METRES = {"m": 1.0, "mm": 1e-3, "cm": 1e-2, "in": 0.0254, "ft": 0.3048}
"""Metres per length unit."""

PASCALS = {
    "Pa": 1.0,
    "hPa": 1e2,
    "kPa": 1e3,
    "MPa": 1e6,
    "mbar": 1e2,
    "bar": 1e5,
    "atm": 101325.0,
    "psi": 6894.757293168361,
    "psf": 47.88025898033584,
}
"""Pascals per pressure unit."""

FREE_STREAM_UNITS = ("rho_inf a_inf^2", "rho_inf V_inf^2", "q_inf")
"""Units by which solvers make pressure dimensionless."""

PRESSURE_UNITS = (*PASCALS, *FREE_STREAM_UNITS)
QUANTITIES = ("p", "p - p_inf", "p/p_inf", "Cp")


def unit_of_pressure(unit: str, condition: FlightCondition) -> float:
    """Return one pressure unit over p_inf [1].

    rho a^2 = gamma p, so rho_inf a_inf^2 is gamma p_inf, rho_inf V_inf^2 is gamma M^2 p_inf, q_inf half of that.
    """
    compressible = HEAT_CAPACITY_RATIO * condition.mach_number**2
    free_stream = dict(
        zip(FREE_STREAM_UNITS, (HEAT_CAPACITY_RATIO, compressible, 0.5 * compressible), strict=True)
    )
    return PASCALS[unit] / condition.ambient_pressure if unit in PASCALS else free_stream[unit]


def pressure_ratio(values: FloatArray, quantity: str, unit: str | None, condition: FlightCondition) -> FloatArray:
    """Return p/p_inf [1] of ``values`` in the quantity and unit they are declared to be, same shape.

    p/p_inf = 1 + gamma/2 M^2 Cp; p_inf is the pressure of the US Standard Atmosphere 1976 at the condition's
    altitude.
    """
    if quantity == "Cp":
        return 1.0 + 0.5 * HEAT_CAPACITY_RATIO * condition.mach_number**2 * values
    if quantity == "p/p_inf":
        return values
    assert unit is not None
    ratio = values * unit_of_pressure(unit, condition)
    return 1.0 + ratio if quantity == "p - p_inf" else ratio


def pressure_coefficient(ratio: FloatArray, mach_number: float) -> FloatArray:
    """Return Cp [1] of p/p_inf [1] at a Mach number [1]: (p/p_inf - 1)/(gamma/2 M^2)."""
    return (ratio - 1.0) / (0.5 * HEAT_CAPACITY_RATIO * mach_number**2)


def check_plausible(where: str, ratio: FloatArray, quantity: str, unit: str | None, mach_number: float) -> None:
    """Refuse p/p_inf that no gas flow has: below 0, above the stagnation pressure, or all but a vacuum.

    The upper bound is the isentropic stagnation pressure (1 + (gamma - 1)/2 M^2)^(gamma/(gamma - 1)), which no
    steady adiabatic flow exceeds.

    Raises
    ------
    InputError
        A value is outside; the message gives what was declared and the likely cause.
    """
    low, high = float(ratio.min()), float(ratio.max())
    gamma = HEAT_CAPACITY_RATIO
    stagnation = (1.0 + 0.5 * (gamma - 1.0) * mach_number**2) ** (gamma / (gamma - 1.0))
    declared = f"declared as {quantity}" + (f" in {unit}" if unit else "")
    if low < 0.0:
        hint = "is it p - p_inf or Cp?" if quantity in ("p", "p/p_inf") else "wrong unit or Mach number?"
        raise InputError(f"{where}: {declared}, the minimum p/p_inf is {low:.4g}, below 0 (vacuum); {hint}")
    if high > stagnation * (1.0 + 1e-6):
        raise InputError(
            f"{where}: {declared}, the maximum p/p_inf is {high:.4g}, the stagnation pressure at M "
            f"{mach_number:g} is {stagnation:.4g}; wrong quantity or unit?"
        )
    if high < 0.01:
        raise InputError(
            f"{where}: {declared}, the maximum p/p_inf is {high:.4g}, less than 1 % of the ambient pressure; "
            "wrong quantity, unit or altitude?"
        )
