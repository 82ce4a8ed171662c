"""From a map and the file of a ground test to the calibrated map and the report next to it."""

from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from builder.calibration.after_test.calibrated_map import (
    calibrated_map,
    calibrated_vehicle,
    remaining_after,
    with_provenance,
)
from builder.calibration.after_test.flown_after_test import allowed_flights
from builder.calibration.after_test.left_by_test import Remaining
from builder.calibration.estimate.case_faults import Fault
from builder.calibration.estimate.estimated_vehicle import Estimate
from builder.calibration.estimate.ground_test_faults import calibrate_with_faults
from builder.calibration.estimate.load_steps import step_remarks
from builder.calibration.estimate.outside_terms import OutsideModel, outside_model
from builder.calibration.estimate.readings_model import ReadingsModel, solved_loads
from builder.calibration.estimate.remarks import remarks, unexplained
from builder.calibration.ground_test.candidate_cases import harmonics_of_test
from builder.calibration.ground_test.ground_test_readings import read_load_test
from builder.calibration.ground_test.load_test import LoadTest
from builder.calibration.ground_test.load_test_file import LoadTestFile, read_test_file
from builder.calibration.ground_test.structure_of_test import prior_of_test, structure_of_test
from builder.calibration.plan.worth_of_test import further_test
from builder.campaign.snapshot_fit import as_flown, vehicle_misfits
from builder.campaign.snapshots import Snapshots, load_snapshots
from builder.pipeline.calibration_report import PAGE, PDF, calibration_findings, report_files, write_report
from builder.pipeline.map_files import cached_flows, cached_snapshots, cached_structure
from builder.pipeline.measured_levels import alarm_levels_wanted, with_measured_levels
from builder.pipeline.pipeline import FLOWS, SNAPSHOTS, STRUCTURE
from builder.pipeline.progress_bars import AnyProgress, reporter_of
from builder.pipeline.stages import solved_true_structure
from builder.reporting import Reporter
from builder.reports.calibration_page.verdict import CalibrationFindings, Verdict, verdict
from builder.structure.as_built.as_built_structure import AsBuiltStructure
from builder.structure.as_built.as_built_vehicle import slices
from builder.structure.as_built.displaced_structure import AnyAsBuilt, DisplacedStructure, displaced_structure
from builder.structure.fourier.fourier_model import structural_model
from builder.structure.mapped_structure import mapped_structure
from builder.structure.structure_file import load_structure
from builder.trial.readings import World
from builder.truth.flow_table import FlowTable, load_flow_table
from builder.truth.true_structure import TrueStructure
from builder.vehicle.file import Vehicle, load_vehicle
from builder.workspace import refuse_misfits
from strainfmu.arrays import FloatArray
from strainfmu.cosim.estimators.zeros_file import write_zeros
from strainfmu.errors import InputError, StrainfmuError
from strainfmu.estimator.gauge_zeros import GaugeZeros
from strainfmu.estimator.map.inverse_map import InverseMap, load_inverse_map, save_inverse_map
from strainfmu.estimator.signal_names import ZERO

ZEROS = "_zeros.toml"
"""End of the name of the file of zeros next to the map."""


@dataclass(frozen=True, eq=False, kw_only=True)
class IndependentModel:
    """Structure and flows that alarm levels are measured on."""

    structure: TrueStructure
    flows: FlowTable


@dataclass(frozen=True, eq=False, kw_only=True)
class Calibration:
    """A finished calibration.

    Attributes
    ----------
    inverse_map : of the vehicle as built.
    estimate, faults, outside : results of the test.
    files : that were written.
    notes : lines for the user.
    verdict : of the report, where one was written.
    accepted : why no known error explains the readings, where that was accepted.
    """

    inverse_map: InverseMap
    estimate: Estimate
    faults: tuple[Fault, ...]
    outside: OutsideModel
    files: tuple[Path, ...] = ()
    notes: tuple[str, ...] = ()
    verdict: Verdict | None = None
    accepted: str = ""


