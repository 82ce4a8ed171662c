"""The structure around a strain operator that follows from a file of another structural code."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from builder.aero.surface.mesh import SurfaceMesh
from builder.structure.solid.gauge_rows import Gauges, gauge_fields
from builder.structure.structure_file import MeshCheck, Structure
from builder.vehicle.file import Vehicle
from builder.vehicle.shape.profile_entries import profile_record
from strainfmu.arrays import FloatArray
from strainfmu.version import __version__


def structure_of_operator(
    strain_operator: FloatArray,
    surface: SurfaceMesh,
    layouts: Mapping[str, Gauges],
    vehicle: Vehicle,
    *,
    model: str,
    path: Path,
    statistics: Mapping[str, int],
    check: MeshCheck | None = None,
) -> Structure:
    """Return the structure whose gauges ``layouts`` read ``strain_operator`` (k, n_p) [1/Pa] on ``surface``.

    ``model`` and ``path`` say where it is from; the file brings no mesh of ours, so ``mesh_error`` is 0.
    """
    return Structure(
        vehicle=vehicle.name,
        model=model,
        settings={
            "strainfmu_version": __version__,
            "mesh": {"model": model, "file_name": path.name},
            "profile": profile_record(vehicle.body()),
        },
        statistics=dict(statistics),
        **gauge_fields(layouts),
        point=surface.point,
        triangle=surface.triangle,
        normal=surface.node_normal,
        strain_operator=strain_operator,
        mesh_error=np.zeros(len(strain_operator)),
        check=check,
    )
