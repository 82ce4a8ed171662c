"""The interface of the estimator FMU: every variable described once.

:func:`estimator_interface` gives the variables in the order of ``ModelVariables`` of FMI 2.0, scalar by scalar;
the value reference of a variable is its index in that order. :func:`estimator_arrays` turns the list into the list
of FMI 3.0. The model descriptions, the documentation page and the FMUs' code all follow these lists.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

from strainfmu.estimator.air_inputs import AIR_INPUTS, DYNAMIC_PRESSURE
from strainfmu.estimator.estimate import Estimate
from strainfmu.estimator.map.inverse_map import InverseMap, has_filter
from strainfmu.estimator.policies import POLICIES
from strainfmu.estimator.settings import (
    LARGEST_SETTING,
    OF_ALARMS,
    OF_AREA,
    OF_LENGTH,
    OF_READINGS,
    OF_STATION,
    SETTING_INPUTS,
    default_settings,
    setting_minimum,
)
from strainfmu.estimator.signal_names import (
    COEFFICIENT_ARRAY,
    FILTER_TIME_CONSTANT,
    FORCE,
    MOMENT,
    STRAIN,
    VALID,
)
from strainfmu.interface.enumerations import HEALTH_TYPE
from strainfmu.interface.flight_variables import (
    flight_interface,
    flight_outputs,
    with_inertial_inputs,
    with_last_variables,
    with_later_inputs,
)
from strainfmu.interface.fmi_variables import COEFFICIENTS, Variable, deviation_of, with_arrays
from strainfmu.interface.health_names import (
    CHI_SQUARE,
    CHI_SQUARE_LIMIT,
    ENVELOPE_SCORE,
    STATE,
    SUSPECT_GAUGE,
    SUSPECTS,
    VALID_GAUGES,
)
from strainfmu.interface.input_names import FLOW_INPUTS as FLOW_INPUTS
from strainfmu.interface.input_names import NOT_GIVEN
from strainfmu.interface.input_names import NOT_KNOWN as NOT_KNOWN
from strainfmu.interface.input_names import PARAMETERS as PARAMETERS
from strainfmu.interface.other_load_variables import OTHER_LOAD_ARRAYS, other_load_values, with_other_load_outputs
from strainfmu.interface.parameter_variables import with_parameter_inputs
from strainfmu.interface.sensor_variables import PREFIX as SENSOR_PREFIX
from strainfmu.interface.sensor_variables import (
    TEMPERATURE_ARRAYS,
    place_text,
    reading_names,
    sensor_inputs,
    with_temperature_inputs,
    with_thrust_input,
)
from strainfmu.interface.zero_variables import ZERO_ARRAYS, with_tare_variables, with_zero_parameters


@dataclass(frozen=True)
class LoadSignal:
    """One of the five loads: ``label`` in words, ``sense`` what is positive, ``unit``."""

    label: str
    sense: str
    unit: str


LOADS = {
    "force.axial": LoadSignal("Axial force", "positive aft, fore-body", "N"),
    "force.normal": LoadSignal("Normal force", "positive up", "N"),
    "force.side": LoadSignal("Side force", "positive to starboard", "N"),
    "moment.pitch": LoadSignal("Pitching moment", "positive nose-up", "N.m"),
    "moment.yaw": LoadSignal("Yawing moment", "positive nose to starboard", "N.m"),
}
"""The five loads by the names of their outputs."""


def valid_names(n_gauges: int) -> tuple[str, ...]:
    """Return ``valid[1]`` .. ``valid[n]``."""
    return tuple(f"valid[{i}]" for i in range(1, n_gauges + 1))


def estimator_interface(inverse_map: InverseMap) -> tuple[Variable, ...]:
    """Return the variables of the estimator FMU in the order of their value references.

    Outputs come first, the coefficients before all others, because FMI tools plot what comes first. A gauge that
    goes invalid changes the gain, so that every output depends on every strain and on every ``valid``.
    """
    gauges = (*reading_names(inverse_map), *valid_names(inverse_map.n_gauges))
    strain_gauges = inverse_map.gauge_names[: inverse_map.n_strain_gauges]
    zero_offset = inverse_map.zero_offset[: len(strain_gauges)].tolist()
    linear = (
        *_estimated_coefficients(inverse_map, gauges),
        *_estimated_loads(inverse_map, gauges),
        *_health(inverse_map, gauges),
        *_gauge_inputs(inverse_map),
        *_flow_inputs(inverse_map),
        *_parameters(inverse_map),
    )
    variables = linear if inverse_map.manifold is None else flight_interface(linear, inverse_map.manifold, gauges)
    variables = with_temperature_inputs(
        with_zero_parameters(variables, strain_gauges, zero_offset), inverse_map.thermal
    )
    variables = (*with_thrust_input(variables, inverse_map), *_filter_parameter(inverse_map))
    variables = with_tare_variables(with_other_load_outputs(variables, inverse_map), strain_gauges)
    variables = with_later_inputs(with_parameter_inputs(variables, inverse_map), inverse_map.manifold)
    return with_inertial_inputs(with_last_variables(variables, inverse_map), inverse_map)


def output_values(estimate: Estimate, with_other_loads: bool = False) -> list[float]:
    """Return the outputs of ``estimate`` in the order of their value references; the state of the tare is none.

    ``with_other_loads`` for maps that have loads in addition to the five as outputs
    (:func:`~strainfmu.estimator.map.inverse_map.groups_of_outputs`).
    """
    of_flight = flight_outputs(estimate) if len(estimate.air_data_used) > 0 else ()
    other_loads = other_load_values(estimate) if with_other_loads else ()
    return [
        *_linear_outputs(estimate),
        *of_flight,
        *other_loads,
        *estimate.parameter_score.tolist(),
        float(estimate.usable),
    ]


def _linear_outputs(estimate: Estimate) -> list[float]:
    return [
        *estimate.coefficients.tolist(),
        *estimate.coefficients_std.tolist(),
        *estimate.loads.tolist(),
        *estimate.loads_std.tolist(),
        float(estimate.health),
        estimate.chi_square,
        estimate.chi_square_limit,
        float(estimate.valid.sum()),
        float(estimate.suspects[0] + 1) if estimate.suspects else 0.0,
        float(len(estimate.suspects)),
        estimate.envelope_score,
    ]


def estimator_arrays(interface: Sequence[Variable]) -> tuple[Variable, ...]:
    """Return the variables of the FMI 3.0 estimator in the order of their value references."""
    has_sensors = any(variable.name.startswith(SENSOR_PREFIX) for variable in interface)
    valid = "Whether each gauge, then each sensor, may be used; order of the inputs"
    return with_arrays(interface, {**ARRAYS, VALID: valid} if has_sensors else ARRAYS)


ARRAYS = {
    COEFFICIENT_ARRAY: "C_A, C_N, C_Y, M_P, M_Y: force coefficients axial, normal, side; moment pitching, yawing",
    "sigma.coefficients": "Standard deviations of the coefficients, same order",
    FORCE: "Axial (positive aft, fore-body), normal (up) and side (to starboard) force",
    MOMENT: "Pitching (positive nose-up) and yawing (nose to starboard) moment",
    "sigma.force": "Standard deviations of the forces, same order",
    "sigma.moment": "Standard deviations of the moments, same order",
    STRAIN: "Strain of each gauge; names and positions in the documentation",
    VALID: "Whether each gauge may be used; same order as strain",
    **ZERO_ARRAYS,
    **TEMPERATURE_ARRAYS,
    **OTHER_LOAD_ARRAYS,
}


def _gauge_text(gauge: str, x: float, y: float, z: float) -> str:
    """Return the description of the strain of ``gauge`` at x, y, z [m] in body axes."""
    return f"Strain of gauge {gauge} at {place_text(x, y, z)}"


def _gauge_inputs(inverse_map: InverseMap) -> list[Variable]:
    """Return strain of every gauge, readings of auxiliary sensors, and whether each may be used.

    Strains have no minimum and no maximum: what lies beyond the sensor range is a state of health, not an error.
    """
    n = inverse_map.n_strain_gauges
    strains = [
        Variable(
            name=f"strain[{i}]",
            description=_gauge_text(gauge, x, y, z),
            causality="input",
            kind="reading",
            unit="1",
            display_unit="um/m",
            nominal=_nominal(strain_range, noise),
            start=0.0,
            array=STRAIN,
        )
        for i, (gauge, (x, y, z), strain_range, noise) in enumerate(
            zip(
                inverse_map.gauge_names[:n],
                inverse_map.gauge_position[:n],
                inverse_map.strain_range[:n],
                inverse_map.noise_std[:n],
                strict=True,
            ),
            start=1,
        )
    ]
    valid = [
        Variable(
            name=f"valid[{i}]",
            description=f"Whether {'gauge' if i <= n else 'sensor'} {gauge} may be used",
            causality="input",
            kind="reading",
            variability="discrete",
            fmi_type="Boolean",
            start=True,
            array=VALID,
        )
        for i, gauge in enumerate(inverse_map.gauge_names, start=1)
    ]
    return [*strains, *sensor_inputs(inverse_map), *valid]


def _flow_inputs(inverse_map: InverseMap) -> list[Variable]:
    """Return the inputs for flow and navigation of every map."""
    nominal, use = inverse_map.nominal_dynamic_pressure, _USE[inverse_map.follows_pressure]
    return [
        Variable(
            name=air_input.name,
            description=air_input.text_of_linear.format(of=inverse_map, not_given=NOT_GIVEN, use=use),
            causality="input",
            kind="air data",
            label=air_input.label,
            symbol=air_input.symbol,
            unit=air_input.unit,
            display_unit=air_input.shown,
            nominal=nominal if air_input.unit == "Pa" else None,
            minimum=0.0,
            start=nominal if air_input.name == DYNAMIC_PRESSURE else 0.0,
        )
        for air_input in AIR_INPUTS
        if air_input.name in FLOW_INPUTS
    ]


_USE = {False: "turns loads into coefficients", True: "weights of the strains follow it"}
"""What a linear map does with the dynamic pressure, by whether it follows it."""


def _pressure_of_loads(inverse_map: InverseMap) -> tuple[str, ...]:
    """Return the inputs besides gauges that loads depend on: none in form "absolute".

    In form "dynamic_pressure" there are no loads where the standard deviation is impossible.
    """
    return FLOW_INPUTS[:2] if inverse_map.follows_pressure else ()


def _parameters(inverse_map: InverseMap) -> list[Variable]:
    """Return the tunable parameters; their ranges are those that the estimator refuses to leave."""
    default = default_settings(inverse_map)
    return [
        Variable(
            name=parameter.name,
            description=parameter.text,
            causality="parameter",
            kind="parameter",
            label=parameter.label,
            variability="tunable",
            unit=parameter.unit,
            display_unit=parameter.shown,
            minimum=setting_minimum(parameter.name),
            maximum=LARGEST_SETTING,
            start=getattr(default, parameter.name),
        )
        for parameter in SETTING_INPUTS
    ]


def _filter_parameter(inverse_map: InverseMap) -> list[Variable]:
    """Return the time constant of the filter, where there is one."""
    none = "0, or model exchange," if inverse_map.manifold is None else "0"
    parameter = Variable(
        name=FILTER_TIME_CONSTANT,
        description=f"Longest time over which the filter averages estimates of single samples; {none} for none",
        causality="parameter",
        kind="parameter",
        variability="tunable",
        unit="s",
        minimum=0.0,
        maximum=POLICIES.largest_time,
        start=0.0,
    )
    return [parameter] if has_filter(inverse_map) else []


def time_constant_fault(value: float) -> str:
    """Return what is wrong with a time constant [s], nothing if it may be set."""
    smallest, largest = POLICIES.smallest_time, POLICIES.largest_time
    if value == 0.0 or smallest <= value <= largest:
        return ""
    return f"{FILTER_TIME_CONSTANT}: {value:g} found, must be 0 or between {smallest:g} and {largest:g}"


def _estimated_coefficients(inverse_map: InverseMap, gauges: tuple[str, ...]) -> list[Variable]:
    """Return the five coefficients and their standard deviations."""
    nominals = [_nominal(max(abs(low), abs(high))) for low, high in inverse_map.coefficient_range]
    of_force = (OF_READINGS, OF_AREA)
    of_moment = (*of_force, OF_LENGTH, OF_STATION)
    values = [
        Variable(
            name=name,
            description=text,
            causality="output",
            unit="1",
            nominal=nominal,
            depends_on=(*gauges, *FLOW_INPUTS[:2]),
            initially_depends_on=of_moment if name.startswith("M_") else of_force,
            array=COEFFICIENT_ARRAY,
        )
        for (name, text), nominal in zip(COEFFICIENTS.items(), nominals, strict=True)
    ]
    return [*values, *map(deviation_of, values)]


def _estimated_loads(inverse_map: InverseMap, gauges: tuple[str, ...]) -> list[Variable]:
    """Return the five forces and moments and their standard deviations."""
    area, length = inverse_map.reference_area, inverse_map.reference_length
    scale = inverse_map.nominal_dynamic_pressure * area
    flow = _pressure_of_loads(inverse_map)
    values = [
        Variable(
            name=name,
            description=f"{load.label}, {load.sense}",
            causality="output",
            unit=load.unit,
            display_unit=f"k{load.unit}",
            nominal=_nominal(scale * (length if load.unit == "N.m" else 1.0) * max(abs(low), abs(high))),
            depends_on=(*gauges, *flow),
            initially_depends_on=(OF_READINGS, OF_STATION) if load.unit == "N.m" else (OF_READINGS,),
            array=name.partition(".")[0],
        )
        for (name, load), (low, high) in zip(LOADS.items(), inverse_map.coefficient_range, strict=True)
    ]
    return [*values, *map(deviation_of, values)]


def _health(inverse_map: InverseMap, gauges: tuple[str, ...]) -> list[Variable]:
    """Return the outputs that state the health of the estimate."""
    freedom, n = inverse_map.residual_degrees_of_freedom, inverse_map.n_gauges
    alarms = (OF_READINGS, OF_ALARMS)
    flow = _pressure_of_loads(inverse_map)
    state = Variable(
        name=STATE,
        description="State of the estimate",
        causality="output",
        kind="health",
        variability="discrete",
        fmi_type="Enumeration",
        declared_type=HEALTH_TYPE,
        depends_on=(*gauges, *FLOW_INPUTS),
        initially_depends_on=alarms,
    )
    chi_square = Variable(
        name=CHI_SQUARE,
        description=f"Chi-square of the residual, {freedom} expected with all gauges",
        causality="output",
        kind="health",
        unit="1",
        nominal=_nominal(freedom),
        minimum=0.0,
        depends_on=(*gauges, *flow),
        initially_depends_on=(OF_READINGS,),
    )
    limit = replace(
        chi_square,
        name=CHI_SQUARE_LIMIT,
        description="Alarm level of the chi-square: 1 false alarm in 10,000, times alarm_scale",
        initially_depends_on=alarms,
    )
    counts = [
        Variable(
            name=name,
            description=text,
            causality="output",
            kind="health",
            variability="discrete",
            fmi_type="Integer",
            minimum=0,
            maximum=n,
            depends_on=(*gauges, *pressures),
            initially_depends_on=parameters,
        )
        for name, text, pressures, parameters in (
            (VALID_GAUGES, "Number of gauges in use", (), (OF_READINGS,)),
            (
                SUSPECT_GAUGE,
                "Number, from 1, of the first gauge that does not fit; 0 for none",
                flow,
                alarms,
            ),
            (
                SUSPECTS,
                "Number of gauges under that suspicion, because they cannot be distinguished",
                flow,
                alarms,
            ),
        )
    ]
    score = replace(
        chi_square,
        name=ENVELOPE_SCORE,
        description="Deviations by which the coefficients leave what the map covers, 0 inside; OUTSIDE above "
        f"{inverse_map.envelope_score_limit:g}",
        nominal=None,
        depends_on=(*gauges, *FLOW_INPUTS[:2]),
    )
    return [state, chi_square, limit, *counts, score]


def _nominal(*candidates: float) -> float | None:
    """Return the first positive candidate: FMI tools scale by nominal, so zero is never one."""
    return next((float(value) for value in candidates if value > 0.0), None)
