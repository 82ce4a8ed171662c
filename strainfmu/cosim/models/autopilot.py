"""The autopilot that holds a commanded angle of attack through C_N and M_P: its settings, data and interface.

The law inverts the short-period motion. With w the frequency and z the damping ratio of the closed loop,

    a'  = q - q_inf S C_N / (m V)
    I q' = q_inf S L M_P + M_control
    M_control = I [w^2 (a_c - a) - (2 z w - Z) a'] - q_inf S L M_P,  Z = q_inf S (dC_N/da) / (m V)

gives a'' = w^2 (a_c - a) - 2 z w a': the poles are the roots of s^2 + 2 z w s + w^2, whatever the vehicle. The
angle of attack a is not measured: it is read from C_N, which rises with it. An error of M_P would leave a standing
error of a; so what accelerates a without being explained, d, is observed and subtracted from the bracket's first
term:

    d = p (a' - integral of (a'' as predicted, with d in it)),

the pole of which is -p and which leaves the step response as it is. The damping that the air gives is part of d.
``fmus/native/autopilot/autopilot.c`` is the law in C, :mod:`strainfmu.cosim.models.autopilot_law` in numpy.
"""

from dataclasses import dataclass

import numpy as np

from strainfmu.arrays import FloatArray
from strainfmu.atmosphere import dynamic_pressure, speed_of_sound
from strainfmu.cosim.models.flight_model import FlightModel, evaluate
from strainfmu.errors import InputError
from strainfmu.estimator.air_inputs import DYNAMIC_PRESSURE
from strainfmu.estimator.signal_names import VALID
from strainfmu.flight_condition import FlightCondition
from strainfmu.interface.estimator_variables import valid_names
from strainfmu.interface.fmi_variables import Variable
from strainfmu.interface.plant_variables import FlightStart

# Steps of the C_N table: linear between them, an error of the angle far below that of any estimate.
_TABLE_STEPS = 80


@dataclass(frozen=True)
class AutopilotSettings:
    """Start values of the autopilot's tunable parameters.

    Attributes
    ----------
    frequency : w, natural frequency of the angle of attack under control [rad/s].
    damping_ratio : z [1].
    observer_rate : p, rate at which unexplained accelerations are found [rad/s]; 0 for never.
    largest_moment : bound on the control moment [N m].
    hold_time : for how long the last good estimate stands in for one that is missing or suspect [s].
    confirmations : samples in a row after which a suspect gauge is taken out of use; 0 for never.
    largest_isolated : number of gauges that may be taken out of use.
    """

    frequency: float = 4.0
    damping_ratio: float = 0.8
    observer_rate: float = 2.0
    largest_moment: float = 2000.0
    hold_time: float = 0.1
    confirmations: int = 3
    largest_isolated: int = 4


def normal_force_table(model: FlightModel, start: FlightStart) -> FloatArray:
    """Return (k, 2) rows of angle of attack [rad] and C_N [1] at the flight condition of ``start``.

    Raises
    ------
    InputError
        The sideslip is outside the model's envelope, or C_N does not rise with the angle of attack.
    """
    limit = float(model.incidence_knots[-1])
    if abs(start.sideslip_angle) >= limit:
        raise InputError(f"sideslip: {start.sideslip_angle:g} rad found, the flight model ends at {limit:g} rad")
    # cos a_T = cos a cos b: the largest angle of attack that total incidence leaves.
    largest = float(np.arccos(np.cos(limit) / np.cos(start.sideslip_angle))) * (1.0 - 1e-9)
    angles = np.linspace(-largest, largest, _TABLE_STEPS + 1)
    values = [
        evaluate(
            model,
            FlightCondition(
                mach_number=start.mach_number,
                angle_of_attack=angle,
                sideslip_angle=start.sideslip_angle,
                altitude=start.altitude,
            ),
        ).coefficients[1]
        for angle in angles.tolist()
    ]
    if not np.all(np.diff(values) > 0.0):
        raise InputError("flight model: C_N does not rise with the angle of attack, which the autopilot needs")
    return np.column_stack((angles, values))


def autopilot_data(model: FlightModel, start: FlightStart) -> FloatArray:
    """Return the constants of the law and its C_N table, as autopilot.c reads them."""
    table = normal_force_table(model, start)
    speed = start.mach_number * speed_of_sound(start.altitude)
    head = [
        model.n_gauges,
        len(table),
        model.reference_area,
        model.reference_length,
        start.mass,
        start.pitch_inertia,
        speed,
    ]
    return np.concatenate((head, table.ravel()))


def autopilot_interface(
    model: FlightModel, start: FlightStart, settings: AutopilotSettings
) -> tuple[Variable, ...]:
    """Return the variables of the autopilot FMU in the order of their value references.

    Outputs change at communication points only, so at one of them they depend on no input.
    """
    return (*_outputs(model), *_inputs(start), *_parameters(settings))


