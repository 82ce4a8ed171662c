"""Tables over the flight state with the errors of their making, of a body of revolution and of any shape.

Error of the flow's grid: some flows solved again on a coarser one.

The grids of a campaign are seldom fine enough for an observed order of convergence: by the shock leeward of the
body it is between -1.6 and 2.4 on the shipped vehicle. So the difference between two grids counts as one
standard deviation, without extrapolation (Eca and Hoekstra, J. Comput. Phys. 262 (2014) 104, section 3, for such
data). On the shipped vehicle a grid 1.5 times finer than the map's differs from it by 0.4 to 1.4 times as much.

Pressure on the surface of any shape over the flight state, and how far it may be off.

Snapshots of one side of a symmetric body, with their mirror images.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from scipy.linalg import block_diag

from builder.aero.engine import FlowKey
from builder.aero.engines.euler import EulerEngine
from builder.aero.euler.planes import MarchingGrid
from builder.aero.mapping.pressure_map import mirror_operator
from builder.aero.surface.mesh import SurfaceMesh, grid_of, mesh_of
from builder.campaign.snapshots import Snapshots
from builder.inverse.noise.error_list import GRID_REFINEMENT, INTERPOLATION, PROCESS, SPREAD, parts_of
from builder.inverse.noise.flow_models import LEEWARD_PRESSURE, LEVEL, newtonian_snapshots
from builder.inverse.noise.flows_between import FlowsBetween, flows_between
from builder.inverse.problem import AnyStructure
from builder.inverse.solution import Problem
from builder.manifold.condition_tables import MAX_FIELD_HARMONIC, condition_tables, flight_field, with_harmonics
from builder.manifold.discrepancy import (
    gaussian_process_shapes,
    process_on_surface,
    process_size,
    response_of_shapes,
)
from builder.manifold.flow_amplitudes import FlowAmplitudes, cosine_amplitudes, flow_amplitudes
from builder.manifold.parameter_slopes import ParameterSlopes
from builder.manifold.tables import (
    interpolation_errors,
    of_amplitudes,
    response_values,
    ring_response,
    rolled_errors,
    spline_coefficients,
    spline_rows,
)
from builder.vehicle.conditions.flight_conditions import flow_key
from builder.vehicle.file import Vehicle
from builder.vehicle.map.model_form import model_form
from builder.vehicle.shape.geometry import SurfaceGrid
from strainfmu.arrays import FloatArray
from strainfmu.errors import FlowReachError, InputError
from strainfmu.estimator.map.nonlinear_map import FieldParameters, FlightField, ShapeField

SIDESLIP = 2
"""Column of the sideslip angle in the conditions of snapshots."""


def with_mirror_images(snapshots: Snapshots, mesh: SurfaceMesh) -> Snapshots:
    """Return ``snapshots``; snapshots of one sideslip sign alone with their mirror images in the plane y = 0.

    They stay as they are where the surface is not symmetric, and with flow parameters: a deflection may have a
    mirror image of its own.
    """
    sideslip = snapshots.condition[:, SIDESLIP]
    one_sided = float(sideslip.min()) * float(sideslip.max()) >= 0.0 and bool(np.any(sideslip != 0.0))
    if not one_sided or snapshots.parameter_names:
        return snapshots
    mirror = mirror_operator(mesh, axis=1)
    if mirror is None:
        return snapshots
    rows = np.flatnonzero(sideslip != 0.0)
    condition = snapshots.condition[rows].copy()
    condition[:, SIDESLIP] *= -1.0
    pressure: FloatArray = np.asarray((mirror @ snapshots.pressure[rows].T).T)
    changed = {"condition": condition, "pressure": pressure, "solved": np.zeros(len(rows), dtype=bool)}
    names = ("condition", "pressure", "internal_pressure", "solved", "flow", "momentum_error", "repairs")
    both: dict[str, Any] = {
        name: np.concatenate([getattr(snapshots, name), changed.get(name, getattr(snapshots, name)[rows])])
        for name in (*names, *(() if snapshots.mass_error is None else ("mass_error",)))
    }
    return replace(snapshots, **both)


_NEGLIGIBLE = 1e-3
"""Singular value, relative to the largest, below which a mode of the snapshots is left out."""


def shape_field(
    vehicle: Vehicle,
    snapshots: Snapshots,
    problem: Problem,
    process: FloatArray,
    overpressure: FloatArray,
    between: FlowsBetween | None,
) -> ShapeField:
    """Return the field at the nodes of ``snapshots``.

    Parameters
    ----------
    process : (n_p, k) fields of the Gaussian process at unit variance.
    overpressure : (n_p,) p / p_inf - 1 at the smallest incidence.
    between : flows between the snapshots; None where they are not known.
    """
    ambient = np.array([condition.ambient_pressure for condition in snapshots.conditions()])
    ratio = snapshots.pressure / ambient[:, None] - 1.0
    _, size, transposed = np.linalg.svd(ratio, full_matrices=False)
    modes = transposed[size > _NEGLIGIBLE * size[0]].T
    tables = condition_tables(snapshots, modes.T, True, between)
    rest = ratio - (ratio @ modes) @ modes.T
    variance = np.mean(rest**2, axis=0)
    if problem.off_the_snapshots is not None:
        variance += np.sum((problem.off_the_snapshots / problem.ensemble.mean_ambient_pressure) ** 2, axis=0)
    covariance = np.zeros((len(modes), len(problem.strain_operator)))
    expected = model_form(vehicle.map, vehicle.noise)
    fields = [(name, modes @ columns) for name, columns in tables.errors.items()]
    fields += [(PROCESS, process_size(vehicle, problem) * process)]
    fields += [(SPREAD, expected.of_prior * columns) for columns in _spread(problem)]
    if problem.leeward is not None:
        fields += [(LEEWARD_PRESSURE, problem.leeward.T / problem.ensemble.mean_ambient_pressure)]
    fields += [(LEVEL, expected.of_overpressure * overpressure[:, None])]
    for name, columns in fields:
        part = parts_of(name, problem.sensors is not None)[0]
        if part > 0.0:
            covariance += part**2 * (columns @ (problem.strain_operator @ columns).T)
        variance += np.sum(columns**2, axis=1)
    return ShapeField(
        modes=modes.astype(np.float32),
        amplitude=tables.coefficients,
        strain_covariance=covariance.astype(np.float32),
        error_std=np.sqrt(variance),
        parameters=_parameters(tables.slopes, problem.strain_operator @ modes),
    )


def _parameters(slopes: ParameterSlopes | None, strain: FloatArray) -> FieldParameters | None:
    """Return the ``slopes`` of modes whose strain per p_inf is ``strain`` (n_d, n_q)."""
    if slopes is None:
        return None
    unit, spread = slopes.compressed_errors()
    return FieldParameters(
        slope=slopes.slope.astype(np.float32), unit_error=unit, spread_error=spread, strain=strain
    )


def _spread(problem: Problem) -> Iterator[FloatArray]:
    """Yield fields (n_p, N) of the flows' difference from their mean, per p_inf."""
    ensemble, pressure = problem.ensemble, problem.ensemble.mean_ambient_pressure
    first, share = 0, np.sqrt(ensemble.member_weight) / pressure
    for block in ensemble.members():
        yield (share[first : first + len(block), None] * (block - ensemble.mean())).T
        first += len(block)