@dataclass(frozen=True, eq=False, kw_only=True)
class CalibrationParts:
    """What a calibration starts from: ``map_as_drawn``, and what it was made from.

    ``independent`` sets alarm levels; without it they are the levels of the map as drawn.
    """

    vehicle: Vehicle
    snapshots: Snapshots
    structure: AnyAsBuilt
    map_as_drawn: InverseMap
    independent: IndependentModel | None = None


def calibrate(
    inverse_map: str | Path,
    test: str | Path,
    output: str | Path = "calibrated.h5",
    *,
    vehicle: str | Path | None = None,
    snapshots: str | Path | None = None,
    structure: str | Path | None = None,
    accept: bool = False,
    progress: AnyProgress = None,
) -> Calibration:
    """Estimate the vehicle as built from a ground test and make its map.

    The model predicts the reading of every gauge under the loads of the test. Gains, directions and places of
    the gauges, wall, modulus, mass, support and errors of the loads follow by Bayes' rule from the tolerances
    of the vehicle file's section ``calibration``. A mass that differs is named.

    Gauges and load cases that do not fit are named and left out. Readings that no vehicle within its
    tolerances can have are refused: check loads, units and signs.

    The new map includes what the test left unknown in its noise. A report of the same name is written with it
    (.html and .pdf; load equations as .csv). It says whether to accept the test or to repeat parts of it. Check
    loads (check = true in the test's file) are predicted and not fitted. The zero offsets of the gauges are
    written as well (calibrated_zeros.toml), which ``estimate``, ``bridge`` and ``replay`` take by ``--zeros``.

    ``strainfmu loadtest`` proposes a test; with ``--template`` it writes the file for a test of your own.

    On the command line::

        strainfmu calibrate out/map.h5 loadtest.toml -o out/calibrated.h5
        strainfmu calibrate map.h5 loadtest.toml --vehicle my_vehicle.toml --snapshots flows/fine.h5

    Parameters
    ----------
    inverse_map : map of the vehicle as drawn (map.h5).
    test : file of the ground test (loadtest.toml).
    output : the calibrated map.
    vehicle : vehicle file of the map. Default: the one that the test names.
    snapshots : snapshots of the map. Default: snapshots.h5 next to the map, else of the vehicle file's cache.
    structure : structure of the map, where it is no semi-analytic one. Default: structure.h5 next to the map, else
        of the vehicle file's cache.
    accept : write the map although no known error explains the readings.
    progress : True for progress bars.

    Raises
    ------
    InputError
        A file is missing or wrong, or map, test, vehicle and snapshots are not of one vehicle.
    StrainfmuError
        No error with a name explains the readings, and that is not accepted.
    """
    map_path, test_path, output, reporter = Path(inverse_map), Path(test), Path(output), reporter_of(progress)
    vehicle_path = None if vehicle is None else Path(vehicle)
    check_output(output)
    map_as_drawn, file = load_inverse_map(map_path), read_test_file(test_path)
    loaded = _vehicle(file, vehicle_path, map_as_drawn, map_path)
    snapshots_path = _beside(map_path, SNAPSHOTS, snapshots, cached_snapshots, loaded, reporter)
    pressures = load_snapshots(snapshots_path)
    refuse_misfits(snapshots_path, vehicle_misfits(pressures, loaded))
    readings, notes = read_load_test(file, map_as_drawn.gauge_names)
    with reporter.stage("Structure: what may differ as built") as advance:
        if loaded.structure.model == "solid":
            solid = load_structure(_beside(map_path, STRUCTURE, structure, cached_structure, loaded, reporter))
            tested: AnyAsBuilt = displaced_structure(loaded, mapped_structure(solid, pressures))
        else:
            tested = structure_of_test(loaded, max_harmonic=harmonics_of_test(readings), progress=advance)
    if tested.gauges.names != map_as_drawn.gauge_names:
        raise InputError(f"{map_path}: gauges are not the gauges of layout '{loaded.gauges.layout}'")
    flown = as_flown(loaded, pressures)
    independent, missing = _independent_model(flown, tested, snapshots_path.with_name(FLOWS), reporter)
    parts = CalibrationParts(
        vehicle=loaded, snapshots=pressures, structure=tested, map_as_drawn=map_as_drawn, independent=independent
    )
    made = calibration_by(readings, test_path, parts, reporter, accept)
    zeros = zeros_beside(output)
    start = (
        f"zero offsets of the {tested.n_gauges} gauges by the test: part of {output.name}, which starts from "
        f"them, as its FMUs do; {zeros.name} has them for other maps (--zeros); a tare replaces them"
    )
    files = {
        "map of the drawing": map_path,
        "snapshots": snapshots_path,
        "vehicle": named_vehicle(file, vehicle_path),
    }
    with reporter.stage("Report"):
        made, written, without = write_calibration(made, parts, file, files, output)
        write_zeros_of(made.estimate, zeros, output.name)
    since = [f"gauge '{name}': {change} after the test: as before it" for name, change in readings.changed.items()]
    said = (*without, *step_remarks(readings), *since)
    return replace(
        made,
        files=(output, *written, zeros),
        notes=(*notes, *missing, start, *said, *made.notes),
    )


