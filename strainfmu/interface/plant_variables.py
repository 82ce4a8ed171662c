"""The interface of the plant FMU: true coefficients, noisy strains and the flight condition out."""

from __future__ import annotations

from dataclasses import dataclass, replace
from enum import IntEnum
from math import degrees
from typing import TYPE_CHECKING, Protocol

from strainfmu.arrays import FloatArray
from strainfmu.estimator.air_inputs import DYNAMIC_PRESSURE
from strainfmu.estimator.signal_names import STRAIN
from strainfmu.flight_condition import (
    ALTITUDE,
    ANGLE_OF_ATTACK,
    CONDITION_NAMES,
    CONDITION_QUANTITIES,
    MACH_NUMBER,
    SIDESLIP_ANGLE,
)
from strainfmu.interface.fmi_variables import COEFFICIENTS, Variable, strain_names
from strainfmu.interface.sensor_variables import display_unit, fmi_units, reading_names, sensor_names

if TYPE_CHECKING:
    from strainfmu.estimator.map.sensors import SensorRows


class StrainedVehicle(Protocol):
    """The vehicle as the plant's variables describe it: its gauges and sensors, and their noise.

    Attributes
    ----------
    n_gauges : number of rows n_d: strain gauges, then auxiliary sensors.
    n_strain_gauges : number of strain gauges.
    gauge_names : n_d names.
    sensors : what the rows read; None of strain gauges alone.
    gauge_roll_angle : (n_d,) roll angle of each gauge [rad].
    noise_std : standard deviation of the noise on every strain [m/m].
    """

    @property
    def n_gauges(self) -> int: ...
    @property
    def n_strain_gauges(self) -> int: ...
    @property
    def sensors(self) -> SensorRows | None: ...
    @property
    def gauge_names(self) -> tuple[str, ...]: ...
    @property
    def gauge_roll_angle(self) -> FloatArray: ...
    @property
    def noise_std(self) -> float: ...


def plant_interface(vehicle: StrainedVehicle) -> tuple[Variable, ...]:
    """Return the variables of the plant FMU in the order of their value references."""
    noise = ("noise_std", "seed")
    coefficients = [
        Variable(name=name, description=f"{text}, true value", causality="output", unit="1")
        for name, text in COEFFICIENTS.items()
    ]
    strains = [
        Variable(
            name=name,
            description=f"Strain of gauge {gauge} at roll angle {degrees(angle) % 360.0:.4g} deg, with noise",
            causality="output",
            unit="1",
            display_unit="um/m",
            initially_depends_on=noise,
            array=STRAIN,
        )
        for name, gauge, angle in zip(
            strain_names(vehicle.n_strain_gauges),
            vehicle.gauge_names[: vehicle.n_strain_gauges],
            vehicle.gauge_roll_angle[: vehicle.n_strain_gauges],
            strict=True,
        )
    ]
    parameters = [
        Variable(
            name="noise_std",
            description="Standard deviation of the noise on every strain"
            + ("" if vehicle.sensors is None else "; the noise of auxiliary sensors is in proportion to it"),
            causality="parameter",
            variability="fixed",
            unit="1",
            display_unit="um/m",
            minimum=0.0,
            start=vehicle.noise_std,
        ),
        Variable(
            name="seed",
            description="Seed of the noise",
            causality="parameter",
            variability="fixed",
            fmi_type="Integer",
            minimum=0,
            start=1,
        ),
    ]
    return (*coefficients, *strains, *_sensors(vehicle, noise), *_flight_condition(), *parameters)


def _sensors(vehicle: StrainedVehicle, noise: tuple[str, ...]) -> list[Variable]:
    """Return the outputs of the auxiliary sensors."""
    rows, first = vehicle.sensors, vehicle.n_strain_gauges
    if rows is None:
        return []
    units = fmi_units(rows)
    return [
        Variable(
            name=name,
            description=f"{rows.kind[i].capitalize()} of sensor {vehicle.gauge_names[i]}, with noise; thrust 0",
            causality="output",
            unit=units[i],
            display_unit=display_unit(units[i]),
            initially_depends_on=noise,
        )
        for i, name in enumerate(sensor_names(vehicle), start=first)
    ]


