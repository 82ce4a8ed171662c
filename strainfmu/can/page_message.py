"""What the live page gets of a result and of the pressure field, as JSON."""

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field
from math import isfinite
from pathlib import Path
from typing import Any

import numpy as np

from strainfmu.arrays import FloatArray, IntArray
from strainfmu.can.machine import Result
from strainfmu.can.quality import REASONS, Cause
from strainfmu.cosim.estimators.step import health_name
from strainfmu.errors import InputError
from strainfmu.estimator.estimator import Estimator
from strainfmu.estimator.gauge_zeros import GaugeZeros
from strainfmu.estimator.health import HealthState
from strainfmu.estimator.map.inverse_map import COEFFICIENT_NAMES, InverseMap, load_inverse_map
from strainfmu.estimator.map.nonlinear_map import FlightField
from strainfmu.estimator.map.validity import PARAMETER_TOLERANCE
from strainfmu.estimator.other_loads import LoadGroup, column_of
from strainfmu.estimator.outer_surface import SurfacePlaces, outermost_places
from strainfmu.estimator.signal_names import COEFFICIENT_ARRAY, TEMPERATURE
from strainfmu.interface.estimator_variables import LOADS
from strainfmu.interface.health_names import CHI_SQUARE_LIMIT, SUSPECT_GAUGE, SUSPECTS
from strainfmu.interface.health_names import VALID_GAUGES as GAUGES_USED
from strainfmu.interface.input_names import FLOW_KEYS, given_flow, given_thrust, other_air_data
from strainfmu.interface.parameter_variables import OUTSIDE_PREFIX, PREFIX, STD_PREFIX
from strainfmu.interface.sensor_variables import PREFIX as SENSOR_PREFIX
from strainfmu.interface.sensor_variables import THRUST, has_thrust, sensor_names, temperature_names

PAGE_OUTPUTS = (
    *LOADS,
    *(f"sigma.{name}" for name in LOADS),
    CHI_SQUARE_LIMIT,
    GAUGES_USED,
    SUSPECT_GAUGE,
    SUSPECTS,
)
"""Outputs of the estimator that a display shows besides those that every result holds."""


@dataclass(frozen=True)
class GaugePosition:
    """Position of a gauge: ``x`` [m] aft of the nose tip, ``roll_angle`` [deg]; None where it is not known."""

    name: str
    x: float | None = None
    roll_angle: float | None = None


@dataclass(frozen=True, kw_only=True)
class EstimatorFacts:
    """What a display shows of an estimator that does not change.

    Attributes
    ----------
    vehicle : its name, "" if it is not known.
    score_limit : envelope score above which it says OUTSIDE [1], None if it states none.
    ranges : smallest and largest coefficient that the snapshots of its map cover [1], by name.
    validity : flight conditions that they cover, as texts with their units, by quantity.
    load_groups : groups of the loads that it gives in addition to the five.
    sensors : names of its auxiliary sensors.
    """

    vehicle: str = ""
    score_limit: float | None = None
    ranges: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    validity: Mapping[str, str] = field(default_factory=dict)
    load_groups: tuple[LoadGroup, ...] = ()
    sensors: tuple[str, ...] = ()


def gauge_positions(fmu: Path) -> tuple[GaugePosition, ...]:
    """Return the positions of the gauges of an estimator FMU, as it states them."""
    from strainfmu.cosim.estimators.description import gauge_names_of
    from strainfmu.interface.contents import stated_contents

    names, stated = gauge_names_of(fmu), stated_contents(fmu).positions
    if len(stated) != len(names):
        return tuple(GaugePosition(name) for name in names)
    return tuple(
        GaugePosition(name, position.x, position.roll_angle) for name, position in zip(names, stated, strict=True)
    )


