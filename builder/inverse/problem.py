"""What an inverse map is solved from: strain and loads per pressure, noise and errors, auxiliary sensors.

Noise of the gauges and further modes of strain error, from the section [noise] of a vehicle file.
"""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from builder.aero.load_groups import other_load_operator
from builder.aero.load_operator import load_operator_on
from builder.aero.shapes import outer_surface
from builder.aero.surface.mesh import grid_of, mesh_of
from builder.campaign.snapshots import Snapshots, snapshots_on
from builder.inverse.ensemble import Ensemble, ensemble_of
from builder.inverse.noise.flow_models import (
    LEEWARD_PRESSURE,
    leeward_fields,
    newtonian_snapshots,
)
from builder.inverse.noise.flows_between import BETWEEN, SolvedFlows
from builder.inverse.noise.hardware_errors import HardwareError, MeshError, hardware_errors, hardware_terms
from builder.inverse.noise.inertia import inertia_errors, inertia_map, inertia_terms, strain_by_inertia
from builder.inverse.noise.model import NoiseTerm, gauge_noise, nuisance_modes, pressure_errors
from builder.inverse.noise.recorder import reading_std, recorder_terms, scan_errors
from builder.inverse.noise.thermal import (
    modulus_std,
    thermal_map,
    thermal_terms,
    with_sensor_rows,
)
from builder.inverse.sensor_set import joined_errors, joined_terms, sensor_set
from builder.inverse.solution import Problem
from builder.structure.fourier.fourier_model import StructuralModel, structural_model_on
from builder.structure.fourier.strain_operator import strain_harmonics
from builder.structure.gauge_checks import gauges_in_use
from builder.structure.mapped_structure import MappedStructure
from builder.structure.solid.checks import ELEMENT_FRACTION
from builder.vehicle.file import Vehicle
from builder.vehicle.map_options import Noise
from builder.vehicle.model_form import model_form
from strainfmu.arrays import FloatArray
from strainfmu.errors import InputError
from strainfmu.text_files import LARGEST, MIB, read_csv, shown_columns

MICRO = 1e-6


def gauge_covariance(entry: Noise, n_gauges: int, median_strain: float, folder: Path) -> FloatArray:
    """Return the covariance (n_gauges, n_gauges) of the gauges' own noise [(m/m)^2].

    Parameters
    ----------
    entry : section [noise].
    n_gauges : n_d.
    median_strain : median |strain| that relative noise refers to [m/m].
    folder : where ``covariance_file`` lies.

    Raises
    ------
    InputError
        The number of values differs from the number of gauges, or a file holds no covariance.
    """
    if entry.covariance_file is not None:
        return MICRO**2 * _covariance_of(folder / entry.covariance_file, n_gauges)
    if entry.std_of_gauges_um_per_m is not None:
        std = MICRO * np.array(entry.std_of_gauges_um_per_m)
        if len(std) != n_gauges:
            raise InputError(f"noise.std_of_gauges_um_per_m: {len(std)} values found, must be {n_gauges}")
        return np.diag(std**2)
    if entry.std_um_per_m is not None:
        return np.diag(np.full(n_gauges, (MICRO * entry.std_um_per_m) ** 2))
    assert entry.percent_of_median_strain is not None
    if not median_strain > 0.0:
        raise InputError("noise.percent_of_median_strain: the median strain is 0; give std_um_per_m")
    return np.diag(np.full(n_gauges, (0.01 * entry.percent_of_median_strain * median_strain) ** 2))


MATRIX = 256 * MIB
"""Covariance of 2,000 gauges with all digits: 100 MiB."""


def _covariance_of(path: Path, n_gauges: int) -> FloatArray:
    """Read a square CSV table of numbers and check that it is a covariance."""
    where = f"noise.covariance_file: {path}"
    rows = [row for row in _rows(path, "noise.covariance_file", MATRIX) if not row[0].startswith("#")]
    try:
        values = np.array([[float(cell) for cell in row] for row in rows]).reshape(max(len(rows), 1), -1)
    except ValueError as error:
        raise InputError(f"{where}: not a table of numbers separated by commas") from error
    if values.shape != (n_gauges, n_gauges):
        raise InputError(f"{where}: {values.shape[0]} x {values.shape[1]} found, must be {n_gauges} x {n_gauges}")
    symmetric = np.all(np.isfinite(values)) and np.allclose(values, values.T, rtol=1e-9, atol=0.0)
    if not (symmetric and np.linalg.eigvalsh(values)[0] > 0.0):
        raise InputError(f"{where}: no covariance: must be symmetric and positive definite")
    return values


