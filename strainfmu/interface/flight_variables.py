"""What the interface of an FMU has besides where the map has tables over the flight state: navigation, air data.

The names are as in the columns of recorded data.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

from strainfmu.estimator.air_inputs import (
    AIR_DATA_NAMES,
    AIR_DATA_UNITS,
    AIR_INPUTS,
    DYNAMIC_PRESSURE,
    INERTIAL_INPUTS,
    NAVIGATION,
    Q_SOURCE,
    AirInput,
)
from strainfmu.estimator.estimate import Estimate
from strainfmu.estimator.policies import POLICIES
from strainfmu.interface.enumerations import Q_SOURCE_TYPE
from strainfmu.interface.fmi_variables import Variable, depending_on, deviation_of
from strainfmu.interface.health_names import CHI_SQUARE, ENVELOPE_SCORE, LINEAR_LOADS, STATE, USABLE, VALID_GAUGES
from strainfmu.interface.input_names import FLOW_INPUTS, NAVIGATION_INPUTS, NOT_GIVEN, PARAMETERS

if TYPE_CHECKING:
    from strainfmu.estimator.map.inverse_map import InverseMap
    from strainfmu.estimator.map.nonlinear_map import ManifoldMap

_AIR_DATA_TEXT = (
    "Angle of attack",
    "Sideslip angle",
    "Angle between the body axis and the wind",
    "Roll angle of the leeward meridian, from +z towards +y",
    "Mach number",
    "Static pressure",
    "Dynamic pressure",
)
"""Descriptions of :data:`~strainfmu.estimator.air_inputs.AIR_DATA_NAMES`."""


def flight_interface(
    linear: tuple[Variable, ...], manifold: ManifoldMap, gauges: tuple[str, ...]
) -> tuple[Variable, ...]:
    """Return the variables of an FMU of the tables ``manifold``; ``linear`` are the variables of every map.

    What the tables add comes last, so that all maps have the other value references in common. ``gauges`` are the
    names of strains and flags.
    """
    variables = (*linear, *_navigation_inputs(manifold), *_air_data(manifold))
    texts = {air_input.name: _text(air_input, manifold) for air_input in AIR_INPUTS} | _FLIGHT_TEXT
    described = (
        replace(variable, description=texts[variable.name]) if variable.name in texts else variable
        for variable in variables
    )
    return tuple(_of_flight_state(variable, manifold, gauges) for variable in described)


def flight_outputs(estimate: Estimate) -> list[float]:
    """Return the outputs that :func:`flight_interface` adds, in its order."""
    air = estimate.air_data
    flags = [*air.is_identified.tolist(), *estimate.air_data_used.tolist(), estimate.is_linear]
    return [*air.value.tolist(), *air.std.tolist(), *map(float, flags)]


def with_later_inputs(interface: tuple[Variable, ...], manifold: ManifoldMap | None) -> tuple[Variable, ...]:
    """Return ``interface`` with the inputs of later versions behind it, of a map with tables."""
    return interface if manifold is None else (*interface, *_navigation_inputs(manifold, are_later=True))


def with_last_variables(interface: tuple[Variable, ...], inverse_map: InverseMap) -> tuple[Variable, ...]:
    """Return ``interface`` with the last inputs of air data behind it, and whether the loads are usable."""
    manifold = inverse_map.manifold
    inputs = [
        _air_input(
            air_input,
            air_input.text_of_linear.format(of=inverse_map, not_given=NOT_GIVEN)
            if manifold is None
            else _text(air_input, manifold),
        )
        for air_input in AIR_INPUTS
        if air_input.is_last
    ]
    names = tuple(variable.name for variable in inputs)
    state = next(variable for variable in interface if variable.name == STATE)
    # With a linear map the source of q_inf moves its deviation alone.
    of_pressure = names if manifold is not None else (*FLOW_INPUTS[2:], Q_SOURCE)

    def depending(variable: Variable) -> Variable:
        if variable.causality != "output" or FLOW_INPUTS[1] not in variable.depends_on:
            return variable
        more = names if variable.name == STATE else of_pressure
        return replace(variable, depends_on=tuple(dict.fromkeys((*variable.depends_on, *more))))

    before = map(depending, interface)
    usable = replace(
        _flag(USABLE, "Whether loads may be used with their standard deviations: health is OK or DEGRADED"),
        depends_on=tuple(dict.fromkeys((*state.depends_on, *names))),
        initially_depends_on=state.initially_depends_on,
    )
    return (*before, *inputs, usable)


def with_inertial_inputs(interface: tuple[Variable, ...], inverse_map: InverseMap) -> tuple[Variable, ...]:
    """Return ``interface`` with what an inertial unit measures behind it, of a map with masses.

    All outputs depend on it but the number of gauges in use.
    """
    if not inverse_map.has_masses:
        return interface
    inputs = [_air_input(air_input, air_input.text) for air_input in INERTIAL_INPUTS]
    alone = tuple(variable.name for variable in interface if not variable.depends_on)
    names = tuple(variable.name for variable in inputs)
    return (*depending_on(interface, names, but=(VALID_GAUGES, *alone)), *inputs)


def _air_input(air_input: AirInput, text: str) -> Variable:
    is_source = air_input.name == Q_SOURCE
    return Variable(
        name=air_input.name,
        description=text,
        causality="input",
        kind="air data",
        label=air_input.label,
        symbol=air_input.symbol,
        variability="discrete" if is_source else "continuous",
        fmi_type="Enumeration" if is_source else "Real",
        declared_type=Q_SOURCE_TYPE if is_source else None,
        unit=None if is_source else air_input.unit,
        display_unit=air_input.shown,
        minimum=None if air_input.is_signed or is_source else 0.0,
        start=int(air_input.start) if is_source else air_input.start,
    )


def _navigation_inputs(manifold: ManifoldMap, are_later: bool = False) -> list[Variable]:
    """Return what the tables take of navigation besides :data:`FLOW_INPUTS`."""
    return [
        _air_input(air_input, _text(air_input, manifold))
        for air_input in AIR_INPUTS
        if air_input.of_tables and air_input.is_later == are_later
    ]


def _text(air_input: AirInput, manifold: ManifoldMap) -> str:
    """Return the description of an input of a map with tables."""
    return air_input.text.format(of=manifold, not_given=NOT_GIVEN)


def _air_data(manifold: ManifoldMap) -> list[Variable]:
    """Return the air data, their standard deviations, whether each is identified, and whether loads are linear."""
    nominal = {"Pa": float(manifold.pressure_range[1])}
    shown = {"rad": "deg", "Pa": "kPa"}
    values = [
        Variable(
            name=f"air_data.{name}",
            description=f"{text}, from strain and navigation",
            causality="output",
            kind="air data",
            unit=unit,
            display_unit=shown.get(unit),
            nominal=nominal.get(unit),
        )
        for name, text, unit in zip(AIR_DATA_NAMES, _AIR_DATA_TEXT, AIR_DATA_UNITS, strict=True)
    ]
    flags = {
        **{
            f"identified.{value.name}": f"Whether strain and navigation bring the sigma of {value.name} below "
            f"{POLICIES.min_gain:g} of what the ranges of the map give"
            for value in values
        },
        **{
            f"navigation_used.{name}": f"Whether {name} by navigation is known and agrees with strain and the rest"
            for name in NAVIGATION
        },
        LINEAR_LOADS: "Whether loads and coefficients are the linear map's: strain does not "
        "fit the tables, or did not a few steps ago",
    }
    return [*values, *map(deviation_of, values), *(_flag(name, text) for name, text in flags.items())]


def _flag(name: str, text: str) -> Variable:
    return Variable(
        name=name, description=text, causality="output", kind="health", variability="discrete", fmi_type="Boolean"
    )


_FLIGHT_TEXT: dict[str, str] = {
    CHI_SQUARE: "Chi-square of strain and navigation about the tables",
    ENVELOPE_SCORE: "Deviations by which the flight state leaves the ranges of the map, 0 inside",
}
"""Descriptions that differ for a map with tables over the flight state."""


def _of_flight_state(variable: Variable, manifold: ManifoldMap, gauges: tuple[str, ...]) -> Variable:
    """Return a variable as a map with tables has it: every output depends on all gauges and navigation."""
    if variable.name == ENVELOPE_SCORE:
        variable = replace(
            variable, description=f"{variable.description}; OUTSIDE above {manifold.outside_score:g}"
        )
    if variable.name == DYNAMIC_PRESSURE:
        return replace(variable, start=0.0)
    if variable.causality != "output" or variable.name == VALID_GAUGES:
        return variable
    of_flow = variable.name.startswith(("health", "air_data", "sigma.air_data", "identified", "navigation_used"))
    return replace(
        variable,
        depends_on=(*gauges, *FLOW_INPUTS, *NAVIGATION_INPUTS),
        initially_depends_on=PARAMETERS[:2] if of_flow else PARAMETERS,
    )
