"""The interface of the plant FMU: true coefficients, noisy strains and the flight condition out."""

from __future__ import annotations

from dataclasses import dataclass, replace
from enum import IntEnum
from math import degrees
from typing import Protocol

from strainfmu.arrays import FloatArray
from strainfmu.interface.fmi_variables import COEFFICIENTS, Variable, strain_names


class StrainedVehicle(Protocol):
    """What the plant's variables say of a vehicle: its gauges and their noise.

    Attributes
    ----------
    n_gauges : number of gauges n_d.
    gauge_names : n_d names.
    gauge_roll_angle : (n_d,) roll angle of each gauge [rad].
    noise_std : standard deviation of the noise on every strain [m/m].
    """

    @property
    def n_gauges(self) -> int: ...
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
            array="strain",
        )
        for name, gauge, angle in zip(
            strain_names(vehicle.n_gauges),
            vehicle.gauge_names,
            vehicle.gauge_roll_angle,
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
            start=vehicle.noise_std,
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
    n = vehicle.n_gauges
    given = {
        Motion.INPUTS: ("mach_number", "angle_of_attack", "sideslip_angle", "altitude"),
        Motion.TRAJECTORY: (),
        Motion.SHORT_PERIOD: ("mach_number", "sideslip_angle", "altitude"),
    }[motion]
    variables = []
    for variable in plant_interface(vehicle):
        if variable.name in given:
            variable = replace(variable, causality="input", start=getattr(start, variable.name))
        elif variable.causality == "output":
            variable = _with_dependencies(variable, given, motion)
        elif variable.name == "seed":
            variable = replace(variable, maximum=2**31 - 1, start=seed)
        variables.append(variable)
    tail = _short_period(start) if motion is Motion.SHORT_PERIOD else []
    return (*variables, *_faults(vehicle, n), *tail)


def _with_dependencies(output: Variable, given: tuple[str, ...], motion: Motion) -> Variable:
    """Say on which inputs an output depends, and on which parameters its first value does."""
    depends_on: tuple[str, ...] = given
    initial = ("initial_angle_of_attack",) if motion is Motion.SHORT_PERIOD else ()
    if output.array == "strain":
        place = output.name.removeprefix("strain")
        depends_on = (*given, f"fault_kind{place}", f"fault_value{place}")
    elif output.name == "dynamic_pressure":
        depends_on, initial = tuple(name for name in given if name in ("mach_number", "altitude")), ()
    elif output.name not in COEFFICIENTS:
        depends_on = ()
    return replace(output, depends_on=depends_on, initially_depends_on=(*output.initially_depends_on, *initial))


def _faults(vehicle: StrainedVehicle, n_gauges: int) -> list[Variable]:
    """Return the inputs that make gauges fail."""
    kinds = ", ".join(f"{int(kind)} {kind.name.lower()}" for kind in GaugeFault)
    names = vehicle.gauge_names
    return [
        *(
            Variable(
                f"fault_kind[{i}]",
                f"Fault of gauge {names[i - 1]}: {kinds}",
                "input",
                "discrete",
                "Integer",
                minimum=0,
                maximum=int(max(GaugeFault)),
                start=0,
                array="fault_kind",
            )
            for i in range(1, n_gauges + 1)
        ),
        *(
            Variable(
                f"fault_value[{i}]",
                f"Gauge {names[i - 1]}: bias [m/m], drift [m/m per s] or stuck reading [m/m]",
                "input",
                unit="1",
                display_unit="um/m",
                start=0.0,
                array="fault_value",
            )
            for i in range(1, n_gauges + 1)
        ),
    ]


def _short_period(start: FlightStart) -> list[Variable]:
    """Return what the short-period motion adds."""
    positive = 1e-300  # FMI's minimum is a value that is allowed
    return [
        Variable(
            "pitch_rate",
            "Pitch rate, positive nose-up",
            "output",
            unit="rad/s",
            display_unit="deg/s",
        ),
        Variable(
            "control_moment",
            "Pitching moment of the controls, positive nose-up",
            "input",
            unit="N.m",
            display_unit="kN.m",
            start=0.0,
        ),
        Variable("mass", "Mass", "parameter", "fixed", unit="kg", minimum=positive, start=start.mass),
        Variable(
            "pitch_inertia",
            "Moment of inertia about the y axis through the moment reference point",
            "parameter",
            "fixed",
            unit="kg.m2",
            minimum=positive,
            start=start.pitch_inertia,
        ),
        Variable(
            "pitch_damping",
            "Derivative of M_P by pitch rate times L/(2 V)",
            "parameter",
            "fixed",
            unit="1",
            start=start.pitch_damping,
        ),
        Variable(
            "initial_angle_of_attack",
            "Angle of attack at the start",
            "parameter",
            "fixed",
            unit="rad",
            display_unit="deg",
            start=start.angle_of_attack,
        ),
    ]
