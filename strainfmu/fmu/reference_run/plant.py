"""Reference runs of the FMUs round the estimator: plant, autopilot and schedule, computed in numpy.

The native ones are C; what they are held against are the flight model, noise, law and schedule of
:mod:`strainfmu.cosim`, which have no code in common with it.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from math import floor, log10

import numpy as np

from strainfmu.arrays import FloatArray
from strainfmu.atmosphere import LAYERS, dynamic_pressure
from strainfmu.cosim.models.autopilot import AutopilotSettings
from strainfmu.cosim.models.autopilot_law import AutopilotSample, autopilot_design, first_state, next_state
from strainfmu.cosim.models.flight_model import FlightModel, evaluate
from strainfmu.cosim.models.plant_law import Plant, plant_rows
from strainfmu.cosim.models.schedule import ScheduledSignal, schedule_interface, value_at
from strainfmu.cosim.models.trajectory import Trajectory
from strainfmu.errors import InputError
from strainfmu.estimator.air_inputs import DYNAMIC_PRESSURE
from strainfmu.flight_condition import ALTITUDE, ANGLE_OF_ATTACK, CONDITION_NAMES, MACH_NUMBER, SIDESLIP_ANGLE
from strainfmu.fmu.reference_run.flight_path import rounded
from strainfmu.fmu.reference_run.run import ReferenceRun, layered_standard_files
from strainfmu.interface.estimator_variables import valid_names
from strainfmu.interface.fmi_variables import COEFFICIENTS, Variable, shown_unit
from strainfmu.interface.plant_variables import FlightStart, GaugeFault, Motion, native_plant_interface

STEP_SIZE, AUTOPILOT_STEP = 0.01, 0.02
N_ROWS = 21
FEWEST_ROWS = 3

FAULTS = ((GaugeFault.BIAS, 1e-4), (GaugeFault.DRIFT, 1e-3), (GaugeFault.STUCK, 2e-4), (GaugeFault.FROZEN, 0.0))
"""Of the first gauges in a run: kind and value [m/m, m/m per s, m/m]; no NaN, which CSV readers differ on."""

_ROUND_OFF = 1e-12
"""Coefficients below are what the sine of pi leaves of 0."""

_SWING = 0.5
"""Amplitude of the pitch acceleration that the control moment would give [rad/s2]."""


@dataclass(frozen=True, eq=False)
class Reference:
    """A reference run as an FMU holds it.

    Attributes
    ----------
    source : what computed it.
    run : None where the vehicle is outside the envelope at once: then the FMU holds nothing of it.
    groups : what the figure of it shows: text of the legend by signal, by title of the panel.
    in_steps : whether all signals are drawn in steps.
    """

    source: str
    run: ReferenceRun | None
    groups: Mapping[str, Mapping[str, str]] = field(default_factory=dict)
    in_steps: bool = False

    @property
    def contents(self) -> dict[str, object]:
        """Its entry in the FMU's list of contents."""
        return {} if self.run is None else {"reference": self.source}

    def files(self, interface: Sequence[Variable]) -> dict[str, bytes]:
        """Return content by name inside the FMU."""
        return {} if self.run is None else layered_standard_files(self.run, interface)


def plant_reference(plant: Plant) -> Reference:
    """Return a run of the native plant with failing gauges; it ends where the vehicle leaves the envelope.

    There is none where it does so within the first steps, as one does that starts outside.
    """
    kinds = {f"strain[{k}]": f"{k}: {kind.name.lower()}" for k, (kind, _) in enumerate(FAULTS, start=1)}
    return Reference("strainfmu.cosim.models.plant_law (numpy)", _plant_run(plant), _plant_groups(kinds))


def _plant_groups(gauges: Mapping[str, str]) -> dict[str, dict[str, str]]:
    """Return what the figure of a plant's run shows, of the strains ``gauges`` and one that is healthy."""
    last = f"strain[{len(gauges) + 1}]"
    return {
        "Strain": {**gauges, last: f"{len(gauges) + 1}: healthy"},
        "Flow": {"angle_of_attack": "angle of attack", "sideslip_angle": "sideslip"},
        "Forces": {name: name for name in ("C_A", "C_N", "C_Y")},
        "Moments": {name: name for name in ("M_P", "M_Y")},
        "Control": {"control_moment": "moment"},
    }


