"""The native plant in numpy, row by row: strains with noise and faults, true coefficients, motion.

The native FMU computes it in C (``fmus/native/plant/plant.c``); its reference run comes from here.
docs/explanation/flight.md holds the equations.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from math import ceil

import numpy as np

from strainfmu.arrays import FloatArray
from strainfmu.atmosphere import speed_of_sound
from strainfmu.cosim.models.flight_model import FlightModel, evaluate
from strainfmu.cosim.models.gauge_noise import gauge_noise
from strainfmu.cosim.models.trajectory import Trajectory
from strainfmu.estimator.air_inputs import DYNAMIC_PRESSURE
from strainfmu.flight_condition import CONDITION_NAMES, FlightCondition
from strainfmu.interface.fmi_variables import COEFFICIENTS
from strainfmu.interface.plant_variables import FlightStart, GaugeFault, Motion

SUBSTEP = 1e-3
"""Largest step of the integration [s]."""

_FAULT_INPUTS = ("fault_kind", "fault_value")
_FAULTS = [GaugeFault.DROPOUT, GaugeFault.BIAS, GaugeFault.DRIFT, GaugeFault.STUCK, GaugeFault.FROZEN]


@dataclass(frozen=True)
class Plant:
    """A plant FMU: what it flies and how it starts.

    Attributes
    ----------
    trajectory : for ``Motion.TRAJECTORY``, None otherwise.
    start : start values of inputs and parameters.
    seed : of the noise.
    """

    model: FlightModel
    motion: Motion
    start: FlightStart
    trajectory: Trajectory | None = None
    seed: int = 1


@dataclass(frozen=True, eq=False)
class _Gauges:
    """Readings (n_d,) of all gauges: kind and onset of the fault, last reading [m/m], the one that is held."""

    kind: FloatArray
    onset: FloatArray
    last: FloatArray
    stuck: FloatArray


def plant_rows(
    plant: Plant, time: Sequence[float], inputs: Mapping[str, FloatArray]
) -> Iterator[dict[str, float]]:
    """Yield the variables of the flight at each time [s]: row 0 of the inputs' first row, row k of row k - 1.

    Parameters
    ----------
    inputs : (n,) by name, for n times; an input that is not there keeps its start value.

    Raises
    ------
    InputError
        The flight condition has left the envelope.
    """
    n = plant.model.n_gauges
    gauges = _Gauges(*np.zeros((4, n)))
    angle_and_rate = np.array([plant.start.angle_of_attack, 0.0])
    for k, now in enumerate(time):
        row_inputs = _inputs_of_row(inputs, max(k - 1, 0))
        if k and plant.motion is Motion.SHORT_PERIOD:
            angle_and_rate = _moved(plant, row_inputs, angle_and_rate, now - time[k - 1])
        sampled = gauge_noise(plant.seed, k, n) * plant.model.noise_std * plant.model.noise_scale
        row, gauges = _at(plant, row_inputs, angle_and_rate, sampled, gauges, now)
        yield row
        # The inputs of the coming step count from here on: faults begin, and this is what FROZEN goes back to.
        row_inputs = _inputs_of_row(inputs, k)
        row, gauges = _at(plant, row_inputs, angle_and_rate, sampled, gauges, now)
        gauges = replace(gauges, last=np.array([row[name] for name in plant.model.reading_names]))


def _inputs_of_row(inputs: Mapping[str, FloatArray], row: int) -> dict[str, float]:
    return {name: float(values[row]) for name, values in inputs.items()}


def _at(
    plant: Plant,
    inputs: Mapping[str, float],
    angle_and_rate: FloatArray,
    noise: FloatArray,
    gauges: _Gauges,
    time: float,
) -> tuple[dict[str, float], _Gauges]:
    """Return the variables at ``time`` and the gauges, whose faults begin at their first sample."""
    condition = _condition(plant, inputs, float(angle_and_rate[0]), time)
    point = evaluate(plant.model, condition, time)
    n = plant.model.n_gauges
    kind, value = (np.array([inputs.get(f"{name}[{i + 1}]", 0.0) for i in range(n)]) for name in _FAULT_INPUTS)
    begins = kind != gauges.kind
    onset, stuck = np.where(begins, time, gauges.onset), np.where(begins, gauges.last, gauges.stuck)
    healthy = point.strain + noise
    read = [np.full(n, np.nan), healthy + value, healthy + value * (time - onset), value, stuck]
    strain = np.select([kind == fault for fault in _FAULTS], read, healthy)
    row = {
        **dict(zip(COEFFICIENTS, point.coefficients.tolist(), strict=True)),
        **dict(zip(plant.model.reading_names, strain.tolist(), strict=True)),
        DYNAMIC_PRESSURE: point.dynamic_pressure,
        **dict(zip(CONDITION_NAMES, condition.as_tuple(), strict=True)),
        "pitch_rate": float(angle_and_rate[1]),
    }
    return row, _Gauges(kind=kind, onset=onset, last=gauges.last, stuck=stuck)


def _condition(plant: Plant, inputs: Mapping[str, float], angle: float, time: float) -> FlightCondition:
    if plant.trajectory is not None:
        return plant.trajectory.condition_at(time)
    values = [inputs.get(name, getattr(plant.start, name)) for name in CONDITION_NAMES]
    if plant.motion is Motion.SHORT_PERIOD:
        values[1] = angle
    return FlightCondition(*values)


def _moved(plant: Plant, inputs: Mapping[str, float], state: FloatArray, width: float) -> FloatArray:
    """Return angle of attack and pitch rate after ``width`` [s] by the classical Runge-Kutta method."""
    steps = max(ceil(width / SUBSTEP - 1e-9), 1)
    h = width / steps
    for _ in range(steps):
        k1 = _rates(plant, inputs, state)
        k2 = _rates(plant, inputs, state + 0.5 * h * k1)
        k3 = _rates(plant, inputs, state + 0.5 * h * k2)
        k4 = _rates(plant, inputs, state + h * k3)
        state = state + h / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + k4)
    return state


def _rates(plant: Plant, inputs: Mapping[str, float], state: FloatArray) -> FloatArray:
    """Return the derivatives of angle of attack [rad/s] and pitch rate [rad/s2]."""
    angle, rate = state.tolist()
    model, start = plant.model, plant.start
    condition = _condition(plant, inputs, angle, 0.0)
    point = evaluate(model, condition)
    speed = condition.mach_number * speed_of_sound(condition.altitude)
    force = point.dynamic_pressure * model.reference_area
    damping = start.pitch_damping * rate * model.reference_length / (2.0 * speed)
    moment = force * model.reference_length * (float(point.coefficients[3]) + damping)
    moment += inputs.get("control_moment", 0.0)
    return np.array(
        [rate - force * float(point.coefficients[1]) / (start.mass * speed), moment / start.pitch_inertia]
    )