def _beside(
    map_path: Path,
    name: str,
    stated: str | Path | None,
    cached: Callable[[Vehicle], Path | None],
    vehicle: Vehicle,
    reporter: Reporter,
) -> Path:
    """Return the file ``stated``, or the file ``name`` next to the map, or the one that another command left."""
    path = Path(stated or map_path.parent / name)
    if stated is None and not path.exists() and (file := cached(vehicle)) is not None:
        reporter.note(f"{name}: from {file.parent}, reused")
        return file
    return path


def write_calibration(
    made: Calibration, parts: CalibrationParts, file: LoadTestFile, files: Mapping[str, Path], output: Path
) -> tuple[Calibration, tuple[Path, ...], tuple[str, ...]]:
    """Write the map with its zeros and the verdict on its test, and the report next to it.

    Return the calibration as written, the files of the report, and lines for the user. ``files`` are those that
    the calibration was made from.
    """
    findings = findings_of(made, parts, file, files)
    test_verdict = verdict(findings)
    known = with_zeros(made.inverse_map, made.estimate)
    facts = {**known.provenance["calibration"], "verdict": test_verdict.facts}
    made = replace(made, inverse_map=with_provenance(known, facts), verdict=test_verdict)
    save_inverse_map(made.inverse_map, output)
    return made, *write_report(findings, output)


def findings_of(
    made: Calibration, parts: CalibrationParts, file: LoadTestFile, files: Mapping[str, Path]
) -> CalibrationFindings:
    """Return what the report of a calibration is made from; ``files`` are those it was made from."""
    return calibration_findings(
        made.estimate,
        made.faults,
        made.outside,
        vehicle=parts.vehicle,
        snapshots=parts.snapshots,
        structure=parts.structure,
        file=file,
        files=files,
        accepted=made.accepted,
    )


def zeros_beside(output: Path) -> Path:
    """Return where the zeros of a calibrated map are written."""
    return output.with_name(f"{output.stem}{ZEROS}")


def with_zeros(inverse_map: InverseMap, estimate: Estimate) -> InverseMap:
    """Return ``inverse_map`` with the zero offsets that a test found; their covariance is part of its noise."""
    zero, after = np.zeros(inverse_map.n_gauges), remaining_after(estimate).parameters
    zero[: after.n_gauges] = after.zero
    return replace(inverse_map, zero_offset=zero)


def write_zeros_of(estimate: Estimate, path: Path, map_name: str) -> None:
    """Write the zeros that a test found, as zeros.toml; their covariance stands in the map, and is 0 here."""
    after = remaining_after(estimate).parameters
    zeros = GaugeZeros(value=after.zero, std=np.zeros(after.n_gauges))
    write_zeros(path, estimate.model.structure.gauges.names, zeros, {"calibration": map_name})


