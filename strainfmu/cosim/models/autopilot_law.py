"""The autopilot's law in numpy, sample by sample: what :mod:`strainfmu.cosim.models.autopilot` derives.

The native FMU computes it in C (``fmus/native/autopilot/autopilot.c``); its reference run comes from here.
"""

from dataclasses import dataclass, replace
from math import isfinite

import numpy as np

from strainfmu.arrays import FloatArray
from strainfmu.atmosphere import speed_of_sound
from strainfmu.cosim.models.autopilot import AutopilotSettings, normal_force_table
from strainfmu.cosim.models.flight_model import FlightModel
from strainfmu.interface.plant_variables import FlightStart

# Communication points are sums of steps: a time that is held for exactly hold_time is not longer than that.
_ROUND_OFF = 1e-9


@dataclass(frozen=True, eq=False)
class AutopilotDesign:
    """What an autopilot is designed for.

    Attributes
    ----------
    table : (k, 2) rows of angle of attack [rad] and C_N [1], both rising.
    reference_area, reference_length : S [m2], L [m].
    mass, pitch_inertia, speed : m [kg], I [kg m2], V [m/s].
    """

    table: FloatArray
    reference_area: float
    reference_length: float
    mass: float
    pitch_inertia: float
    speed: float


@dataclass(frozen=True)
class AutopilotSample:
    """The inputs at one sample; fields are the FMU's inputs, in their units."""

    commanded_angle_of_attack: float
    C_N: float
    M_P: float
    chi_square: float
    chi_square_limit: float
    suspect_gauge: int
    dynamic_pressure: float
    pitch_rate: float


@dataclass(frozen=True)
class AutopilotState:
    """The outputs after a sample, and what the next one remembers.

    Attributes
    ----------
    valid : (n_d,) whether each gauge may be used.
    control_moment : [N m].
    angle : inferred angle of attack [rad].
    trusted : whether the estimate is used.
    good : last C_N and M_P that were, None without any.
    good_time : of the last trusted estimate [s].
    suspect, times : number of the gauge that does not fit, 0 for none, and for how many samples in a row.
    unexplained : d, acceleration that nothing explains [rad/s2].
    predicted_rate, predicted_acceleration : of the angle of attack, for the next sample [rad/s, rad/s2].
    observed_at : time of the last sample that gave a rate [s]; None if it gave none.
    """

    valid: tuple[bool, ...]
    control_moment: float = 0.0
    angle: float = 0.0
    trusted: bool = False
    good: tuple[float, float] | None = None
    good_time: float = 0.0
    suspect: int = 0
    times: int = 0
    unexplained: float = 0.0
    predicted_rate: float = 0.0
    predicted_acceleration: float = 0.0
    observed_at: float | None = None


def autopilot_design(model: FlightModel, start: FlightStart) -> AutopilotDesign:
    """Return the design for a vehicle and flight condition.

    Raises
    ------
    InputError
        As :func:`~strainfmu.cosim.models.autopilot.normal_force_table`.
    """
    return AutopilotDesign(
        table=normal_force_table(model, start),
        reference_area=model.reference_area,
        reference_length=model.reference_length,
        mass=start.mass,
        pitch_inertia=start.pitch_inertia,
        speed=start.mach_number * speed_of_sound(start.altitude),
    )


def first_state(
    design: AutopilotDesign,
    settings: AutopilotSettings,
    n_gauges: int,
    sample: AutopilotSample,
    time: float,
) -> AutopilotState:
    """Return the state after the sample at ``time`` [s], the start, which takes no gauge out of use.

    So ``valid`` depends on nothing there, and a loop of estimator and autopilot needs no iteration to begin.
    """
    state = AutopilotState(valid=(True,) * n_gauges)
    never = replace(settings, confirmations=0)
    return next_state(design=design, settings=never, state=state, sample=sample, time=time)


def next_state(
    design: AutopilotDesign,
    settings: AutopilotSettings,
    state: AutopilotState,
    sample: AutopilotSample,
    time: float,
) -> AutopilotState:
    """Return the state after the sample at ``time`` [s]."""
    known = _with_health(settings, state, sample, time)
    return _with_moment(design, settings, known, sample, time)


