"""The influence matrix of a mesh of ours, in the form that other codes' matrices are read in."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from builder.structure.external.influence_file import Influence, write_influence
from builder.structure.external.load_cases import strain_columns
from builder.structure.solid.case import SolidCase
from builder.structure.solid.nodal_loads import surface_nodes
from builder.structure.solid.solid_mesh import EXTERNAL
from builder.structure.solid.solid_model import strain_per_force


def solved_influence(case: SolidCase, in_use: str, path: Path) -> Influence:
    """Solve ``case`` under unit forces at the nodes of its external surface.

    ``in_use`` is the layout whose gauges go by their own names, ``path`` the name of the matrix.

    Raises
    ------
    InputError, StrainfmuError
        As :func:`builder.structure.solid.solid_model.solve_solid_structure`.
    """
    mesh, strain = strain_per_force(case)
    node = surface_nodes(mesh, EXTERNAL)
    columns = strain_columns(case.layouts, in_use)
    return Influence(
        path=path,
        node=mesh.node[node],
        facet=np.searchsorted(node, mesh.named_surface(EXTERNAL)),
        column=tuple(name for names in columns.values() for name in names),
        strain_per_force=strain,
        split=not mesh.is_swept,
    )


def export_influence(case: SolidCase, in_use: str, path: Path) -> Influence:
    """Write the matrix of :func:`solved_influence`; errors as there, or the file could not be written."""
    influence = solved_influence(case, in_use, path)
    write_influence(influence)
    return influence