def calibration_by(
    test: LoadTest, test_path: Path, parts: CalibrationParts, reporter: Reporter, accept: bool = False
) -> Calibration:
    """Return the calibration of a map by a ground test, files not yet written.

    Raises
    ------
    InputError
        No reading is left, or the map cannot be built.
    StrainfmuError
        No error with a name explains the readings, and ``accept`` is false.
    """
    vehicle, structure = parts.vehicle, parts.structure
    prior = prior_of_test(vehicle, structure)
    with reporter.stage("Estimate: the vehicle as built"), _naming(test_path):
        # One solution serves the pressure that flies, the loads of the test, and loads that the report compares.
        ahead = solved_loads(further_test(vehicle, structure, test))
        estimate, faults = calibrate_with_faults(ReadingsModel(structure, test, prior, ahead))
        outside = outside_model(estimate)
    against = unexplained(estimate, outside, faults)
    if against and not accept:
        for line in (*(fault.line for fault in faults), *outside.lines, *remarks(estimate)):
            reporter.note(line)
        raise StrainfmuError(f"{test_path}: load test: {against}; no map written, --accept writes it")
    with reporter.stage("Map of the vehicle as built"):
        try:
            made = _map(parts, estimate)
        except InputError as error:
            if estimate.agrees:
                raise
            raise InputError(f"{test_path}: load test: {estimate.far_off}") from error
    made = with_levels(made, parts, remaining_after(estimate), reporter)
    facts = _facts(estimate, faults, outside, test_path) | ({"accepted": against} if against else {})
    notes = (f"accepted: {against}",) if against else ()
    made = with_provenance(made, facts)
    return Calibration(
        inverse_map=made, estimate=estimate, faults=faults, outside=outside, notes=notes, accepted=against
    )


@contextmanager
def _naming(test_path: Path) -> Iterator[None]:
    """Name the file of the ground test in what is refused of its loads and readings."""
    try:
        yield
    except InputError as error:
        raise InputError(f"{test_path}: {error}") from error


def check_output(path: Path) -> None:
    """Refuse a name under which map and page cannot be written, before the long work.

    Raises
    ------
    InputError
        It is a name of the report's, or a folder.
    """
    if path.suffix in (PAGE, PDF):
        raise InputError(f"{path}: --output: expected another suffix than {path.suffix}, which is the report's")
    for target in (path, *report_files(path), zeros_beside(path)):
        if target.is_dir():
            raise InputError(f"{target}: is a folder, must be a file")


def named_vehicle(file: LoadTestFile, path: Path | None) -> Path:
    """Return the vehicle file: ``path``, or else the one that the file of the test names.

    Raises
    ------
    InputError
        Neither is there.
    """
    if path is not None:
        return path
    if file.vehicle is None:
        raise InputError(f"{file.path}: vehicle: entry is missing; name the vehicle file there or by --vehicle")
    return file.beside(file.vehicle)


def _vehicle(file: LoadTestFile, path: Path | None, map_as_drawn: InverseMap, map_path: Path) -> Vehicle:
    """Return the vehicle with the map options of the map that is calibrated."""
    vehicle = load_vehicle(named_vehicle(file, path))
    if vehicle.name != map_as_drawn.vehicle:
        raise InputError(f"{map_path}: expected a map of '{vehicle.name}', got one of '{map_as_drawn.vehicle}'")
    if map_as_drawn.form != vehicle.map.form or map_as_drawn.case != vehicle.map.case:
        raise InputError(
            f"{map_path}: expected map.case {vehicle.map.case} and form '{vehicle.map.form}' of the vehicle file, "
            f"got {map_as_drawn.case} and '{map_as_drawn.form}'"
        )
    if "calibration" in map_as_drawn.provenance:
        raise InputError(f"{map_path}: already calibrated; expected the map that the vehicle file makes")
    estimator = "linear" if map_as_drawn.manifold is None else "nonlinear"
    return vehicle.model_copy(update={"map": vehicle.map.model_copy(update={"estimator": estimator})})


def _map(parts: CalibrationParts, estimate: Estimate) -> InverseMap:
    """Return the calibrated map with the alarm levels of the theory."""
    vehicle = parts.vehicle
    operators: dict[str, FloatArray] = {}
    named = vehicle.noise.of_layout
    if named not in (None, vehicle.gauges.layout) and isinstance(parts.structure, AsBuiltStructure):
        assert named is not None
        operators[named] = structural_model(vehicle, vehicle.resolution.map, [named]).strain_operator(named)
    return calibrated_map(vehicle, parts.snapshots, parts.structure, remaining_after(estimate), operators)