def estimator_facts(fmu: Path) -> EstimatorFacts:
    """Return what the estimator at ``fmu`` states of itself; another program's FMU may state nothing."""
    from strainfmu.cosim.estimators.description import load_groups_in, reading_units_in
    from strainfmu.interface.contents import stated_contents

    contents = stated_contents(fmu)
    ranges = {name: contents.ranges[name] for name in COEFFICIENT_NAMES if name in contents.ranges}
    return EstimatorFacts(
        vehicle=contents.vehicle,
        score_limit=contents.envelope_score_limit,
        ranges=ranges,
        validity={name: text for name, text in contents.validity.items() if name not in ranges},
        load_groups=load_groups_in(fmu),
        sensors=tuple(name.removeprefix(SENSOR_PREFIX) for name in reading_units_in(fmu) if name != THRUST),
    )


def health_text(result: Result, score_limit: float | None) -> str | None:
    """Return what is outside in a result of health OUTSIDE, None of others.

    The state alone does not show the reason. A score above its limit shows that the coefficients are outside;
    below it, the flow is outside.
    """
    if result.health != HealthState.OUTSIDE:
        return None
    outside = [
        name.removeprefix(OUTSIDE_PREFIX)
        for name, score in result.other_outputs.items()
        if name.startswith(OUTSIDE_PREFIX) and score > PARAMETER_TOLERANCE
    ]
    if outside:
        return f"{', '.join(outside)} outside the map's range"
    if score_limit is None or not isfinite(result.envelope_score):
        return "outside what the map covers"
    if result.envelope_score > score_limit:
        return "the coefficients are outside what the map covers"
    if isfinite(result.mach_number) or isfinite(result.altitude):
        return "dynamic pressure, Mach number or altitude is outside the map's range, or they do not agree"
    return "the dynamic pressure is outside the map's range"


def layout_message(gauges: Sequence[GaugePosition], facts: EstimatorFacts) -> dict[str, Any]:
    """Return the message with what does not change during a run."""
    return {
        "layout": {
            "gauges": [asdict(gauge) for gauge in gauges],
            "vehicle": facts.vehicle,
            "coefficient_range": {name: list(bounds) for name, bounds in facts.ranges.items()},
            "validity": dict(facts.validity),
            "load_tables": load_tables(facts.load_groups),
        }
    }


def load_tables(groups: Sequence[LoadGroup]) -> list[dict[str, Any]]:
    """Return what a page shows of the loads behind the five: a table of each family, a row of each place.

    A cell is an output by name; its number times the ``factor`` of the column is shown in the ``unit``, "" for
    none, with ``digits`` decimals.
    """
    tables = []
    for family in dict.fromkeys(group.family for group in groups):
        of_family = [group for group in groups if group.family is family]
        columns, cells = list[dict[str, Any]](), list[tuple[str, ...]]()
        for group in of_family:
            load = group.load
            if load.coefficient:
                columns.append({"text": load.symbol, "unit": "", "factor": 1.0, "digits": 4})
                cells.append(group.numbered(load.coefficient))
            text, unit = load.key if family.is_listed else "", load.shown.replace(".", " ")
            factor = 1.0 if load.shown == load.unit else 1e-3
            columns.append({"text": text, "unit": unit, "factor": factor, "digits": 3})
            cells.append(group.numbered(load.output))
        rows = zip(of_family[0].places, zip(*cells, strict=True), strict=True)
        tables.append(
            {
                "title": family.title,
                "place": family.place_title,
                "columns": columns,
                "rows": [{"place": place, "outputs": list(outputs)} for place, outputs in rows],
            }
        )
    return tables