def _with_health(
    settings: AutopilotSettings, state: AutopilotState, sample: AutopilotSample, time: float
) -> AutopilotState:
    """Decide which estimate is used, and which gauges."""
    finite = isfinite(sample.C_N) and isfinite(sample.M_P)
    trusted = finite and not (sample.suspect_gauge > 0 or sample.chi_square > sample.chi_square_limit)
    overdue = time - state.good_time > settings.hold_time * (1.0 + _ROUND_OFF)
    good = state.good
    if finite and (trusted or overdue or good is None):
        good = (sample.C_N, sample.M_P)
    elif not finite and overdue:
        good = None
    gauge, valid = sample.suspect_gauge, state.valid
    times = (state.times + 1 if gauge == state.suspect else 1) if gauge > 0 else 0
    confirmed = 0 < settings.confirmations <= times and gauge <= len(valid)
    if confirmed and valid[gauge - 1] and valid.count(False) < settings.largest_isolated:
        valid, times = (*valid[: gauge - 1], False, *valid[gauge:]), 0
    good_time = time if trusted else state.good_time
    return replace(state, valid=valid, trusted=trusted, good=good, good_time=good_time, suspect=gauge, times=times)


def _with_moment(
    design: AutopilotDesign,
    settings: AutopilotSettings,
    state: AutopilotState,
    sample: AutopilotSample,
    time: float,
) -> AutopilotState:
    """Find the moment that gives the second-order motion, or, without an estimate, damps the pitch rate."""
    w, maximum, inertia = settings.frequency, settings.largest_moment, design.pitch_inertia
    damping, rate = 2.0 * settings.damping_ratio * w, sample.pitch_rate
    if state.good is None or not isfinite(sample.dynamic_pressure) or not isfinite(rate):
        moment = _bounded(-inertia * damping * rate, maximum) if isfinite(rate) else 0.0
        return replace(state, control_moment=moment, observed_at=None)
    normal_force, pitching = state.good
    angle, slope = _angle_of(design.table, normal_force)
    scale, momentum = sample.dynamic_pressure * design.reference_area, design.mass * design.speed
    angle_rate = rate - scale * normal_force / momentum
    relief = scale * slope / momentum * angle_rate
    aerodynamic = scale * design.reference_length * pitching
    state = _observed(settings.observer_rate, state, angle_rate, time)
    acceleration = w**2 * (sample.commanded_angle_of_attack - angle) - damping * angle_rate - state.unexplained
    moment = _bounded(inertia * (acceleration + relief) - aerodynamic, maximum)
    predicted = (moment + aerodynamic) / inertia - relief + state.unexplained
    return replace(state, control_moment=moment, angle=angle, predicted_acceleration=predicted)


def _observed(observer_rate: float, state: AutopilotState, angle_rate: float, time: float) -> AutopilotState:
    """Compare the rate of the angle of attack with the one predicted: the filtered difference is unexplained."""
    if observer_rate == 0.0:
        return replace(state, unexplained=0.0, predicted_rate=angle_rate, observed_at=time)
    if state.observed_at is None or not state.trusted:  # nothing new is known: go on from here
        predicted = angle_rate - state.unexplained / observer_rate
        return replace(state, predicted_rate=predicted, observed_at=time)
    predicted = state.predicted_rate + (time - state.observed_at) * state.predicted_acceleration
    unexplained = observer_rate * (angle_rate - predicted)
    return replace(state, unexplained=unexplained, predicted_rate=predicted, observed_at=time)


def _angle_of(table: FloatArray, normal_force: float) -> tuple[float, float]:
    """Return the angle of attack at a C_N and dC_N/da there: linear between the rows, the ends prolonged."""
    i = min(max(int(np.searchsorted(table[:, 1], normal_force)) - 1, 0), len(table) - 2)
    (angle, force), (next_angle, next_force) = table[i].tolist(), table[i + 1].tolist()
    slope = (next_force - force) / (next_angle - angle)
    return angle + (normal_force - force) / slope, slope


def _bounded(moment: float, maximum: float) -> float:
    return min(max(moment, -maximum), maximum)