def _independent_model(
    vehicle: Vehicle, tested: AnyAsBuilt, flows: Path, reporter: Reporter
) -> tuple[IndependentModel | None, tuple[str, ...]]:
    """Return the independent model of ``vehicle`` with the flows of a file or of the cache, or None and why."""
    if not alarm_levels_wanted(vehicle, reporter):
        return None, ()
    if isinstance(tested, DisplacedStructure):
        return None, ("alarm levels: as of the map as drawn, whose structure is no semi-analytic one",)
    if not flows.exists():
        flows = cached_flows(vehicle) or flows
    if not flows.exists():
        return None, (f"alarm levels: as of the map as drawn, {FLOWS} is not next to the snapshots",)
    table = load_flow_table(flows, vehicle)
    # What a vehicle as built changes of the strain follows from the structure of the test.
    return IndependentModel(structure=solved_true_structure(vehicle, reporter, ()), flows=table), ()


def with_levels(made: InverseMap, parts: CalibrationParts, remaining: Remaining, reporter: Reporter) -> InverseMap:
    """Return ``made`` with alarm levels of vehicles that ``remaining`` allows on the independent model.

    Where there is no such model they are the levels of the map as drawn.
    """
    model, vehicle = parts.independent, as_flown(parts.vehicle, parts.snapshots)
    if model is None or not isinstance(parts.structure, AsBuiltStructure):
        return with_levels_of(made, parts.map_as_drawn)
    world = World(
        vehicle=calibrated_vehicle(vehicle), structure=model.structure, flows=model.flows, inverse_map=made
    )
    fly = partial(allowed_flights, world, parts.structure, remaining)
    return with_measured_levels(world, reporter, fly=fly)


def with_levels_of(made: InverseMap, map_as_drawn: InverseMap) -> InverseMap:
    """Return ``made`` with the factors on alarm levels of the map as drawn, with the factors of its tables."""
    levelled = replace(
        made,
        chi_square_scale=map_as_drawn.chi_square_scale,
        outlier_scale=map_as_drawn.outlier_scale,
        level_slope=map_as_drawn.level_slope,
    )
    if made.manifold is None or map_as_drawn.manifold is None:
        return levelled
    tables = replace(
        made.manifold,
        chi_square_scale=map_as_drawn.manifold.chi_square_scale,
        outlier_scale=map_as_drawn.manifold.outlier_scale,
        shape_scale=map_as_drawn.manifold.shape_scale,
    )
    return replace(levelled, manifold=tables)


def _facts(
    estimate: Estimate, faults: tuple[Fault, ...], outside: OutsideModel, test_path: Path
) -> dict[str, Any]:
    """Return what the map's provenance says of the calibration."""
    part, sigma = estimate.parameters, estimate.std
    where = slices(part.counts)
    return {
        "test": test_path.name,
        "cases": [case.name for k, case in enumerate(estimate.model.test.cases) if estimate.used[k].any()],
        "readings": estimate.n_readings,
        "chi_square_per_reading": estimate.per_reading,
        "squared_distance_from_priors": estimate.from_priors,
        "faults": [fault.line for fault in faults],
        "outside_the_model": list(outside.lines),
        "remarks": list(remarks(estimate)),
        "changed_since": dict(estimate.model.test.changed),
        "mass_percent": round(100.0 * float(part.mass[0]), 4),
        "load_cell_percent": (100.0 * estimate.vector[estimate.model.entries["cell"][0]]).round(4).tolist(),
        "zero_um_per_m": (1e6 * part.zero).round(6).tolist(),
        "zero_std_um_per_m": (1e6 * sigma[where[ZERO]]).round(6).tolist(),
        "wall_thickness_percent": (100.0 * part.wall_thickness).round(4).tolist(),
        "sigma_before_over_after": {
            kind: float(
                np.sqrt(
                    np.mean(estimate.model.std[entries] ** 2) / max(float(np.mean(sigma[entries] ** 2)), 1e-300)
                )
            )
            for kind, entries in where.items()
            if estimate.model.std[entries].any()
        },
    }