def result_message(
    result: Result,
    gauges: Sequence[GaugePosition],
    score_limit: float | None,
    since: Cause,
    sensors: Sequence[str] = (),
) -> dict[str, Any]:
    """Return the message of one result.

    Parameters
    ----------
    gauges : n_d positions, order of the strains.
    score_limit : envelope score above which the estimator says OUTSIDE, None if it is not known.
    since : causes of the results since the message before, of this one too.
    sensors : names of auxiliary sensors, which an estimator counts behind the gauges.
    """
    outputs = result.other_outputs
    names = [gauge.name for gauge in gauges]
    rows = [*names, *sensors]
    micro = np.round(1e6 * result.strain, 3).tolist()
    if not isfinite(sum(micro)):
        micro = [finite(value) for value in micro]
    not_used: dict[str, str] = {}
    if not result.valid.all():
        reasons = zip(names, result.reasons.tolist(), strict=True)
        not_used = {name: REASONS[reason] for name, reason in reasons if REASONS[reason]}
    has_numbers = result.quality.has_coefficients
    loads = {name: finite(outputs.get(name)) if has_numbers else None for name in LOADS}
    loads_sigma = {name: finite(outputs.get(f"sigma.{name}")) if has_numbers else None for name in LOADS}
    other_loads = {
        name: finite(value) if has_numbers else None for name, value in outputs.items() if column_of(name)
    }
    first, number = int(outputs.get(SUSPECT_GAUGE, 0)), int(outputs.get(SUSPECTS, 0))
    return {
        "quality": int(result.quality),
        "quality_name": result.quality.name,
        "causes": [cause.name for cause in result.causes],
        "causes_since": [cause.name for cause in since],
        COEFFICIENT_ARRAY: _named(result.coefficients.tolist()),
        "sigma": _named(result.coefficients_std.tolist()),
        "loads": loads,
        "loads_sigma": loads_sigma,
        "other_loads": other_loads,
        "strain_um_per_m": dict(zip(names, micro, strict=True)),
        "not_used": not_used,
        # An estimator counts its sensors, too.
        "gauges_used": int(result.valid.sum() if sensors else outputs.get(GAUGES_USED, result.valid.sum())),
        "suspect_gauge": rows[first - 1] if 0 < first <= len(rows) else None,
        "suspects": number,
        **{key: finite(getattr(result, name)) for name, key in FLOW_KEYS.items()},
        "age_ms": finite(1e3 * result.age),
        "age_uncertainty_ms": finite(1e3 * result.age_uncertainty),
        "health": result.health,
        "usable": int(result.usable),
        "health_name": None if result.health is None else health_name(result.health),
        "health_text": health_text(result, score_limit),
        "chi_square": finite(result.chi_square),
        "chi_square_limit": finite(outputs.get(CHI_SQUARE_LIMIT)),
        "envelope_score": finite(result.envelope_score),
        "envelope_score_limit": score_limit,
    }


def finite(value: float | None) -> float | None:
    """Return the number, None where JSON has none for it."""
    return value if value is not None and isfinite(value) else None


def _named(values: Sequence[float]) -> dict[str, float | None]:
    return {name: finite(value) for name, value in zip(COEFFICIENT_NAMES, values, strict=True)}


FIELD_PERIOD = 0.1
"""Shortest time from one field to the next [s]."""

_STATIONS, _ROLLS = 60, 36
"""Largest number of stations and roll angles of a message: it fits one datagram."""