COARSER = 2.0 / 3.0
"""Cells of the coarser grid over the campaign's, in either direction."""

FEWEST_CELLS = 8


def grid_errors(vehicle: Vehicle, snapshots: Snapshots) -> FloatArray | None:
    """Return (q, n_x, n_m) amplitudes of cos m(phi - phi_T) of the error of p / p_inf in q flows.

    The flows are at the ends of the Mach numbers, at the smallest, the middle and the largest total incidence.
    None where the grid of the snapshots is not known: other engines, and bodies that are not of revolution.
    """
    grid, marching = snapshots.grid, _coarser(snapshots.settings)
    if grid is None or marching is None or not vehicle.is_axisymmetric or snapshots.engine != "euler":
        return None
    n_m = min(MAX_FIELD_HARMONIC, (grid.n_roll - 1) // 2) + 1
    engine = EulerEngine(vehicle.body(), marching, grid)
    conditions, amplitudes = snapshots.conditions(), list[FloatArray]()
    keys: list[FlowKey] = [flow_key(condition) for condition in conditions]
    for key in _chosen(keys):
        row = keys.index(key)
        condition = conditions[row]
        try:
            coarse = engine.pressure_ratio(engine.solve(key), condition)
        except FlowReachError:
            continue
        difference = snapshots.pressure[row] / condition.ambient_pressure - coarse
        angle = grid.roll_angle - condition.leeward_roll_angle
        amplitudes.append(cosine_amplitudes(difference.reshape(len(grid.x), -1), angle, n_m))
    return np.array(amplitudes) if amplitudes else None


def _chosen(keys: list[FlowKey]) -> list[FlowKey]:
    """Return the keys at the ends of the Mach numbers, at three incidences each."""
    chosen_keys = list[FlowKey]()
    mach_numbers = [key[0] for key in keys]
    for mach in dict.fromkeys((min(mach_numbers), max(mach_numbers))):
        incidence = sorted({key[1] for key in keys if key[0] == mach})
        chosen = dict.fromkeys((incidence[0], incidence[len(incidence) // 2], incidence[-1]))
        chosen_keys += [(mach, incidence) for incidence in chosen]
    return chosen_keys


def _coarser(settings: Mapping[str, Any]) -> MarchingGrid | None:
    """Return the grid of the snapshots with fewer cells; None where it is not known or cannot be coarser."""
    entries = settings.get("inputs", {}).get("marching_grid")
    if entries is None:
        return None
    finest = MarchingGrid(**entries)
    cells = [round(COARSER * count) for count in (finest.n_radial, finest.n_circumferential)]
    if min(cells) < FEWEST_CELLS:
        return None
    return replace(finest, n_radial=cells[0], n_circumferential=cells[1])


MIN_FLOWS = (2, 4)
"""Least number of Mach numbers, and of incidences but zero, of a spline of a body of revolution."""


@dataclass(frozen=True, eq=False, kw_only=True)
class StateTables:
    """Tables of n rows: strains, loads, other loads.

    Attributes
    ----------
    mach_knots, incidence_knots, coefficients : see
        :class:`~strainfmu.estimator.map.flight_tables.FlightTables`, no part of them fixed.
    errors : by name, columns (n, k) per p_inf whose squares add up to the mean one.
    process : (n, k) response per p_inf to the fields of a Gaussian process of unit variance.
    overpressure : (n_p,) p / p_inf - 1 at the smallest incidence, the mean over the Mach numbers.
    incidence_limit : largest total incidence of the flows [rad].
    crossflow_range : (2, 2) smallest and largest u and w of the flows [rad]; None where they are all round.
    considered : as ``coefficients``, of the difference of flow models at one standard deviation; None for none.
    field : pressure on the surface, of either kind; None where the map does not hold it.
    slopes : by flow parameters; None for none.
    """

    mach_knots: FloatArray
    incidence_knots: FloatArray
    coefficients: FloatArray
    errors: dict[str, FloatArray]
    process: FloatArray
    overpressure: FloatArray
    incidence_limit: float
    crossflow_range: FloatArray | None
    considered: FloatArray | None
    field: FlightField | ShapeField | None
    slopes: ParameterSlopes | None = None


def state_tables(
    vehicle: Vehicle, snapshots: Snapshots, structure: AnyStructure, problem: Problem, operator: FloatArray
) -> StateTables:
    """Return the tables of ``operator`` (n, n_p) times pressure, internal pressure that scales taken off.

    Raises
    ------
    InputError
        The flows do not suffice for tables.
    """
    surface = structure.surface
    grid = grid_of(surface)
    if grid is not None and problem.ensemble.grid is not None:
        return _of_revolution(vehicle, snapshots, problem, operator, grid)
    mesh = mesh_of(surface)
    both = with_mirror_images(snapshots, mesh)
    between = problem.between if both is snapshots else flows_between(vehicle, both)
    return _of_any_shape(vehicle, both, problem, operator, mesh, between)


def _is_vented(vehicle: Vehicle) -> bool:
    return vehicle.structure.internal_pressure_Pa == "ambient"


def _of_any_shape(
    vehicle: Vehicle,
    snapshots: Snapshots,
    problem: Problem,
    operator: FloatArray,
    mesh: SurfaceMesh,
    between: FlowsBetween | None,
) -> StateTables:
    entry, tables = vehicle.map, condition_tables(snapshots, operator, _is_vented(vehicle), between)
    process = process_on_surface(mesh, entry)
    field = None
    if entry.keep_field:
        field = shape_field(vehicle, snapshots, problem, process, tables.overpressure, between)

    def of_other_flow(flow: Snapshots) -> FloatArray:
        return condition_tables(flow, operator, _is_vented(vehicle)).coefficients

    return StateTables(
        mach_knots=tables.mach_knots,
        incidence_knots=tables.incidence_knots,
        coefficients=tables.coefficients,
        errors=tables.errors,
        process=operator @ process,
        overpressure=tables.overpressure,
        incidence_limit=tables.incidence_limit,
        crossflow_range=tables.crossflow_range,
        considered=_difference(vehicle, snapshots, tables.coefficients, of_other_flow),
        field=field,
        slopes=tables.slopes,
    )


def _difference(
    vehicle: Vehicle,
    snapshots: Snapshots,
    coefficients: FloatArray,
    tables_of: Callable[[Snapshots], FloatArray],
) -> FloatArray | None:
    """Return the tables of newtonian flow less ``coefficients`` of ``snapshots``, at one standard deviation."""
    newtonian = newtonian_snapshots(vehicle, snapshots)
    if newtonian is None:
        return None
    newtonian_tables = with_harmonics(tables_of(newtonian), coefficients.shape[3])
    return model_form(vehicle.map, vehicle.noise).of_newtonian * (newtonian_tables - coefficients)


def _of_revolution(
    vehicle: Vehicle, snapshots: Snapshots, problem: Problem, operator: FloatArray, grid: SurfaceGrid
) -> StateTables:
    entry, flows = vehicle.map, flow_amplitudes(snapshots)
    _check_flows(flows)
    overpressure = np.repeat(flows.overpressure(), grid.n_roll)
    if _is_vented(vehicle):
        flows = flows.less_ambient()
    n_m = flows.amplitude.shape[-1]
    response = ring_response(operator, grid, n_m)
    left_out, n_d = interpolation_errors(flows, response), len(problem.strain_operator)
    errors = {INTERPOLATION: left_out.T}
    if problem.sensors is None:
        # Flows left out show how far each gauge is off, not in which pattern: a gain that trusts it does worse.
        of_gauge = np.diag(np.linalg.norm(left_out[:, :n_d], axis=0))
        errors = {INTERPOLATION: block_diag(of_gauge, left_out[:, n_d:].T)}
    of_grid = grid_errors(vehicle, snapshots)
    if of_grid is not None:
        errors[GRID_REFINEMENT] = rolled_errors(of_amplitudes(of_grid[..., :n_m], response)).T
    knots, coefficients = _tables(flows, response)
    along, around = gaussian_process_shapes(grid, entry)

    def of_other_flow(flow: Snapshots) -> FloatArray:
        amplitudes = flow_amplitudes(flow)
        return _tables(amplitudes.less_ambient() if _is_vented(vehicle) else amplitudes, response)[1]

    return StateTables(
        mach_knots=flows.mach,
        incidence_knots=knots,
        coefficients=coefficients,
        errors=errors,
        process=response_of_shapes(operator, along, around),
        overpressure=overpressure,
        incidence_limit=float(flows.incidence[-1]),
        crossflow_range=None,
        considered=_difference(vehicle, snapshots, coefficients, of_other_flow),
        field=flight_field(vehicle, snapshots, problem, grid, of_grid) if entry.keep_field else None,
    )


def _check_flows(flows: FlowAmplitudes) -> None:
    counts = len(flows.mach), int(np.sum(flows.incidence > 1e-9))
    if counts[0] < MIN_FLOWS[0] or counts[1] < MIN_FLOWS[1]:
        raise InputError(
            f"map.estimator: 'nonlinear' needs {MIN_FLOWS[0]} Mach numbers and {MIN_FLOWS[1]} total incidences "
            f"above 0 at least, got {counts[0]} and {counts[1]}"
        )


def _tables(flows: FlowAmplitudes, response: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return knots of the incidence and spline coefficients of every channel of ``response``."""
    values = response_values(flows, response)
    inclined = np.flatnonzero(flows.incidence > 1e-9)
    zero = values[:, 0] if len(inclined) < len(flows.incidence) else None
    incidence = flows.incidence[inclined]
    return spline_coefficients(flows.mach, incidence, values[:, inclined], spline_rows(incidence), zero)