def _rows(path: Path, entry: str, largest: int) -> list[list[str]]:
    try:
        return [row for _, row in read_csv(path, largest)]
    except InputError as error:
        raise InputError(f"{entry}: {error}") from error


def nuisance_terms(path: Path, gauge_names: Sequence[str]) -> list[NoiseTerm]:
    """Read further modes of strain error from a CSV file: one term per column, with the column's name.

    The header is ``gauge`` and a name per mode. A row is a gauge's name and its strain [um/m] in each mode at one
    standard deviation. Rows may be in any order.

    Raises
    ------
    InputError
        The file is missing, holds other gauges than ``gauge_names``, or a value is no number; the message names
        the gauge.
    """
    where = f"noise.nuisance_file: {path}"
    header, *rows = _rows(path, "noise.nuisance_file", LARGEST) or [[]]
    names = [name.strip() for name in header[1:]]
    if len(header) < 2 or header[0].strip() != "gauge" or "" in names or len(set(names)) < len(names):
        got = shown_columns(header, ("gauge",))
        raise InputError(f"{where}: expected the columns gauge and a name per mode, got {got}")
    terms = dict(_nuisance_row(row, len(names), where) for row in rows)
    if len(terms) < len(rows):
        raise InputError(f"{where}: a gauge is listed twice")
    for name in gauge_names:
        if name not in terms:
            raise InputError(f"{where}: gauge '{name}' of the layout in use is missing")
    if len(terms) > len(gauge_names):
        unknown = next(name for name in terms if name not in gauge_names)
        raise InputError(f"{where}: gauge '{unknown}' is not in the layout in use")
    strain = MICRO * np.array([terms[name] for name in gauge_names])
    return [nuisance_modes(name, strain[:, [k]], np.ones(1)) for k, name in enumerate(names)]


def _nuisance_row(row: list[str], n_modes: int, where: str) -> tuple[str, list[float]]:
    """Return the gauge's name and its values."""
    name = row[0].strip()
    if len(row) != n_modes + 1:
        raise InputError(f"{where}, gauge '{name}': {len(row) - 1} values found, must be {n_modes}")
    try:
        values = [float(value) for value in row[1:]]
    except ValueError as error:
        raise InputError(f"{where}, gauge '{name}': {', '.join(row[1:])} found, must be numbers") from error
    if not np.all(np.isfinite(values)):
        raise InputError(f"{where}, gauge '{name}': {', '.join(row[1:])} found, must be finite")
    return name, values


AnyStructure = StructuralModel | MappedStructure


def gauge_noise_covariance(
    vehicle: Vehicle, snapshots: Snapshots, structure: AnyStructure, strain_operator: FloatArray | None = None
) -> FloatArray:
    """Return the covariance (n_d, n_d) of the noise of the gauges in use and of their recorder [(m/m)^2].

    Relative noise is a fraction of the median |strain| over the snapshots, at their own pressure level and as they
    are listed, and the gauges of ``noise.of_layout``. ``strain_operator`` is Z_p of the layout in use, if it has
    been computed.

    Raises
    ------
    InputError
        The section [noise] does not fit the gauges.
    """
    entry = vehicle.noise
    layout, median = vehicle.gauges.layout, 0.0
    if entry.percent_of_median_strain is not None:
        inside = vehicle.structure.internal_pressure(snapshots.conditions())
        net = snapshots.pressure - inside[:, None]
        of_layout = entry.of_layout or layout
        operator = strain_operator if of_layout == layout else None
        operator = structure.strain_operator(of_layout) if operator is None else operator
        median = float(np.median(np.abs(net @ operator.T)))
    n_d = len(structure.layouts[layout].names)
    covariance = gauge_covariance(entry, n_d, median, vehicle.beside(""))
    covariance[np.diag_indices(n_d)] += np.sum([s**2 for s in reading_std(vehicle.recorder, n_d).values()], axis=0)
    return covariance