_CONDITION_TEXT = {
    MACH_NUMBER: "Free-stream Mach number",
    ANGLE_OF_ATTACK: "Angle of attack",
    SIDESLIP_ANGLE: "Angle of sideslip",
    ALTITUDE: "Geopotential altitude",
}


def _flight_condition() -> list[Variable]:
    """Return the plant's outputs that state the flight condition."""
    pressure = Variable(
        name=DYNAMIC_PRESSURE,
        description="Free-stream dynamic pressure",
        causality="output",
        unit="Pa",
        display_unit="kPa",
        minimum=0.0,
    )
    return [
        pressure,
        *(
            Variable(
                name=quantity.name,
                description=_CONDITION_TEXT[quantity.name],
                causality="output",
                unit=quantity.unit,
                display_unit=None if quantity.shown == quantity.unit else quantity.shown,
                minimum=0.0 if quantity.name == MACH_NUMBER else None,
            )
            for quantity in CONDITION_QUANTITIES
        ),
    ]


class Motion(IntEnum):
    """Where the native plant's flight condition comes from."""

    INPUTS = 0
    """Mach number, angles and altitude are inputs."""
    TRAJECTORY = 1
    """All of it from a trajectory in the FMU."""
    SHORT_PERIOD = 2
    """Angle of attack and pitch rate from the equations of motion, the rest is inputs."""


class GaugeFault(IntEnum):
    """What is wrong with a gauge: values of ``fault_kind``.

    An Integer and no Enumeration, since free co-simulation engines connect no Enumerations.
    """

    NONE = 0
    DROPOUT = 1
    """It reads not-a-number."""
    BIAS = 2
    """It reads ``fault_value`` too much."""
    DRIFT = 3
    """It reads more and more too much: ``fault_value`` per second since the onset."""
    STUCK = 4
    """It reads ``fault_value``, whatever the strain, and no noise."""
    FROZEN = 5
    """It goes on reading what it read at the communication point before the onset."""


@dataclass(frozen=True)
class FlightStart:
    """Start values of the native plant's flight condition and of the vehicle's short-period motion.

    Attributes
    ----------
    mach_number : [1].
    altitude : geopotential [m].
    angle_of_attack : [rad].
    sideslip_angle : [rad].
    mass : of the vehicle [kg].
    pitch_inertia : moment of inertia about the y axis through the moment reference point [kg m2].
    pitch_damping : derivative of M_P by q L / (2 V) [1].
    """

    mach_number: float
    altitude: float
    angle_of_attack: float = 0.0
    sideslip_angle: float = 0.0
    mass: float = 400.0
    pitch_inertia: float = 350.0
    pitch_damping: float = -20.0


def native_plant_interface(
    vehicle: StrainedVehicle, motion: Motion, start: FlightStart, seed: int = 1
) -> tuple[Variable, ...]:
    """Return the variables of the native plant FMU in the order of their value references."""
    index = {name: f"[{i}]" for i, name in enumerate(reading_names(vehicle), start=1)}
    input_names = {
        Motion.INPUTS: CONDITION_NAMES,
        Motion.TRAJECTORY: (),
        Motion.SHORT_PERIOD: tuple(name for name in CONDITION_NAMES if name != ANGLE_OF_ATTACK),
    }[motion]
    variables = []
    for variable in plant_interface(vehicle):
        if variable.name in input_names:
            variable = replace(variable, causality="input", start=getattr(start, variable.name))
        elif variable.causality == "output":
            variable = _with_dependencies(variable, input_names, motion, index.get(variable.name))
        elif variable.name == "seed":
            variable = replace(variable, maximum=2**31 - 1, start=seed)
        variables.append(variable)
    tail = _short_period(start) if motion is Motion.SHORT_PERIOD else []
    return (*variables, *_faults(vehicle), *tail)