class FieldMessages:
    """The pressure of results by a map with tables that holds the field."""

    def __init__(self, inverse_map: InverseMap) -> None:
        """Prepare ``inverse_map``; raises InputError without tables."""
        estimator = Estimator(inverse_map)
        surface_field = None if inverse_map.manifold is None else inverse_map.manifold.surface_field
        if surface_field is None:
            raise ValueError("inverse_map: expected one that holds the pressure field")
        self._estimator, self._zeros = estimator, estimator.zeros
        self._air_data = other_air_data(is_nonlinear=True, has_masses=inverse_map.has_masses)
        self._temperatures = temperature_names(inverse_map.thermal)
        self._parameters = estimator.parameters.names
        self._sensors, self._has_thrust = sensor_names(inverse_map), has_thrust(inverse_map)
        if isinstance(surface_field, FlightField):
            row, column = _thinned(surface_field.station, _STATIONS), _thinned(surface_field.roll_angle, _ROLLS)
            node = np.arange(surface_field.n_nodes).reshape(len(surface_field.station), -1)[np.ix_(row, column)]
            station, roll_angle = surface_field.station[row], surface_field.roll_angle[column]
            self._seen = SurfacePlaces(node[..., None], np.ones((*node.shape, 1)))
        else:
            station, roll_angle, self._seen = _unrolled(inverse_map)
        self._places = {
            "x": np.round(station, 4).tolist(),
            "roll_angle": np.round(np.degrees(roll_angle), 3).tolist(),
        }

    def set_zeros(self, zeros: GaugeZeros) -> None:
        """Take ``zeros`` off the strains from the next message on; any thread may say so."""
        self._zeros = zeros

    def message(self, result: Result, timestamp: float) -> dict[str, Any]:
        """Return the message of ``result``; without values where there is no estimate."""
        values = self._pressure(result) if result.quality.has_coefficients else []
        return {"field": {"timestamp": timestamp, **self._places, "pressure_Pa": values}}

    def _pressure(self, result: Result) -> list[int]:
        zeros, inputs = self._zeros, result.other_inputs
        readings = [inputs.get(name, np.nan) for name in self._sensors]
        if zeros is not self._estimator.zeros:
            self._estimator = self._estimator.with_zeros(zeros)
        try:
            estimate = self._estimator.track(
                np.append(result.strain, readings),
                result.dynamic_pressure,
                valid=np.append(result.valid, np.isfinite(readings)),
                mach_number=result.mach_number,
                altitude=result.altitude,
                **self._other_inputs(inputs),
            )
            chosen = self._seen.of(estimate.pressure(with_std=False).pressure)
        except np.linalg.LinAlgError:  # the results themselves must go on
            return []
        return np.rint(chosen).astype(int).ravel().tolist() if np.all(np.isfinite(chosen)) else []

    def _other_inputs(self, inputs: Mapping[str, float]) -> dict[str, Any]:
        """Return the arguments of a step of ``inputs`` other than q_inf, Mach number and altitude."""
        known: dict[str, Any] = given_flow({name: inputs.get(name, np.nan) for name in self._air_data})
        if self._temperatures:
            known[TEMPERATURE] = np.array([inputs.get(name, np.nan) for name in self._temperatures])
        known["parameters"] = {name: inputs.get(PREFIX + name, np.nan) for name in self._parameters}
        stds = {name: inputs.get(STD_PREFIX + name, np.nan) for name in self._parameters}
        known["parameters_std"] = given_flow(stds)
        return known | (given_thrust(inputs) if self._has_thrust else {})


def field_messages(path: Path, gauge_names: tuple[str, ...]) -> FieldMessages:
    """Return the messages of the map at ``path``.

    Raises
    ------
    InputError
        The file is missing or damaged, its gauges are not ``gauge_names``, or it holds no tables with the field.
    """
    inverse_map = load_inverse_map(path)
    if inverse_map.gauge_names[: inverse_map.n_strain_gauges] != gauge_names:
        raise InputError(f"page.field {path}: expected a map of the estimator's gauges, got others")
    if inverse_map.manifold is None or inverse_map.manifold.surface_field is None:
        raise InputError(
            f"page.field {path}: expected a map built with estimator = 'nonlinear' and keep_field = true"
        )
    return FieldMessages(inverse_map)


def _thinned(values: FloatArray, most: int) -> IntArray:
    """Return at most ``most`` of the numbers of ``values``, evenly."""
    return np.arange(0, len(values), -(-len(values) // most))


def _unrolled(inverse_map: InverseMap) -> tuple[FloatArray, FloatArray, SurfacePlaces]:
    """Return stations [m], roll angles [rad] and the places of any surface that are seen from outside there."""
    if not inverse_map.has_field:
        raise ValueError("inverse_map: expected one that holds the surface of its pressure field")
    point, triangle = inverse_map.point, inverse_map.triangle
    surface = point.astype(np.float64), triangle.astype(np.int64)
    first, last = float(point[:, 0].min()), float(point[:, 0].max())
    station = first + (last - first) * (np.arange(_STATIONS) + 0.5) / _STATIONS
    roll_angle = 2.0 * np.pi * np.arange(_ROLLS) / _ROLLS
    return station, roll_angle, outermost_places(*surface, station, roll_angle)