def check_noise(vehicle: Vehicle) -> None:
    """Refuse entries and files of the section [noise] that do not fit the gauges in use.

    Called before the long work.

    Raises
    ------
    InputError
        As :func:`gauge_noise_covariance` and :func:`builder.inverse.problem.nuisance_terms`.
    """
    entry, names = vehicle.noise, gauges_in_use(vehicle).name
    gauge_covariance(entry, len(names), 1.0, vehicle.beside(""))
    reading_std(vehicle.recorder, len(names))
    if entry.nuisance_file is not None:
        nuisance_terms(vehicle.beside(entry.nuisance_file), names)


def check_other_loads(vehicle: Vehicle) -> None:
    """Refuse places of loads behind the five, such as section stations, that are not on the vehicle's surface.

    Called before the long work.

    Raises
    ------
    InputError
        As :func:`builder.aero.load_groups.other_load_operator`, or the surface is wrong.
    """
    surface, _ = outer_surface(vehicle, vehicle.resolution.map)
    other_load_operator(surface, vehicle.map, vehicle.reference_quantities().moment_station)


def _terms_of_readings(vehicle: Vehicle, structure: AnyStructure, covariance: FloatArray) -> list[NoiseTerm]:
    """Return the noise ``covariance`` (n_d, n_d) of the gauges, modes of a file, and errors of the recorder."""
    layout, file = structure.layouts[vehicle.gauges.layout], vehicle.noise.nuisance_file
    nuisance = [] if file is None else nuisance_terms(vehicle.beside(file), layout.names)
    along = mesh_of(structure.surface).point[:, 0]
    aft = (layout.position[:, 0] - along.min()) / np.ptp(along)
    return [gauge_noise(covariance), *nuisance, *recorder_terms(vehicle.recorder, aft)]


def errors_of_flows(vehicle: Vehicle, flows: SolvedFlows, ensemble: Ensemble) -> dict[str, FloatArray]:
    """Return fields (k, n_p) [Pa] of errors that count where flows are as listed, by name of the error."""
    if ensemble.grid is not None or vehicle.noise.model != "default":
        return {}
    fields = dict[str, FloatArray]()
    if flows.between is not None:
        fields[BETWEEN] = flows.between.off_the_snapshots(ensemble, vehicle.map.follows_pressure)
    leeward = leeward_fields(flows, model_form(vehicle.map, vehicle.noise), ensemble)
    return fields if leeward is None else {**fields, LEEWARD_PRESSURE: leeward}