def _with_dependencies(
    output: Variable, input_names: tuple[str, ...], motion: Motion, row: str | None
) -> Variable:
    """Return an output with the inputs that it depends on, and the parameters that its first value depends on.

    ``row`` is the index of a reading, in brackets.

    Outside the envelope coefficients, strains and dynamic pressure are NaN: all depend on the whole condition.
    """
    depends_on: tuple[str, ...] = input_names
    initial = ("initial_angle_of_attack",) if motion is Motion.SHORT_PERIOD else ()
    if row is not None:
        depends_on = (*input_names, f"fault_kind{row}", f"fault_value{row}")
    elif output.name != DYNAMIC_PRESSURE and output.name not in COEFFICIENTS:
        depends_on = ()
    return replace(output, depends_on=depends_on, initially_depends_on=(*output.initially_depends_on, *initial))


def _faults(vehicle: StrainedVehicle) -> list[Variable]:
    """Return the inputs that make gauges and auxiliary sensors fail."""
    n_gauges, first = vehicle.n_gauges, vehicle.n_strain_gauges
    units = ["1"] * n_gauges if vehicle.sensors is None else fmi_units(vehicle.sensors)
    shown = ["m/m"] * first + units[first:]
    kinds = ", ".join(f"{int(kind)} {kind.name.lower()}" for kind in GaugeFault)
    names = vehicle.gauge_names
    return [
        *(
            Variable(
                name=f"fault_kind[{i}]",
                description=f"Fault of {'gauge' if i <= first else 'sensor'} {names[i - 1]}: {kinds}",
                causality="input",
                variability="discrete",
                fmi_type="Integer",
                minimum=0,
                maximum=int(max(GaugeFault)),
                start=0,
                array="fault_kind",
            )
            for i in range(1, n_gauges + 1)
        ),
        *(
            Variable(
                name=f"fault_value[{i}]",
                description=f"{'Gauge' if i <= first else 'Sensor'} {names[i - 1]}: bias [{shown[i - 1]}], "
                f"drift [{shown[i - 1]} per s] or stuck reading [{shown[i - 1]}]",
                causality="input",
                unit=units[i - 1],
                display_unit="um/m" if i <= first else display_unit(units[i - 1]),
                start=0.0,
                array="fault_value",
            )
            for i in range(1, n_gauges + 1)
        ),
    ]


def _short_period(start: FlightStart) -> list[Variable]:
    """Return what the short-period motion adds."""
    positive = 1e-6  # FMI's minimum is a value that is allowed
    return [
        Variable(
            name="pitch_rate",
            description="Pitch rate, positive nose-up",
            causality="output",
            unit="rad/s",
            display_unit="deg/s",
        ),
        Variable(
            name="control_moment",
            description="Pitching moment of the controls, positive nose-up",
            causality="input",
            unit="N.m",
            display_unit="kN.m",
            start=0.0,
        ),
        Variable(
            name="mass",
            description="Mass",
            causality="parameter",
            variability="fixed",
            unit="kg",
            minimum=positive,
            start=start.mass,
        ),
        Variable(
            name="pitch_inertia",
            description="Moment of inertia about the y axis through the moment reference point",
            causality="parameter",
            variability="fixed",
            unit="kg.m2",
            minimum=positive,
            start=start.pitch_inertia,
        ),
        Variable(
            name="pitch_damping",
            description="Derivative of M_P by pitch rate times L/(2 V)",
            causality="parameter",
            variability="fixed",
            unit="1",
            start=start.pitch_damping,
        ),
        Variable(
            name="initial_angle_of_attack",
            description="Angle of attack at the start",
            causality="parameter",
            variability="fixed",
            unit="rad",
            display_unit="deg",
            start=start.angle_of_attack,
        ),
    ]
