"""Closed-loop flight: the FMUs of a scenario, how they are connected, and how a run scores.

    schedule -> plant -> estimator -> autopilot -> plant (delayed)

Four FMUs: the schedule commands and makes gauges fail; the plant flies and strains; the estimator turns strains
into coefficients; the autopilot closes the loop through them, and takes bad gauges out of the estimator's use.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from strainfmu.arrays import FloatArray
from strainfmu.cosim.models.flight_model import FlightModel, load_flight_model
from strainfmu.cosim.models.schedule import ScheduledSignal
from strainfmu.cosim.scenario import FaultEvent, Scenario
from strainfmu.cosim.systems.master import simulate
from strainfmu.cosim.systems.recording import Recording
from strainfmu.cosim.systems.system import Connection, System
from strainfmu.errors import InputError
from strainfmu.estimator.air_inputs import DYNAMIC_PRESSURE
from strainfmu.estimator.health import HealthState
from strainfmu.interface.estimator_variables import valid_names
from strainfmu.interface.fmi_variables import Variable
from strainfmu.interface.plant_variables import GaugeFault, Motion, native_plant_interface

INSTANCES = ("schedule", "plant", "estimator", "autopilot")
"""Names of the instances, in the order in which they are stepped."""

_VALUED = (GaugeFault.BIAS, GaugeFault.DRIFT, GaugeFault.STUCK)
"""Faults that have a value."""

HOLDING = np.radians(1.0)
"""Largest error of the angle of attack just before a new command in a loop that holds [rad]."""


def scheduled_signals(scenario: Scenario, model: FlightModel) -> list[ScheduledSignal]:
    """Return commands and faults as signals.

    Raises
    ------
    InputError
        A fault names a gauge that is not there, or a gauge gets two faults at one time.
    """
    command = Variable(
        name="commanded_angle_of_attack",
        description="Angle of attack to hold",
        causality="output",
        unit="rad",
        display_unit="deg",
    )
    signals = [
        ScheduledSignal(
            command,
            tuple(item.time for item in scenario.commands),
            tuple(item.angle_of_attack for item in scenario.commands),
        )
    ]
    inputs = {v.name: v for v in native_plant_interface(model, Motion.SHORT_PERIOD, scenario.start)}
    events: dict[int, list[FaultEvent]] = {}
    for fault in scenario.faults:
        number = gauge_number(fault.gauge, model)
        is_sensor = number > model.n_strain_gauges
        if fault.kind in _VALUED and fault.of_sensor != is_sensor:
            unit = "in the unit of the sensor, 'value' or 'drift_per_s'" if is_sensor else "in um/m"
            raise InputError(f"fault: {fault.gauge!r}: expected its value {unit}")
        events.setdefault(number, []).append(fault)
    for number, faults in sorted(events.items()):
        for name in ("fault_kind", "fault_value"):
            values = [float(f.kind) if name == "fault_kind" else f.value for f in faults]
            times = [fault.time for fault in faults]
            if times[0] > 0.0:
                times, values = [0.0, *times], [0.0, *values]
            variable = replace(inputs[f"{name}[{number}]"], causality="output", start=None, array=None)
            signals.append(ScheduledSignal(variable, tuple(times), tuple(values)))
    return signals


def gauge_number(gauge: str | int, model: FlightModel) -> int:
    """Return the number, from 1, of a gauge given by name or number.

    Raises
    ------
    InputError
        There is no such gauge.
    """
    if isinstance(gauge, str) and gauge in model.gauge_names:
        return model.gauge_names.index(gauge) + 1
    if isinstance(gauge, int) and 1 <= gauge <= model.n_gauges:
        return gauge
    raise InputError(
        f"fault: gauge {gauge!r} found, must be a number from 1 to {model.n_gauges} or a name such as "
        f"'{model.gauge_names[0]}'"
    )


def flight_connections(model: FlightModel, signals: Sequence[str], feedback: str) -> tuple[Connection, ...]:
    """Return what goes where.

    Parameters
    ----------
    model : of the vehicle that flies: all that its gauges and sensors read goes to the estimator.
    signals : names of the schedule's outputs.
    feedback : "truth" or "estimate": where the autopilot's coefficients come from.
    """
    command, *faults = signals
    connections = [("schedule", command, "autopilot", command)]
    connections += [("plant", name, "estimator", name) for name in (*model.reading_names, DYNAMIC_PRESSURE)]
    connections += [("plant", name, "autopilot", name) for name in ("pitch_rate", DYNAMIC_PRESSURE)]
    source = "estimator" if feedback == "estimate" else "plant"
    connections += [(source, name, "autopilot", name) for name in ("C_N", "M_P")]
    # What begins at a communication point acts from there on, so the plant gets it for the step that follows.
    delayed = [("schedule", name, "plant", name) for name in faults]
    delayed += [("autopilot", "control_moment", "plant", "control_moment")]
    if feedback == "estimate":
        watched = ("chi_square", "chi_square_limit", "suspect_gauge")
        connections += [("estimator", f"health.{name}", "autopilot", name) for name in watched]
        delayed += [("autopilot", name, "estimator", name) for name in valid_names(model.n_gauges)]
    return (
        *(Connection(f"{a}.{x}", f"{b}.{y}") for a, x, b, y in connections),
        *(Connection(f"{a}.{x}", f"{b}.{y}", delayed=True) for a, x, b, y in delayed),
    )


def flight_system(scenario: Scenario, fmus: dict[str, Path], feedback: str) -> System:
    """Return the connected FMUs ``fmus`` of a scenario, paths by name of the instance."""
    model = load_flight_model(scenario.flight_model)
    signals = [signal.variable.name for signal in scheduled_signals(scenario, model)]
    return System(fmus, flight_connections(model, signals, feedback))


def fly(
    scenario: Scenario,
    fmus: dict[str, Path],
    feedback: str,
    progress: Callable[[float], None] | None = None,
    at_once: bool = False,
) -> Recording:
    """Simulate a scenario with FMPy and return all outputs; ``at_once`` as other engines do it.

    Raises
    ------
    InputError, StrainfmuError
        As :func:`~strainfmu.cosim.systems.master.simulate`.
    """
    system = flight_system(scenario, fmus, feedback)
    return simulate(system, scenario.stop_time, scenario.step_size, None, progress, at_once)


@dataclass(frozen=True)
class FaultReport:
    """Response to one fault: seconds until health reports it, and until the gauge is out of use; or None."""

    event: FaultEvent
    reported_after: float | None
    isolated_after: float | None


@dataclass(frozen=True)
class FlightResult:
    """Score of one run.

    Attributes
    ----------
    tracking_error : rms of commanded less true angle of attack [rad].
    settled_error : largest size of that within the last second before a new command, or before the end [rad].
    angle_error : rms of inferred less true angle of attack [rad].
    coefficient_error : rms of estimated less true C_N and M_P [1].
    health : fraction of the samples by state.
    faults : one report per fault.
    holds : whether settled_error is below :data:`HOLDING`.
    """

    tracking_error: float
    settled_error: float
    angle_error: float
    coefficient_error: tuple[float, float]
    health: dict[str, float]
    faults: tuple[FaultReport, ...]

    @property
    def holds(self) -> bool:
        return self.settled_error < HOLDING


def flight_result(scenario: Scenario, recording: Recording, model: FlightModel) -> FlightResult:
    """Score one run."""
    time, angle = recording.time, recording["plant.angle_of_attack"]
    error = recording["schedule.commanded_angle_of_attack"] - angle
    ends = [*(command.time for command in scenario.commands[1:]), scenario.stop_time + 1e-9]
    settled = np.zeros(len(time), dtype=bool)
    for end in ends:
        window = max(1.0, 1.5 * scenario.step_size)  # one sample at least
        settled |= (time > end - window) & (time < end - 0.5 * scenario.step_size)
    states = recording["estimator.health.state"]
    return FlightResult(
        tracking_error=_rms(error),
        settled_error=float(np.abs(error[settled]).max()),
        angle_error=_rms(recording["autopilot.estimated_angle_of_attack"] - angle),
        coefficient_error=(
            _rms(recording["estimator.C_N"] - recording["plant.C_N"]),
            _rms(recording["estimator.M_P"] - recording["plant.M_P"]),
        ),
        health={state.name: float(np.mean(states == state)) for state in HealthState if np.any(states == state)},
        faults=tuple(_fault_report(event, recording, model) for event in scenario.faults),
    )


def _rms(values: FloatArray) -> float:
    """Return the root mean square of what is finite: no estimate is no error."""
    return float(np.sqrt(np.mean(values[np.isfinite(values)] ** 2)))


def _fault_report(event: FaultEvent, recording: Recording, model: FlightModel) -> FaultReport:
    """Return when a fault was reported: health is not OK and differs from that just before it.

    Different means another state, another number of gauges in use, or another suspect.
    """
    time = recording.time
    after = time >= event.time - 1e-9
    if event.kind is GaugeFault.NONE:
        return FaultReport(event, None, None)
    reports = np.stack(
        [recording[f"estimator.health.{name}"] for name in ("state", "valid_gauges", "suspect_gauge")]
    )
    before = reports[:, np.flatnonzero(~after)[-1]] if not after.all() else [HealthState.OK, model.n_gauges, 0.0]
    changed = np.any(reports != np.reshape(before, (-1, 1)), axis=0)
    reported = after & (reports[0] != HealthState.OK) & changed
    isolated = after & (recording[f"autopilot.valid[{gauge_number(event.gauge, model)}]"] == 0.0)
    first = [float(time[samples][0]) - event.time if samples.any() else None for samples in (reported, isolated)]
    return FaultReport(event, first[0], first[1])


def fault_text(event: FaultEvent) -> str:
    """Return a fault in a few words."""
    if event.kind is GaugeFault.NONE:
        return f"gauge {event.gauge} healed at {event.time:g} s"
    size = f" {event.value:g}" if event.of_sensor else f" {1e6 * event.value:g} um/m"
    value = f"{size} per s" if event.kind is GaugeFault.DRIFT else size
    of_which = f"{'sensor' if event.of_sensor else 'gauge'} {event.gauge}"
    return f"{event.kind.name.lower()}{value if event.kind in _VALUED else ''} of {of_which} at {event.time:g} s"