def inverse_problem(
    vehicle: Vehicle,
    snapshots: Snapshots,
    structure: AnyStructure,
    nuisance: Sequence[NoiseTerm] = (),
    remaining_errors: Sequence[HardwareError] = (),
) -> Problem:
    """Return what the map of the layout in use is solved from.

    Parameters
    ----------
    vehicle : the vehicle file.
    snapshots : surface pressure at the flight conditions.
    structure : strain per pressure.
    nuisance : other noise terms, such as thermal strain.
    remaining_errors : other errors in proportion to strain, such as what a ground test left.

    Raises
    ------
    InputError
        The snapshots' surface is not the structure's, or the section [noise] does not fit the gauges.
    """
    snapshots = on_structure(snapshots, structure)
    z_p = structure.strain_operator(vehicle.gauges.layout)
    ensemble = ensemble_of(vehicle, snapshots)
    covariance = gauge_noise_covariance(vehicle, snapshots, structure, z_p)
    mesh = _mesh_error(vehicle, structure, ensemble, np.sqrt(np.diag(covariance)))
    thermal = thermal_map(vehicle)
    by_inertia = None if vehicle.mass is None else strain_by_inertia(vehicle, vehicle.mass)
    inertia = inertia_map(by_inertia)
    errors = hardware_errors(vehicle, structure, z_p, ensemble, modulus_std=modulus_std(thermal))
    errors += [*remaining_errors, *inertia_errors(by_inertia, ensemble, structure.surface)]
    errors += scan_errors(vehicle.recorder, z_p, ensemble)
    if mesh is not None and vehicle.noise.model == "default":
        errors += mesh.terms()
    terms = [
        *_terms_of_readings(vehicle, structure, covariance),
        *hardware_terms(vehicle.noise, errors, ensemble, z_p),
        *thermal_terms(vehicle.temperature, thermal),
        *inertia_terms(inertia, by_inertia),
        *nuisance,
    ]
    sensors = sensor_set(vehicle, structure, ensemble, covariance)
    if sensors is not None:
        terms = joined_terms(terms, errors, sensors, ensemble)
        errors = joined_errors(errors, sensors, len(z_p), ensemble)
        z_p = np.vstack([z_p, sensors.operator])
    surface, reference = structure.surface, vehicle.reference_quantities()
    other_loads = other_load_operator(surface, vehicle.map, reference.moment_station)
    loads = np.vstack([load_operator_on(surface, reference.moment_station), other_loads])
    flows = SolvedFlows(snapshots=snapshots, entries=vehicle.flow_entries())
    fields = errors_of_flows(vehicle, flows, ensemble)
    terms += [pressure_errors(name, columns, z_p, loads) for name, columns in fields.items()]
    newtonian = newtonian_snapshots(model_form(vehicle.map, vehicle.noise), snapshots)
    return Problem(
        ensemble=ensemble,
        strain_operator=z_p,
        load_operator=loads,
        node_area=mesh_of(structure.surface).node_area,
        noise=tuple(terms),
        errors=tuple(errors),
        entry=vehicle.map,
        tolerances=vehicle.noise,
        stated_sensors=vehicle.sensors,
        reference=reference,
        inside=vehicle.structure.internal_pressure_Pa,
        flows=flows,
        mesh=mesh,
        sensors=sensors,
        thermal=thermal if sensors is None else with_sensor_rows(thermal, len(sensors.rows)),
        inertia=inertia,
        off_the_snapshots=fields.get(BETWEEN),
        leeward=fields.get(LEEWARD_PRESSURE),
        newtonian=None if newtonian is None else ensemble_of(vehicle, newtonian),
    )


def _mesh_error(
    vehicle: Vehicle, structure: AnyStructure, ensemble: Ensemble, std: FloatArray
) -> MeshError | None:
    """Return the error by the structure's mesh over the noise ``std`` (n_d,), None where it is not known."""
    layout, against = vehicle.gauges.layout, structure.checked_against
    if isinstance(structure, StructuralModel) and structure.error is not None and ensemble.grid is not None:
        amplitudes = strain_harmonics(structure.error, structure.placed[layout], ensemble.harmonics)
        strain = ensemble.of_amplitudes(amplitudes)
    else:
        operator = structure.error_operator(layout)
        if operator is None and isinstance(structure, MappedStructure) and not structure.is_external:
            operator, against = _difference_of_fourier_model(vehicle, structure), "the Fourier model"
        if operator is None:
            return None
        strain = ensemble.responses(operator)
    in_sigma = np.sqrt(ensemble.member_weight @ strain**2) / std
    return MeshError(against=against, strain=strain, in_sigma=in_sigma)


def _difference_of_fourier_model(vehicle: Vehicle, structure: MappedStructure) -> FloatArray | None:
    """Return what the Fourier model's Z_p (n_d, n_p) [1/Pa] adds to ``structure``; None where it cannot do it."""
    layout, grid = vehicle.gauges.layout, grid_of(structure.surface)
    if grid is None or layout not in vehicle.gauges.layouts:
        return None
    resolution = vehicle.resolution.map
    length = min(resolution.element_length_mm, 1e3 * ELEMENT_FRACTION * vehicle.body().length)
    fine = resolution.model_copy(
        update={"element_length_mm": length, "wall_layers": max(2, resolution.wall_layers)}
    )
    try:
        fine_structure = structural_model_on(vehicle, grid, fine, [layout])
    except InputError:
        return None
    return fine_structure.strain_operator(layout) - structure.strain_operator(layout)


def on_structure(snapshots: Snapshots, structure: AnyStructure) -> Snapshots:
    """Return the snapshots at the structure's nodes, unchanged where they are there already."""
    grid = grid_of(structure.surface)
    return snapshots if grid is None else snapshots_on(snapshots, grid)