def _plant_run(plant: Plant) -> ReferenceRun | None:
    step = STEP_SIZE if plant.trajectory is None else covering_step(plant.trajectory.stop_time, N_ROWS - 1)
    time = _times(step, N_ROWS)
    inputs = {name: rounded(values) for name, values in _plant_inputs(plant, time).items()}
    rows: list[dict[str, float]] = []
    try:
        for row in plant_rows(plant, time, inputs):
            rows.append(row)  # kept where a later one is outside the envelope
    except InputError:
        if len(rows) < FEWEST_ROWS:
            return None
    interface = native_plant_interface(
        vehicle=plant.model, motion=plant.motion, start=plant.start, seed=plant.seed
    )
    outputs = [variable.name for variable in interface if variable.causality == "output"]
    n = len(rows)
    return ReferenceRun(
        np.array(time[:n]),
        {name: values[:n] for name, values in inputs.items()},
        {name: _cleaned(name, np.array([row[name] for row in rows])) for name in outputs},
    )


def _plant_inputs(plant: Plant, time: Sequence[float]) -> dict[str, FloatArray]:
    """Return (n,) inputs by name: a tour of the envelope or a swinging moment, and faults in the middle."""
    phase = np.linspace(0.0, 2.0 * np.pi, len(time))
    model, start = plant.model, plant.start
    largest = float(model.incidence_knots[-1])
    inputs: dict[str, FloatArray] = {}
    if plant.motion is Motion.INPUTS:
        low, high = model.mach_knots[[0, -1]].tolist()
        altitude = min(max(start.altitude, 0.0), LAYERS[-1][0] - 1e3)
        inputs = {
            MACH_NUMBER: np.linspace(0.9 * low + 0.1 * high, 0.1 * low + 0.9 * high, len(time)),
            ANGLE_OF_ATTACK: 0.6 * largest * np.sin(phase),
            SIDESLIP_ANGLE: 0.4 * largest * np.cos(phase),
            ALTITUDE: altitude + np.linspace(0.0, 1e3, len(time)),
        }
    elif plant.motion is Motion.SHORT_PERIOD:
        inputs = {
            SIDESLIP_ANGLE: start.sideslip_angle + 0.05 * largest * (1.0 + np.sin(phase)),
            "control_moment": _SWING * start.pitch_inertia * np.sin(phase),
        }
    failing = (np.arange(len(time)) >= len(time) // 4) & (np.arange(len(time)) < 3 * len(time) // 4)
    for gauge, (kind, value) in enumerate(FAULTS[: model.n_gauges], start=1):
        inputs[f"fault_kind[{gauge}]"] = np.where(failing, float(kind), 0.0)
        inputs[f"fault_value[{gauge}]"] = np.where(failing, value, 0.0)
    return inputs


def python_plant_reference(model: FlightModel, trajectory: Trajectory, seed: int = 1) -> Reference:
    """Return a run of the plant of kind python, which has no inputs: along its trajectory and past its end.

    Its noise comes from numpy's PCG64, one draw per communication point.
    """
    source = "strainfmu.cosim.models.flight_model (numpy), which is inside the FMU too"
    return Reference(source, _python_plant_run(model, trajectory, seed), _plant_groups({}))


def _python_plant_run(model: FlightModel, trajectory: Trajectory, seed: int) -> ReferenceRun | None:
    time = _times(covering_step(trajectory.stop_time, N_ROWS - 1), N_ROWS)
    conditions = [trajectory.condition_at(t) for t in time]
    try:
        points = [evaluate(model, condition) for condition in conditions]
    except InputError:
        return None
    noise = np.random.Generator(np.random.PCG64(seed)).standard_normal((len(time), model.n_gauges))
    strain = np.array([point.strain for point in points]) + model.noise_std * noise * model.noise_scale
    coefficients = np.array([point.coefficients for point in points])
    flown = np.array([condition.as_tuple() for condition in conditions])
    outputs = {
        **{name: _cleaned(name, column) for name, column in zip(COEFFICIENTS, coefficients.T, strict=True)},
        **dict(zip(model.reading_names, strain.T, strict=True)),
        DYNAMIC_PRESSURE: np.array([point.dynamic_pressure for point in points]),
        **dict(zip(CONDITION_NAMES, flown.T, strict=True)),
    }
    return ReferenceRun(np.array(time), {}, outputs)


def autopilot_reference(model: FlightModel, start: FlightStart, settings: AutopilotSettings) -> Reference:
    """Return a run of the autopilot for a vehicle and start: a command, a suspect gauge, bad estimates.

    Row 0 holds the start values, as importers differ on whether inputs count during initialization.

    Raises
    ------
    InputError
        No autopilot can be made for the vehicle.
    """
    design = autopilot_design(model, start)
    time = _times(AUTOPILOT_STEP, 2 * N_ROWS)
    row = np.arange(len(time))
    swing = np.sin(0.35 * row)
    largest = 0.6 * float(np.abs(design.table[:, 1]).max())
    pressure = dynamic_pressure(start.mach_number, start.altitude)
    inputs = {
        "commanded_angle_of_attack": np.where(row < 10, 0.0, 0.02),
        "C_N": largest * swing,
        "M_P": 0.01 * swing,
        "chi_square": np.where((row > 25) & (row < 38), 2.0, 0.5 * (row > 0)),
        "suspect_gauge": 1.0 * ((row > 12) & (row < 18)),
        DYNAMIC_PRESSURE: pressure * (1.0 + 0.1 * swing),
        "pitch_rate": 0.01 * np.sin(0.5 * row),
    }
    inputs = {name: rounded(values) for name, values in inputs.items()}
    samples = []
    for k in range(len(time)):
        at_row = {name: float(values[max(k - 1, 0)]) for name, values in inputs.items()}
        suspect = int(at_row.pop("suspect_gauge"))
        samples.append(AutopilotSample(chi_square_limit=1.0, suspect_gauge=suspect, **at_row))
    state = first_state(design=design, settings=settings, n_gauges=model.n_gauges, sample=samples[0], time=time[0])
    rows = []
    for k, (now, sample) in enumerate(zip(time, samples, strict=True)):
        if k > 0:
            state = next_state(design=design, settings=settings, state=state, sample=sample, time=now)
        rows.append([state.control_moment, state.angle, state.trusted, state.valid.count(False), *state.valid])
    columns = np.array(rows, dtype=float).T
    names = ("control_moment", "estimated_angle_of_attack", "trusted", "isolated_gauges")
    outputs = (*names, *valid_names(model.n_gauges))
    run = ReferenceRun(np.array(time), inputs, dict(zip(outputs, columns, strict=True)))
    return Reference("strainfmu.cosim.models.autopilot_law (numpy)", run, _AUTOPILOT_GROUPS)


_AUTOPILOT_GROUPS = {
    "Incidence": {"commanded_angle_of_attack": "commanded", "estimated_angle_of_attack": "inferred"},
    "Moment": {"control_moment": "of the controls"},
    "Estimate": {"C_N": "C_N", "M_P": "M_P"},
    "Gauges": {"trusted": "trusted", "suspect_gauge": "suspect", "isolated_gauges": "out of use"},
}


def schedule_reference(signals: Sequence[ScheduledSignal]) -> Reference:
    """Return the schedule over all its times, and one step more; it has no inputs."""
    last = max(time for signal in signals for time in signal.times)
    step = covering_step(max(last, STEP_SIZE), 2 * N_ROWS)
    time = _times(step, floor(last / step + 1e-9) + 3)
    # A time of the table is met by the sum of steps that gives it, whatever the round-off.
    outputs = {
        signal.variable.name: np.array([value_at(signal, t * (1.0 + 1e-12)) for t in time]) for signal in signals
    }
    run = ReferenceRun(np.array(time), {}, outputs)
    by_unit: dict[str, dict[str, str]] = {}
    for variable in schedule_interface(signals):
        by_unit.setdefault(shown_unit(variable)[0], {})[variable.name] = variable.name
    groups = {f"Signals {k}": names for k, names in enumerate(by_unit.values(), start=1)}
    return Reference("strainfmu.cosim.models.schedule (numpy)", run, groups, in_steps=True)


def covering_step(span: float, n_steps: int) -> float:
    """Return the minimum of 1, 2, 5 times a power of ten [s] of which ``n_steps`` cover ``span`` [s]."""
    minimum = span / n_steps * (1.0 - 1e-12)
    power = 10.0 ** floor(log10(minimum))
    return float(f"{next(m * power for m in (1.0, 2.0, 5.0, 10.0) if m * power >= minimum):.3g}")


def _times(step: float, n: int) -> list[float]:
    """Return n decimal numbers: what a file holds is what is computed with."""
    return [float(f"{step * k:.10g}") for k in range(n)]


def _cleaned(name: str, values: FloatArray) -> FloatArray:
    return np.where(np.abs(values) < _ROUND_OFF, 0.0, values) if name in COEFFICIENTS else values
