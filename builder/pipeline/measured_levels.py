"""Alarm levels of a map, and its estimator by "auto", on flights of the independent model where there is one."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from builder.campaign.snapshots import Snapshots
from builder.pipeline.estimator_choice import as_chosen, compared_in_flights
from builder.reporting import Reporter
from builder.structure.fourier.fourier_model import refuse_beyond_fourier
from builder.structure.structure_file import Structure
from builder.trial.conditions import conditions_in_ranges, drawn_altitudes_km
from builder.trial.levels import (
    HARDWARE,
    SEED,
    level_readings,
    with_alarm_levels,
    with_flight_alarm_levels,
)
from builder.trial.readings import Readings, World, joined, read_own_vehicles
from builder.truth.flow_table import truth_knots
from builder.truth.shape import (
    flying_structure,
    refuse_without_independent_model,
    shape_flights,
    structure_of_check,
)
from builder.vehicle.file import Vehicle
from strainfmu.errors import InputError
from strainfmu.estimator.map.inverse_map import InverseMap
from strainfmu.flight_condition import FlightCondition

SHAPE_CONDITIONS, SHAPE_VEHICLES = 200, 200
"""Flights of a shape that is none of revolution, each with a flow of its own, and vehicles that fly at each."""


def _no_overlap(first: Sequence[float], second: Sequence[float]) -> bool:
    """Return whether the ranges of two lists have no value in common."""
    return max(first) < min(second) or max(second) < min(first)


def alarm_levels_wanted(vehicle: Vehicle, reporter: Reporter) -> bool:
    """Return whether the map's alarm levels are set on the independent model, and say why not.

    That of a body of revolution is the Euler flow on a finer grid and the semi-analytic structure: of a map from
    another engine, or of a structure that is not like it, the difference would count as noise. Any other shape has
    a flow of its own for every flight: by ``euler`` they cost more than the build, and are solved on request.
    """
    if vehicle.map.alarm_levels == "nominal":
        return False
    if not vehicle.is_axisymmetric:
        return _wanted_of_shape(vehicle, reporter)
    why = ""
    if vehicle.sensors is not None:
        why = "its readings are of strain gauges alone"
    elif vehicle.structure.external is not None:
        why = "the structure is another code's"
    elif vehicle.aerodynamics.engine != "euler":
        why = f"the snapshots' engine is '{vehicle.aerodynamics.engine}'"
    elif _no_overlap(truth_knots(vehicle.truth)[0].tolist(), vehicle.conditions.mach_number):
        why = "truth.mach_number and the snapshots' Mach numbers have none in common"
    else:
        try:
            refuse_beyond_fourier(vehicle, [vehicle.gauges.layout])
        except InputError as error:
            why = str(error).partition(",")[0]
    if why:
        reporter.note(f"alarm levels: from the theory, the independent model is of another kind ({why})")
    return not why


def _wanted_of_shape(vehicle: Vehicle, reporter: Reporter) -> bool:
    why = ""
    try:
        refuse_without_independent_model(vehicle)
    except InputError as error:
        why = f"there is no independent model ({str(error).partition(',')[0]})"
    if not why and vehicle.aerodynamics.engine == "euler" and vehicle.map.alarm_levels != "always":
        why = f"its {SHAPE_CONDITIONS} flows by euler cost more than the build (map.alarm_levels = 'always')"
    if why:
        reporter.note(f"alarm levels: from the theory, {why}")
    return not why


def level_conditions(vehicle: Vehicle) -> list[FlightCondition]:
    """Return the conditions that alarm levels of a shape that is none of revolution are set on."""
    return conditions_in_ranges(
        vehicle.conditions, drawn_altitudes_km(vehicle), SHAPE_CONDITIONS, np.random.default_rng(SEED)
    )


def with_shape_levels(
    vehicle: Vehicle, inverse_map: InverseMap, known: Structure | None, flows: Snapshots, reporter: Reporter
) -> InverseMap:
    """Return ``inverse_map`` with alarm levels set on flights of a shape that is none of revolution.

    Parameters
    ----------
    known : structure of the map, whose check is the mesh that flies; a finer one where it has none.
    flows : at :func:`level_conditions`.
    """
    check = None if known is None else known.check
    if known is None or check is None:
        structure = flying_structure(vehicle, known, reporter)
    else:
        structure = structure_of_check(known, check, vehicle.gauges.layout, vehicle.noise)

    world = World(vehicle=vehicle, structure=structure, flows=flows, inverse_map=inverse_map)

    def read() -> Iterator[Readings]:
        flights = shape_flights(vehicle, structure, flows)
        return read_own_vehicles(world, HARDWARE, flights, SHAPE_VEHICLES, np.random.default_rng(SEED))

    return _with_levels(world, read, reporter)


def with_measured_levels(world: World, reporter: Reporter, **effort: Any) -> InverseMap:
    """Return the map of ``world`` with alarm levels set on flights of its independent model; ``effort`` is of
    :func:`~builder.trial.levels.level_readings`."""
    return _with_levels(world, lambda: level_readings(world, **effort), reporter)


def _with_levels(world: World, read: Callable[[], Iterator[Readings]], reporter: Reporter) -> InverseMap:
    vehicle, inverse_map = world.vehicle, world.inverse_map
    with reporter.stage("Alarm levels: flights of the independent model"):
        # A linear map is done with each block; tables need all samples at once.
        flights = None if inverse_map.manifold is None else joined(list(read()))
        if vehicle.map.estimator == "auto" and flights is not None:
            choice = compared_in_flights(inverse_map, flights)
            inverse_map = as_chosen(inverse_map, choice)
            reporter.note(choice.line)
        levelled = with_alarm_levels(inverse_map, read() if flights is None else [flights])
    if levelled.manifold is not None and flights is not None:
        with reporter.stage("Alarm levels of the nonlinear estimator"):
            levelled = with_flight_alarm_levels(levelled, flights)
        reporter.note(_flight_levels_line(levelled.provenance["flight_alarm_levels"]))
    facts = levelled.provenance["alarm_levels"]
    if not facts["used"]:
        reporter.note(
            "warning: alarm levels: from the theory; map and independent model differ, "
            f"{facts['rate_before']:.2g} of its flights raise an alarm"
        )
        return levelled
    reporter.note(
        f"alarm levels: chi-square times {levelled.chi_square_scale:.3g}, largest |z| "
        f"times {levelled.outlier_scale**0.5:.3g}, for {facts['stated_rate']:g} false alarms "
        f"({facts['samples']} samples)"
    )
    return levelled


def _flight_levels_line(facts: Mapping[str, Any]) -> str:
    if not facts["used"]:
        return (
            "warning: alarm levels of the nonlinear estimator: from the theory; map and independent model "
            f"differ, {facts['rate_before']:.2g} of its flights raise an alarm"
        )
    factors = dict(zip(("chi-square", "largest |z|", "chi-square of the shapes"), facts["scales"], strict=False))
    factors["largest |z|"] **= 0.5  # its factor is the factor of the square
    text = ", ".join(f"{name} times {value:.3g}" for name, value in factors.items())
    return f"nonlinear estimator: {text} ({facts['samples']} samples)"
