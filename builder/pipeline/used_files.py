"""Files on the way to a map that were not made by its build: used where they fit, refused where not.

``snapshots.h5`` and ``structure.h5`` of the folder that the build did not write itself are the user's: they are
used as they are, or refused in one line, and never written over unless ``rebuild`` is given.
"""

from __future__ import annotations

from pathlib import Path

from builder.campaign import snapshots as snapshots_file
from builder.campaign.failures import failed_conditions, missing_line
from builder.campaign.snapshot_fit import as_flown, flow_line, option_misfits, vehicle_misfits
from builder.campaign.snapshots import load_snapshots
from builder.pipeline.pipeline import FilesGiven, Pipeline
from builder.reporting import Reporter
from builder.structure import structure_file
from builder.structure.structure_file import load_structure
from builder.structure.structure_fit import on_solid_model, structure_line, structure_misfits
from builder.vehicle.file import Vehicle
from builder.workspace import Cache, Workspace, refuse_misfits
from strainfmu.errors import InputError
from strainfmu.files import content_hash_of, schema_of

SNAPSHOTS, STRUCTURE, MAP, FLOWS = "snapshots.h5", "structure.h5", "map.h5", "independent_flows.h5"
REPLACE = "make it again for this vehicle file, or --rebuild"


def open_pipeline(
    vehicle: Vehicle, folder: Path, reporter: Reporter, files_given: FilesGiven
) -> tuple[Pipeline, int]:
    """Return the pipeline of a folder with the user's files in it, and the number of flight conditions.

    Where a three-dimensional structure is used, the map is built on it, whatever ``structure.model`` says.

    Raises
    ------
    InputError
        A file is damaged, of another kind, or does not fit the vehicle; or the map there was made from files
        given by options that are not given now.
    """
    workspace = Workspace(folder, Cache(vehicle.beside(".")))
    pipeline = Pipeline(vehicle, workspace, reporter, files_given)
    _refuse_lost_options(workspace, files_given)
    structure = _users_file(
        workspace, STRUCTURE, structure_file.SCHEMA, files_given.structure, files_given.rebuild
    )
    if structure is not None:
        _use_structure(pipeline, structure)
    elif files_given.rebuild and vehicle.structure.model == "fourier" and workspace.holds_foreign(STRUCTURE):
        reporter.note(f"{STRUCTURE}: not used, the vehicle file's structure.model is fourier")
    snapshots = _users_file(
        workspace, SNAPSHOTS, snapshots_file.SCHEMA, files_given.snapshots, files_given.rebuild
    )
    if snapshots is None:
        return pipeline, len(vehicle.flight_conditions())
    return pipeline, _use_snapshots(pipeline, snapshots)


def _refuse_lost_options(workspace: Workspace, files_given: FilesGiven) -> None:
    before, now = workspace.files_given(MAP), files_given.as_text()
    lost = [f"{option} {path}" for option, path in before.items() if option not in now]
    if lost and not files_given.rebuild:
        raise InputError(
            f"{workspace.path(MAP)}: made with {' '.join(lost)}, not given now: give it again, or --rebuild"
        )


def _users_file(
    workspace: Workspace, name: str, schema: str, stated: str | Path | None, rebuild: bool
) -> Path | None:
    """Return the file to use that was not made here, None where it is to be made."""
    if stated is not None:
        return Path(stated)
    path = workspace.path(name)
    if not workspace.holds_foreign(name):
        return None
    damaged = False
    try:
        actual = schema_of(path)
    except InputError:
        actual, damaged = schema, True
    if actual != schema:
        raise InputError(f"{path}: expected a file of schema '{schema}', found '{actual}'; remove it")
    if rebuild or (workspace.knows(name) and (damaged or not _readable(path, name))):
        return None
    return path


def _readable(path: Path, name: str) -> bool:
    try:
        load_snapshots(path) if name == SNAPSHOTS else load_structure(path)
    except InputError:
        return False
    return True


def _use_snapshots(pipeline: Pipeline, path: Path) -> int:
    """Use a file of snapshots if it fits; return the number of its conditions."""
    vehicle, is_given = pipeline.vehicle, pipeline.files_given.snapshots is not None
    snapshots = load_snapshots(path)
    refuse_misfits(path, vehicle_misfits(snapshots, vehicle), "" if is_given else REPLACE)
    if not is_given:
        refuse_misfits(path, option_misfits(snapshots, vehicle), REPLACE)
    pipeline.use(SNAPSHOTS, path, content_hash_of(path, snapshots_file.SCHEMA, snapshots_file.SCHEMA_VERSION))
    pipeline.reporter.note(f"{path if is_given else SNAPSHOTS}: used as it is: {flow_line(snapshots)}")
    pipeline.flown = as_flown(pipeline.vehicle, snapshots)
    failed = failed_conditions(snapshots)
    if failed:
        pipeline.reporter.note(f"warning: {missing_line(failed, len(snapshots.condition))}")
    return len(snapshots.condition)


def _use_structure(pipeline: Pipeline, path: Path) -> None:
    """Use a file of a structure if it fits; the vehicle's model is the three-dimensional one from now on."""
    vehicle, is_given = pipeline.vehicle, pipeline.files_given.structure is not None
    structure = load_structure(path)
    solid = on_solid_model(vehicle)
    refuse_misfits(path, structure_misfits(structure, solid), "" if is_given else REPLACE)
    pipeline.vehicle = solid
    pipeline.use(STRUCTURE, path, content_hash_of(path, structure_file.SCHEMA, structure_file.SCHEMA_VERSION))
    instead = "" if vehicle.structure.model == "solid" else f" (the vehicle file: {vehicle.structure.model} model)"
    pipeline.reporter.note(
        f"{path if is_given else STRUCTURE}: used as it is: {structure_line(structure)}{instead}"
    )
