"""The interface of both FMUs: every FMI variable and unit, described once.

:func:`estimator_interface` and :func:`plant_interface` give the variables in the order of
``ModelVariables``; the value reference of a variable is its place in that order. The model description,
the documentation page and the slaves all read these lists.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import atan2, degrees, pi
from typing import TYPE_CHECKING

from strainfmu.health import HealthState

if TYPE_CHECKING:
    from strainfmu.cosim.flight_model import FlightModel
    from strainfmu.inverse_map import InverseMap

COEFFICIENTS = {
    "C_A": "Axial force coefficient of pressure less internal pressure, positive aft, fore-body",
    "C_N": "Normal force coefficient, positive up",
    "C_Y": "Side force coefficient, positive to starboard",
    "M_P": "Pitching moment coefficient, positive nose-up",
    "M_Y": "Yawing moment coefficient, positive nose to starboard",
}
LOADS = {
    "force.axial": ("Axial force, positive aft, fore-body", "N"),
    "force.normal": ("Normal force, positive up", "N"),
    "force.side": ("Side force, positive to starboard", "N"),
    "moment.pitch": ("Pitching moment, positive nose-up", "N.m"),
    "moment.yaw": ("Yawing moment, positive nose to starboard", "N.m"),
}
HEALTH_TYPE = "HealthState"


@dataclass(frozen=True)
class DisplayUnit:
    """A unit for people: shown value = ``factor`` * value in the parent unit (FMI 2.0, section 2.2.2)."""

    name: str
    factor: float


@dataclass(frozen=True)
class Unit:
    """A unit with its exponents of SI base units (and rad), as FMI 2.0, section 2.2.2 wants it."""

    name: str
    base: tuple[tuple[str, int], ...] = ()
    display_units: tuple[DisplayUnit, ...] = ()


@dataclass(frozen=True)
class Variable:
    """One FMI 2.0 ScalarVariable (section 2.2.7); numbers are in ``unit``.

    Attributes
    ----------
    depends_on : names of the inputs that an output depends on at a communication point.
    dependencies_kind : how it does, FMI's word, the same for all of ``depends_on``.
    initially_depends_on : names of the parameters its first value depends on besides.
    """

    name: str
    description: str
    causality: str
    variability: str = "continuous"
    fmi_type: str = "Real"
    unit: str | None = None
    display_unit: str | None = None
    nominal: float | None = None
    minimum: float | None = None
    maximum: float | None = None
    start: float | int | None = None
    declared_type: str | None = None
    depends_on: tuple[str, ...] = ()
    dependencies_kind: str = "dependent"
    initially_depends_on: tuple[str, ...] = ()


UNITS = (
    Unit("1", (), (DisplayUnit("um/m", 1e6),)),
    Unit("N", (("kg", 1), ("m", 1), ("s", -2)), (DisplayUnit("kN", 1e-3),)),
    Unit("N.m", (("kg", 1), ("m", 2), ("s", -2)), (DisplayUnit("kN.m", 1e-3),)),
    Unit("Pa", (("kg", 1), ("m", -1), ("s", -2)), (DisplayUnit("kPa", 1e-3),)),
    Unit("m", (("m", 1),), (DisplayUnit("km", 1e-3),)),
    Unit("rad", (("rad", 1),), (DisplayUnit("deg", 180.0 / pi),)),
)

HEALTH_ITEMS = (
    (HealthState.OK, "Strains and dynamic pressure are valid and the residual is as expected"),
    (
        HealthState.INCONSISTENT,
        "The residual's chi-square is above its limit: the strains fit no known pressure",
    ),
    (
        HealthState.NO_COEFFICIENTS,
        "Dynamic pressure is not a positive number: no coefficients; chi-square tells of the loads",
    ),
    (HealthState.INVALID, "A strain is not a finite number: nothing can be computed"),
)


def strain_names(n_gauges: int) -> tuple[str, ...]:
    """Return ``strain[1]`` .. ``strain[n]``, which structured naming makes an array (FMI 2.0, 2.2.9)."""
    return tuple(f"strain[{i}]" for i in range(1, n_gauges + 1))


def estimator_interface(inverse_map: InverseMap) -> tuple[Variable, ...]:
    """Return the variables of the estimator FMU in the order of their value references.

    Outputs come first, the coefficients before all others, because FMI tools plot what comes first.
    """
    strains = strain_names(inverse_map.n_gauges)
    outputs = [
        *_estimated_coefficients(inverse_map, strains),
        *_estimated_loads(inverse_map, strains),
        *_health(inverse_map, strains),
    ]
    strain_inputs = [
        Variable(
            name,
            f"Strain of gauge {gauge} at x = {x:.4g} m, roll angle {degrees(atan2(y, z)) % 360.0:.4g} deg",
            "input",
            unit="1",
            display_unit="um/m",
            nominal=_nominal(strain_range, noise),
            start=0.0,
        )
        for name, gauge, (x, y, z), strain_range, noise in zip(
            strains,
            inverse_map.gauge_names,
            inverse_map.gauge_position,
            inverse_map.strain_range,
            inverse_map.noise_std,
            strict=True,
        )
    ]
    dynamic_pressure = Variable(
        "dynamic_pressure",
        "Free-stream dynamic pressure; turns loads into coefficients",
        "input",
        unit="Pa",
        display_unit="kPa",
        nominal=inverse_map.nominal_dynamic_pressure,
        minimum=0.0,
        start=inverse_map.nominal_dynamic_pressure,
    )
    return (*outputs, *strain_inputs, dynamic_pressure)


def plant_interface(flight_model: FlightModel) -> tuple[Variable, ...]:
    """Return the variables of the plant FMU in the order of their value references."""
    noise = ("noise_std", "seed")
    coefficients = [
        Variable(name, f"{text}, true value", "output", unit="1") for name, text in COEFFICIENTS.items()
    ]
    strains = [
        Variable(
            name,
            f"Strain of gauge {gauge} at roll angle {degrees(angle) % 360.0:.4g} deg, with noise",
            "output",
            unit="1",
            display_unit="um/m",
            initially_depends_on=noise,
        )
        for name, gauge, angle in zip(
            strain_names(flight_model.n_gauges),
            flight_model.gauge_names,
            flight_model.gauge_roll_angle,
            strict=True,
        )
    ]
    parameters = [
        Variable(
            "noise_std",
            "Standard deviation of the noise on every strain",
            "parameter",
            "fixed",
            unit="1",
            display_unit="um/m",
            minimum=0.0,
            start=flight_model.noise_std,
        ),
        Variable("seed", "Seed of the noise", "parameter", "fixed", "Integer", minimum=0, start=1),
    ]
    return (*coefficients, *strains, *_flight_condition(), *parameters)


def _flight_condition() -> list[Variable]:
    """Return the plant's outputs that say where on the trajectory it is."""
    return [
        Variable(
            "dynamic_pressure",
            "Free-stream dynamic pressure",
            "output",
            unit="Pa",
            display_unit="kPa",
            minimum=0.0,
        ),
        Variable("mach_number", "Free-stream Mach number", "output", unit="1", minimum=0.0),
        Variable("angle_of_attack", "Angle of attack", "output", unit="rad", display_unit="deg"),
        Variable("sideslip_angle", "Angle of sideslip", "output", unit="rad", display_unit="deg"),
        Variable("altitude", "Geopotential altitude", "output", unit="m", display_unit="km"),
    ]


