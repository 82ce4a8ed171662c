"""Tables over the flight state with the errors of their making, of a body of revolution and of any shape.

The tables hold strain and loads of any shape. Errors are what flows left out show, what a coarser grid of the flow
changes, and pressure off the tables. Of a surface without rings the pressure itself is a table too. A symmetric
body that was solved on one side has the mirror images of its flows.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from scipy.linalg import block_diag

from builder.aero.load_groups import Surface
from builder.aero.pressure_map import mirror_operator
from builder.aero.surface.mesh import SurfaceMesh, grid_of, mesh_of
from builder.campaign.snapshots import Snapshots
from builder.inverse.noise.error_list import GRID_REFINEMENT, INTERPOLATION, PROCESS, SPREAD, parts_of
from builder.inverse.noise.flow_models import LEEWARD_PRESSURE, LEVEL, newtonian_snapshots
from builder.inverse.noise.flows_between import FlowsBetween, SolvedFlows
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
from builder.vehicle.model_form import ModelForm
from builder.vehicle.shape.geometry import SurfaceGrid
from strainfmu.arrays import FloatArray
from strainfmu.errors import InputError
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
    expected = problem.model_form
    fields = [(name, modes @ columns) for name, columns in tables.errors.items()]
    fields += [(PROCESS, process_size(problem) * process)]
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


def grid_errors(flows: SolvedFlows) -> FloatArray | None:
    """Return (q, n_x, n_m) amplitudes of cos m(phi - phi_T) of the error of p / p_inf in q flows.

    The flows are in :attr:`~builder.inverse.noise.flows_between.SolvedFlows.grid_difference`; None where they are
    not known.
    """
    grid, differences = flows.snapshots.grid, flows.grid_difference
    if grid is None or not differences:
        return None
    n_m = min(MAX_FIELD_HARMONIC, (grid.n_roll - 1) // 2) + 1
    return np.array(
        [
            cosine_amplitudes(
                difference.reshape(len(grid.x), -1), grid.roll_angle - condition.leeward_roll_angle, n_m
            )
            for condition, difference in differences
        ]
    )


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


def state_tables(problem: Problem, surface: Surface, operator: FloatArray) -> StateTables:
    """Return the tables of ``operator`` (n, n_p) times pressure on ``surface``, less the scaling pressure inside.

    Raises
    ------
    InputError
        The flows do not suffice for tables.
    """
    grid, flows = grid_of(surface), problem.flows
    assert flows is not None
    if grid is not None and problem.ensemble.grid is not None:
        return _of_revolution(flows, problem, operator, grid)
    mesh = mesh_of(surface)
    both = with_mirror_images(flows.snapshots, mesh)
    if both is not flows.snapshots:
        flows = replace(flows, snapshots=both)
    return _of_any_shape(flows, problem, operator, mesh)


def _of_any_shape(flows: SolvedFlows, problem: Problem, operator: FloatArray, mesh: SurfaceMesh) -> StateTables:
    entry, snapshots, is_vented = problem.entry, flows.snapshots, problem.inside == "ambient"
    tables = condition_tables(snapshots, operator, is_vented, flows.between)
    process = process_on_surface(mesh, entry)
    field = None
    if entry.keep_field:
        field = shape_field(snapshots, problem, process, tables.overpressure, flows.between)

    def of_other_flow(flow: Snapshots) -> FloatArray:
        return condition_tables(flow, operator, is_vented).coefficients

    return StateTables(
        mach_knots=tables.mach_knots,
        incidence_knots=tables.incidence_knots,
        coefficients=tables.coefficients,
        errors=tables.errors,
        process=operator @ process,
        overpressure=tables.overpressure,
        incidence_limit=tables.incidence_limit,
        crossflow_range=tables.crossflow_range,
        considered=_difference(problem.model_form, snapshots, tables.coefficients, of_other_flow),
        field=field,
        slopes=tables.slopes,
    )


def _difference(
    sizes: ModelForm,
    snapshots: Snapshots,
    coefficients: FloatArray,
    tables_of: Callable[[Snapshots], FloatArray],
) -> FloatArray | None:
    """Return the tables of newtonian flow less ``coefficients`` of ``snapshots``, at one standard deviation."""
    newtonian = newtonian_snapshots(sizes, snapshots)
    if newtonian is None:
        return None
    newtonian_tables = with_harmonics(tables_of(newtonian), coefficients.shape[3])
    return sizes.of_newtonian * (newtonian_tables - coefficients)


def _of_revolution(flows: SolvedFlows, problem: Problem, operator: FloatArray, grid: SurfaceGrid) -> StateTables:
    entry, snapshots, is_vented = problem.entry, flows.snapshots, problem.inside == "ambient"
    amplitudes = flow_amplitudes(snapshots)
    _check_flows(amplitudes)
    overpressure = np.repeat(amplitudes.overpressure(), grid.n_roll)
    if is_vented:
        amplitudes = amplitudes.less_ambient()
    n_m = amplitudes.amplitude.shape[-1]
    response = ring_response(operator, grid, n_m)
    left_out, n_d = interpolation_errors(amplitudes, response), len(problem.strain_operator)
    errors = {INTERPOLATION: left_out.T}
    if problem.sensors is None:
        # Flows left out show how far each gauge is off, not in which pattern: a gain that trusts it does worse.
        of_gauge = np.diag(np.linalg.norm(left_out[:, :n_d], axis=0))
        errors = {INTERPOLATION: block_diag(of_gauge, left_out[:, n_d:].T)}
    of_grid = grid_errors(flows)
    if of_grid is not None:
        errors[GRID_REFINEMENT] = rolled_errors(of_amplitudes(of_grid[..., :n_m], response)).T
    knots, coefficients = _tables(amplitudes, response)
    along, around = gaussian_process_shapes(grid, entry)

    def of_other_flow(flow: Snapshots) -> FloatArray:
        of_flow = flow_amplitudes(flow)
        return _tables(of_flow.less_ambient() if is_vented else of_flow, response)[1]

    return StateTables(
        mach_knots=amplitudes.mach,
        incidence_knots=knots,
        coefficients=coefficients,
        errors=errors,
        process=response_of_shapes(operator, along, around),
        overpressure=overpressure,
        incidence_limit=float(amplitudes.incidence[-1]),
        crossflow_range=None,
        considered=_difference(problem.model_form, snapshots, coefficients, of_other_flow),
        field=flight_field(snapshots, problem, grid, of_grid) if entry.keep_field else None,
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
