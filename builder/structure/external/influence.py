"""Z_p from an influence matrix: strain per force at nodes times the nodal forces of a pressure on their facets."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from builder.aero.surface.mesh import SurfaceMesh
from builder.structure.external.gauge_columns import columns_found
from builder.structure.external.influence_checks import check_equilibrium
from builder.structure.external.influence_file import Influence, read_influence
from builder.structure.external.operator_of_file import structure_of_operator
from builder.structure.external.strain_table import SubcaseStrains
from builder.structure.external.thinned_nodes import thinned
from builder.structure.mesh_check import MeshCheck
from builder.structure.solid.gauge_rows import Gauges
from builder.structure.solid.surface_load import facet_pressure_load, facet_triangles, split_facets
from builder.structure.structure_file import Structure
from builder.vehicle.file import Vehicle
from strainfmu.errors import InputError

MODEL = "influence"


def structure_of_influence(
    path: Path,
    facets: Path | None,
    vehicle: Vehicle,
    layouts: Mapping[str, Gauges],
    results: SubcaseStrains | None = None,
) -> Structure:
    """Return the structure behind the influence matrix of ``path``, on the surface of its loaded nodes.

    What the number of loaded nodes does to strain is measured by leaving out two nodes of three.

    Parameters
    ----------
    path, facets : the file, and the file of the facets of a CSV file.
    vehicle : gives body and support.
    layouts : those a map needs; displaced ones may be missing.
    results : strains per subcase, where the file names subcases instead of strains.

    Raises
    ------
    InputError
        A file is wrong, does not fit the gauges, or its strains are out of equilibrium with its forces.
    """
    influence = read_influence(path, facets, results)
    kept = columns_found(path, influence.column, layouts, vehicle.gauges.layout)
    index = [influence.column.index(name) for names in kept.values() for name in names]
    strain = influence.strain_per_force[index]
    whole = _outward(influence)
    surface, column = split_facets(influence.node, influence.facet) if influence.split else (whole, None)
    if vehicle.structure.support == "clamped_aft":
        in_use = layouts[vehicle.gauges.layout]
        rows = [influence.column.index(name) for name in kept[vehicle.gauges.layout]]
        check_equilibrium(path, influence.node, influence.strain_per_force[rows], in_use)
    load = facet_pressure_load(influence.node, influence.facet, column)
    flat = strain.reshape(len(strain), -1)
    thin = thinned(whole)
    check = MeshCheck(
        against=f"forces on {thin.kept} of its {len(influence.node)} nodes",
        factor=thin.factor,
        strain_operator=np.asarray(thin.on_kept(strain).reshape(len(strain), -1) @ load),
    )
    return structure_of_operator(
        np.asarray(flat @ load),
        surface,
        {name: layouts[name] for name in kept},
        vehicle,
        model=MODEL,
        path=path,
        statistics={"loaded_nodes": len(influence.node)},
        check=check,
    )


def _outward(influence: Influence) -> SurfaceMesh:
    """Return the facets as triangles.

    Raises
    ------
    InputError
        The facets face inwards.
    """
    surface = SurfaceMesh(influence.node, facet_triangles(influence.facet))
    away = influence.node - np.array([1.0, 0.0, 0.0]) * influence.node[:, :1]
    middle = away[surface.triangle].mean(axis=1)
    if np.einsum("mi,mi->", surface.vector_area, middle) < 0.0:
        raise InputError(f"{influence.path}: facet: expected nodes anticlockwise seen from outside, got clockwise")
    return surface