def _estimated_coefficients(inverse_map: InverseMap, strains: tuple[str, ...]) -> list[Variable]:
    """Return the five coefficients and their standard deviations."""
    ranges = inverse_map.coefficient_range
    nominals = [_nominal(max(abs(low), abs(high))) for low, high in ranges]
    values = [
        Variable(name, text, "output", unit="1", nominal=nominal, depends_on=(*strains, "dynamic_pressure"))
        for (name, text), nominal in zip(COEFFICIENTS.items(), nominals, strict=True)
    ]
    deviations = [
        Variable(
            f"sigma.{name}",
            f"Standard deviation of {name}",
            "output",
            unit="1",
            minimum=0.0,
            depends_on=("dynamic_pressure",),
        )
        for name in COEFFICIENTS
    ]
    return [*values, *deviations]


def _estimated_loads(inverse_map: InverseMap, strains: tuple[str, ...]) -> list[Variable]:
    """Return the five forces and moments and their standard deviations."""
    area, length = inverse_map.reference_area, inverse_map.reference_length
    scale = inverse_map.nominal_dynamic_pressure * area
    values = [
        Variable(
            name,
            text,
            "output",
            unit=unit,
            display_unit=f"k{unit}",
            nominal=_nominal(scale * (length if unit == "N.m" else 1.0) * max(abs(low), abs(high))),
            depends_on=strains,
            dependencies_kind="constant",
        )
        for (name, (text, unit)), (low, high) in zip(LOADS.items(), inverse_map.coefficient_range, strict=True)
    ]
    deviations = [
        Variable(f"sigma.{name}", f"Standard deviation of {name}", "output", unit=unit, minimum=0.0)
        for name, (_, unit) in LOADS.items()
    ]
    return [*values, *deviations]


def _health(inverse_map: InverseMap, strains: tuple[str, ...]) -> list[Variable]:
    """Return what tells how far the estimate may be believed."""
    freedom = inverse_map.residual_degrees_of_freedom
    everything = (*strains, "dynamic_pressure")
    return [
        Variable(
            "health.state",
            "State of the estimate",
            "output",
            "discrete",
            "Enumeration",
            declared_type=HEALTH_TYPE,
            depends_on=everything,
        ),
        Variable(
            "health.chi_square",
            f"Chi-square of the residual, {freedom} expected",
            "output",
            unit="1",
            nominal=_nominal(freedom),
            minimum=0.0,
            depends_on=strains,
        ),
        Variable(
            "health.chi_square_limit",
            "Alarm level of the chi-square",
            "output",
            unit="1",
            nominal=_nominal(freedom),
            minimum=0.0,
        ),
    ]


def _nominal(*candidates: float) -> float | None:
    """Return the first positive candidate: FMI tools scale by nominal, so zero is never one."""
    return next((float(value) for value in candidates if value > 0.0), None)


def value_references(interface: Sequence[Variable]) -> dict[str, int]:
    """Return the value reference of each variable name: its place in the interface."""
    return {variable.name: place for place, variable in enumerate(interface)}
