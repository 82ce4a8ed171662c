"""Three-dimensional structures in files: ``strainfmu structure``, and what goes to and from another code."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from builder.campaign.snapshot_fit import body_misfits
from builder.campaign.snapshots import load_snapshots
from builder.pipeline.map_files import solid_inputs
from builder.pipeline.pipeline import STRUCTURE
from builder.pipeline.progress_bars import AnyProgress, reporter_of
from builder.pipeline.stages import mesh_error_line
from builder.structure.external import load_export
from builder.structure.external.external_structure import external_structure, written_influence
from builder.structure.external.load_export import load_cases
from builder.structure.solid.case import structure_case
from builder.structure.solid.mesh_choice import MeshChoice
from builder.structure.solid.solid_model import holds_structure, update_structure
from builder.structure.structure_file import Structure, save_structure
from builder.vehicle.file import Vehicle, load_vehicle
from builder.vehicle.map_needs import used_layouts
from builder.workspace import Cache, Workspace, refuse_misfits
from strainfmu.errors import InputError


@dataclass(frozen=True, eq=False, kw_only=True)
class StructureRun:
    """A structure in its file, lines on what it holds, and whether it was up to date; None of another code's."""

    structure: Structure
    lines: tuple[str, ...]
    up_to_date: bool | None


def run_structure(
    vehicle: str | Path,
    output: str | Path = "structure.h5",
    *,
    resolution: str | None = None,
    solver: str | None = None,
    model: str = "swept",
    layouts: Sequence[str] | None = None,
    allow_locking: bool = False,
    mesh_unit: float = 1.0,
    by_position: bool = False,
    snapshots: str | Path | None = None,
    progress: AnyProgress = None,
) -> StructureRun:
    """Compute the strain of gauges per surface pressure by three-dimensional elasticity.

    The mesh is checked, described and tested for locking before anything is solved. A file that is up to date
    is not computed again, nor is one that another command left in the cache next to the vehicle file. After a
    change of gauges the mesh is not checked again.

    On the command line::

        strainfmu structure my_vehicle.toml -o structure.h5
        strainfmu structure my_vehicle.toml --resolution paper --layout configuration_1
        strainfmu structure my_vehicle.toml --model wall.msh --mesh-unit 0.001
        strainfmu structure my_vehicle.toml --export-loads loads --snapshots snapshots.h5

    Parameters
    ----------
    vehicle : vehicle file (TOML).
    output : file to write.
    resolution : "coarse", "medium" or "paper". Default: the vehicle file's.
    solver : solver. Default: by sectors on a swept mesh, else the fastest installed.
    model : mesh: "swept" hexahedra, "gmsh" for Gmsh's tetrahedra, or a file of a mesh.
    layouts : gauge layouts. Default: all that a map needs.
    allow_locking : go on with elements that lose over 10 % of the bending.
    mesh_unit : with ``model`` of a file: length of its unit [m]; 0.001 for mm.
    by_position : with ``model`` of a file: find its surfaces by position, not by name.
    snapshots : pressures of the load cases. Default: snapshots.h5 next to the output.
    progress : True for progress bars.

    Raises
    ------
    InputError
        A file is missing or wrong, or a mesh loses bending.
    """
    output, reporter = Path(output), reporter_of(progress)
    Workspace(output.parent)  # refuses a folder that cannot be written, before the long work
    with reporter.stage("Vehicle"):
        loaded = load_vehicle(vehicle)
        entry = loaded.structure.external
    if entry is not None:
        snapshots_path = Path(snapshots or output.parent / "snapshots.h5")
        return _of_another_code(loaded, _needed(snapshots_path, f"structure.{entry}"), output)
    with reporter.stage("Case"):
        choice = _mesh_choice(loaded, resolution, model, mesh_unit=mesh_unit, by_position=by_position)
        case = structure_case(loaded, list(layouts or used_layouts(loaded)), choice, solver, allow_locking)
    cache, inputs = Cache(loaded.beside(".")), solid_inputs(case)
    if not holds_structure(output, case) and (source := cache.take(STRUCTURE, inputs, output)):
        reporter.note(f"{output}: {source}, reused")
    made, up_to_date = update_structure(output, case, reporter)
    if not up_to_date:
        cache.add(STRUCTURE, inputs, output)
    return StructureRun(structure=made, lines=tuple(_report(made, loaded)), up_to_date=up_to_date)


def export_influence(
    vehicle: str | Path,
    export_influence: str | Path,
    *,
    layouts: Sequence[str] | None = None,
    solver: str | None = None,
    allow_locking: bool = False,
    progress: AnyProgress = None,
    **mesh: Any,
) -> tuple[str, ...]:
    """Write the strain per force at each outer node of a mesh to a file .h5; return a line on it.

    Parameters
    ----------
    vehicle, layouts, solver, allow_locking, progress : as :func:`run_structure` takes them; ``mesh`` has its other
        arguments.
    export_influence : file for the strain per force at each outer node. Not with ``export_loads``.
    """
    path = Path(export_influence)
    with reporter_of(progress).stage("Case"):
        loaded = load_vehicle(vehicle)
        choice = _mesh_choice(loaded, **mesh)
        case = structure_case(loaded, list(layouts or used_layouts(loaded)), choice, solver, allow_locking)
    if path.suffix.lower() not in (".h5", ".hdf5"):
        raise InputError(f"--export-influence: expected a file .h5, got {path}")
    influence = written_influence(case, loaded.gauges.layout, path)
    return (f"{path}: {len(influence.column)} gauges, forces at {len(influence.node)} nodes, written",)


