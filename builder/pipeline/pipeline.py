"""A pipeline of stages from file to file in one folder: a file that is up to date is not made again.

Files on the way to a map that were not made by its build: used where they fit, refused where not.

``snapshots.h5`` and ``structure.h5`` of the folder that the build did not write itself are the user's: they are
used as they are, or refused in one line, and never written over unless ``rebuild`` is given.
"""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from builder.campaign import snapshots as snapshots_file
from builder.campaign.failures import failed_conditions, missing_line
from builder.campaign.snapshot_fit import as_flown, flow_line, option_misfits, vehicle_misfits
from builder.campaign.snapshots import Snapshots, load_snapshots
from builder.inverse.problem import AnyStructure
from builder.inverse.solution import Problem
from builder.reporting import Reporter
from builder.structure import structure_file
from builder.structure.structure_file import load_structure
from builder.structure.structure_fit import on_solid_model, structure_line, structure_misfits
from builder.truth.true_structure import TrueStructure
from builder.vehicle.file import Vehicle
from builder.workspace import Cache, Workspace, refuse_misfits
from strainfmu.errors import InputError
from strainfmu.files import content_hash_of, schema_of


@dataclass(frozen=True, kw_only=True)
class FilesGiven:
    """What the user says of the files on the way.

    Attributes
    ----------
    snapshots, structure : files to use, from anywhere; None for the files of the folder.
    rebuild : make the files of the folder by the vehicle file, whatever options those there were made with.
    """

    snapshots: str | Path | None = None
    structure: str | Path | None = None
    rebuild: bool = False

    def as_text(self) -> dict[str, str]:
        """Return the files to use, by the option that gives them."""
        named = {"--snapshots": self.snapshots, "--structure": self.structure}
        return {option: str(path) for option, path in named.items() if path is not None}


class Pipeline:
    """The files made so far, and the means to make the next.

    ``elsewhere`` holds files that are used and were not made here, by name; ``flown`` is the vehicle with the
    engine and the conditions of such snapshots.
    """

    def __init__(
        self, vehicle: Vehicle, workspace: Workspace, reporter: Reporter, files_given: FilesGiven | None = None
    ) -> None:
        self.vehicle, self.workspace, self.reporter = vehicle, workspace, reporter
        self.files_given = files_given or FilesGiven()
        self.elsewhere: dict[str, Path] = {}
        self.flown: Vehicle | None = None
        self.files: dict[str, str] = {}
        self.reused: list[str] = []
        self.map_parts: tuple[Snapshots, AnyStructure] | None = None
        self.problem: Problem | None = None
        self.true_structure: TrueStructure | None = None

    def path(self, name: str) -> Path:
        """Return where the file ``name`` is: the one used, or the folder's."""
        return self.elsewhere.get(name, self.workspace.path(name))

    def use(self, name: str, path: Path, made_from: str) -> None:
        """Take ``path`` as the file ``name``; ``made_from`` identifies its content."""
        self.elsewhere[name] = path
        self.workspace.use(name, made_from)

    def take(self, name: str, holds: str) -> bool:
        """Return whether the file ``name`` is one that was not made here, and list it if so."""
        if name not in self.elsewhere:
            return False
        self.reused.append(name)
        self.files[name] = holds
        return True

    def make(
        self,
        name: str,
        holds: str,
        inputs: dict[str, Any],
        write: Callable[[Path], object],
        files_given: dict[str, str] | None = None,
        *,
        shared: bool = False,
    ) -> None:
        """Make the file ``name`` with ``write(path)``, or reuse it, if ``shared`` any command's; report that."""
        if where := self.workspace.ensure(name, inputs, write, files_given, shared=shared):
            self.reused.append(name)
            self.reporter.note(f"{name}: {where}, reused")
        self.files[name] = holds

    def made_from(self, *names: str) -> list[str]:
        """Return what each of ``names`` was made from, to be an input of the next file."""
        return [self.workspace.made_from(name) for name in names]

    def inputs(self, *names: str, **more: Any) -> dict[str, Any]:
        """Return what files are made from by their names without suffix, and ``more``: inputs of the next file."""
        return {**{Path(name).stem: self.made_from(name) for name in names}, **more}


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
