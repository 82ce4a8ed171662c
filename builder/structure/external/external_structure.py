"""The structure of another code, by the entry of the vehicle file that names its file."""

from __future__ import annotations

from hashlib import sha256
from pathlib import Path

from builder.campaign.snapshots import Snapshots
from builder.structure.external import strain_per_snapshot
from builder.structure.external.gauge_columns import columns_found
from builder.structure.external.influence import structure_of_influence
from builder.structure.external.influence_export import solved_influence
from builder.structure.external.influence_file import Influence, read_influence
from builder.structure.external.nastran.results import nastran_strains
from builder.structure.solid.case import solid_case, structure_case
from builder.structure.structure_file import Structure
from builder.vehicle.file import Vehicle
from builder.vehicle.map_needs import used_layouts
from strainfmu.errors import InputError


def external_inputs(vehicle: Vehicle) -> list[str]:
    """Return the content of the files of the structure.

    Raises
    ------
    InputError
        The file is missing.
    """
    entry = vehicle.structure
    named = [entry.influence_facets, entry.nastran_gauges, *entry.nastran_results]
    beside = [vehicle.beside(name) for name in named if name is not None]
    found = [path for path in beside if path.is_file()]
    return [sha256(path.read_bytes()).hexdigest() for path in (external_file(vehicle), *found)]


def external_file(vehicle: Vehicle) -> Path:
    """Return the path of the file of the structure.

    Raises
    ------
    InputError
        It is missing.
    """
    entry = vehicle.structure.external
    assert entry is not None
    path = vehicle.beside(getattr(vehicle.structure, entry))
    if not path.is_file():
        raise InputError(f"structure.{entry}: {path}: no such file")
    return path


def external_structure(vehicle: Vehicle, snapshots: Snapshots) -> Structure:
    """Return the structure behind the file that the vehicle file names, for the layouts its map needs.

    Raises
    ------
    InputError
        The file is missing or wrong, or does not fit snapshots or gauges.
    """
    layouts, path = solid_case(vehicle, used_layouts(vehicle)).layouts, external_file(vehicle)
    results = nastran_strains(vehicle, layouts)
    if vehicle.structure.external == strain_per_snapshot.MODEL:
        return strain_per_snapshot.structure_of_strains(path, vehicle, snapshots, layouts, results)
    named = vehicle.structure.influence_facets
    facets = None if named is None else vehicle.beside(named)
    return structure_of_influence(path, facets, vehicle, layouts, results)


def influence_of(vehicle: Vehicle) -> tuple[Influence, dict[str, tuple[str, ...]]]:
    """Return the strain per force of a mesh, or of a matrix of another code, and the columns of the layout in use
    and of its displaced gauges, as far as they are there.

    Raises
    ------
    InputError
        A file is missing or wrong.
    """
    entry, in_use = vehicle.structure, vehicle.gauges.layout
    if entry.external is None:
        case = structure_case(vehicle, [in_use])
        found, layouts = solved_influence(case, in_use, Path("structure")), case.layouts
    else:
        layouts = solid_case(vehicle, [in_use]).layouts
        facets = None if entry.influence_facets is None else vehicle.beside(entry.influence_facets)
        found = read_influence(external_file(vehicle), facets, nastran_strains(vehicle, layouts))
    return found, columns_found(found.path, found.column, layouts, in_use)