def export_loads(
    vehicle: str | Path,
    export_loads: str | Path,
    load_format: str = "csv",
    *,
    snapshots: str | Path = "snapshots.h5",
) -> tuple[str, ...]:
    """Write the pressures of snapshots as load cases for another structural code; return lines on what to do.

    Parameters
    ----------
    vehicle : vehicle file (TOML).
    export_loads : folder for the snapshots' pressures as load cases. Not with ``export_influence``.
    load_format : with ``export_loads``: "csv", "vtu" (ParaView) or "bdf" (Nastran).
    snapshots : pressures of the load cases.

    Raises
    ------
    InputError
        A file is missing or wrong, or the snapshots are of another body.
    """
    folder, path, loaded = Path(export_loads), _needed(Path(snapshots), "--export-loads"), load_vehicle(vehicle)
    pressures = load_snapshots(path)
    refuse_misfits(path, body_misfits(pressures, loaded.body()))
    cases, layouts = load_cases(loaded, pressures), structure_case(loaded, used_layouts(loaded)).layouts
    files = load_export.export_loads(cases, layouts, loaded.gauges.layout, folder, load_format)
    counts = f"{folder}: {len(cases.names)} load cases on {len(cases.surface.point)} nodes, {len(files)} files"
    if load_format == load_export.NASTRAN:
        return (
            counts,
            f"run them as SUBCASEs, and name {files[-1]} and the results in the vehicle file: [structure]",
            "strain_per_snapshot, nastran_results, nastran_gauges",
        )
    return counts, f"fill in {files[-1]}, and name it in the vehicle file: [structure] strain_per_snapshot"


def _needed(path: Path, why: str) -> Path:
    """Return snapshots that are there; ``why`` says what needs them.

    Raises
    ------
    InputError
        There are none.
    """
    if not path.is_file():
        raise InputError(f"{path}: no such file; {why} needs snapshots: strainfmu snapshots VEHICLE -o {path}")
    return path


def _mesh_choice(
    vehicle: Vehicle,
    resolution: str | None = None,
    model: str = "swept",
    *,
    mesh_unit: float = 1.0,
    by_position: bool = False,
) -> MeshChoice:
    resolution = resolution or vehicle.structure.resolution
    return MeshChoice(source=model, resolution=resolution, unit=mesh_unit, by_position=by_position)


def _of_another_code(vehicle: Vehicle, snapshots: Path, output: Path) -> StructureRun:
    """Write the structure behind the file that the vehicle file names."""
    made = external_structure(vehicle, load_snapshots(snapshots))
    save_structure(made, output)
    lines = [
        f"layout {layout}: {len(made.gauges_of(layout))} gauges, {len(made.point)} pressure nodes"
        for layout in made.layouts
    ]
    lines.append(f"{output}: {made.model.replace('_', ' ')}, {made.size}, written")
    return StructureRun(structure=made, lines=tuple(lines), up_to_date=None)


def _report(made: Structure, vehicle: Vehicle) -> Iterator[str]:
    """Yield what a structure holds: the mesh, its locking, the solver, the gauges and their mesh error."""
    yield f"{made.vehicle}, {made.model.replace('_', ' ')}"
    yield report_text([(str(what), value, str(unit)) for what, value, unit in made.settings["mesh_report"]])
    ratios = ", ".join(f"cos({m} phi) {100.0 * r:.2f} %" for m, r in made.settings["locking"].items())
    yield f"bending of the wall kept (locking check): {ratios or 'none, a body without a cavity'}"
    used = made.statistics
    yield (
        f"solver {used['solver']}, licence {used['licence']}: relative residual {used['relative_residual']:.0e}, "
        f"of loads that move the whole body {used['probe_residual']:.0e}"
    )
    for layout in made.layouts:
        yield f"layout {layout}: {len(made.gauges_of(layout))} gauges, {len(made.point)} pressure nodes"
    noise = vehicle.noise.std_um_per_m
    yield mesh_error_line(made, None if noise is None else 1e-6 * noise)


def report_text(rows: Sequence[tuple[str, float, str]]) -> str:
    """Return rows as lines of text, values aligned, counts without decimals."""
    width = max(len(what) for what, _, _ in rows)
    texts = [f"{value:d}" if isinstance(value, int) else f"{value:.6g}" for _, value, _ in rows]
    lines = [f"{what:<{width}}  {text:>12} {unit}" for (what, _, unit), text in zip(rows, texts, strict=True)]
    return "\n".join(line.rstrip() for line in lines)