_ESTIMATE = ("C_N", "M_P")
_RATES = (DYNAMIC_PRESSURE, "pitch_rate")
_FIRST_MOMENT = (
    *_ESTIMATE,
    *_RATES,
    "commanded_angle_of_attack",
    "frequency",
    "damping_ratio",
    "largest_moment",
)
"""What the control moment depends on at the start; nothing is unexplained, held or confirmed yet."""


def _outputs(model: FlightModel) -> list[Variable]:
    """Return the outputs; those without initial dependencies have one value at every start."""
    valid = [
        Variable(
            name=name,
            description=f"Whether gauge {gauge} may be used; false once it was taken out of use",
            causality="output",
            variability="discrete",
            fmi_type="Boolean",
            array=VALID,
        )
        for name, gauge in zip(valid_names(model.n_gauges), model.gauge_names, strict=True)
    ]
    return [
        Variable(
            name="control_moment",
            description="Pitching moment demanded of the controls, positive nose-up",
            causality="output",
            unit="N.m",
            display_unit="kN.m",
            initially_depends_on=_FIRST_MOMENT,
        ),
        Variable(
            name="estimated_angle_of_attack",
            description="Angle of attack inferred from C_N",
            causality="output",
            unit="rad",
            display_unit="deg",
            initially_depends_on=(*_ESTIMATE, *_RATES),
        ),
        Variable(
            name="trusted",
            description="Whether the estimate is used: it is finite and fits its gauges",
            causality="output",
            variability="discrete",
            fmi_type="Boolean",
            initially_depends_on=(*_ESTIMATE, "chi_square", "chi_square_limit", "suspect_gauge"),
        ),
        Variable(
            name="isolated_gauges",
            description="Number of gauges taken out of use",
            causality="output",
            variability="discrete",
            fmi_type="Integer",
            minimum=0,
            maximum=model.n_gauges,
        ),
        *valid,
    ]


def _inputs(start: FlightStart) -> list[Variable]:
    nominal = dynamic_pressure(start.mach_number, start.altitude)
    return [
        Variable(
            name="commanded_angle_of_attack",
            description="Angle of attack to hold",
            causality="input",
            unit="rad",
            display_unit="deg",
            start=0.0,
        ),
        Variable(
            name="C_N", description="Normal force coefficient, positive up", causality="input", unit="1", start=0.0
        ),
        Variable(
            name="M_P",
            description="Pitching moment coefficient, positive nose-up",
            causality="input",
            unit="1",
            start=0.0,
        ),
        Variable(
            name="chi_square",
            description="Chi-square of the estimate's residual",
            causality="input",
            unit="1",
            start=0.0,
        ),
        Variable(
            name="chi_square_limit",
            description="Its alarm level: above it the estimate is suspect",
            causality="input",
            unit="1",
            start=1.0,
        ),
        Variable(
            name="suspect_gauge",
            description="Number, from 1, of the gauge that does not fit; 0 for none",
            causality="input",
            variability="discrete",
            fmi_type="Integer",
            minimum=0,
            start=0,
        ),
        Variable(
            name=DYNAMIC_PRESSURE,
            description="Free-stream dynamic pressure",
            causality="input",
            unit="Pa",
            display_unit="kPa",
            start=nominal,
        ),
        Variable(
            name="pitch_rate",
            description="Pitch rate, positive nose-up",
            causality="input",
            unit="rad/s",
            display_unit="deg/s",
            start=0.0,
        ),
    ]


def _parameters(settings: AutopilotSettings) -> list[Variable]:
    positive = 1e-6  # FMI's minimum is a value that is allowed
    reals = (
        ("frequency", "Natural frequency of the angle of attack under control", "rad/s", None, positive, 1e6),
        ("damping_ratio", "Damping ratio of the angle of attack under control", "1", None, 0.0, 1e6),
        ("observer_rate", "Rate at which unexplained accelerations are found", "rad/s", None, 0.0, 1e6),
        ("largest_moment", "Bound on the control moment", "N.m", "kN.m", 0.0, 1e12),
        ("hold_time", "How long the last good estimate stands in for a suspect one", "s", "ms", 0.0, 1e6),
    )
    integers = (
        ("confirmations", "Samples in a row after which a suspect gauge is taken out of use; 0: never"),
        ("largest_isolated", "How many gauges may be taken out of use"),
    )
    return [
        *(
            Variable(
                name=name,
                description=text,
                causality="parameter",
                variability="tunable",
                unit=unit,
                display_unit=shown,
                minimum=low,
                maximum=high,
                start=getattr(settings, name),
            )
            for name, text, unit, shown, low, high in reals
        ),
        *(
            Variable(
                name=name,
                description=text,
                causality="parameter",
                variability="tunable",
                fmi_type="Integer",
                minimum=0,
                maximum=10**6,
                start=getattr(settings, name),
            )
            for name, text in integers
        ),
    ]
