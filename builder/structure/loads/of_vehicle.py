"""The structure of a vehicle file, solved for the gauges of a layout, ready for known loads."""

from __future__ import annotations

from dataclasses import replace

from builder.reporting import Progress
from builder.structure.fourier.fourier_model import refuse_gauges_beyond_fourier
from builder.structure.fourier.meridian_mesh import NO_NODES
from builder.structure.fourier.ring_gauges import place_gauges
from builder.structure.fourier.shell_mesh import shell_mesh
from builder.structure.fourier.wall_layup import other_densities
from builder.structure.gauge_placement import gauge_layout
from builder.structure.loads.fourier import MAX_HARMONIC, FourierStructure, fourier_structure
from builder.structure.loads.loaded_structure import LoadProperties
from builder.structure.wall import wall_of
from builder.vehicle.file import Vehicle
from builder.vehicle.model_entries import Resolution
from strainfmu.errors import InputError


def fourier_structure_of(
    vehicle: Vehicle,
    layout: str,
    resolution: Resolution | None = None,
    properties: LoadProperties | None = None,
    max_harmonic: int = MAX_HARMONIC,
    progress: Progress | None = None,
) -> FourierStructure:
    """Return the semi-analytic model of a vehicle, held or in free flight as its file says.

    Parameters
    ----------
    vehicle, layout : the vehicle and the name of one of its layouts.
    resolution : mesh; by default the resolution of the vehicle's map.
    properties : what loads need; the density of the vehicle file by default.
    max_harmonic : highest harmonic in roll angle; concentrated loads need more of them than air loads.
    progress : called with (harmonics done, harmonics in all).

    Raises
    ------
    InputError
        The layout does not exist, the wall does not fit the body, or the Fourier model cannot do the support or a
        gauge.
    """
    if layout not in vehicle.gauges.layouts:
        raise InputError(f"layout '{layout}' found, must be one of {', '.join(vehicle.gauges.layouts)}")
    refuse_gauges_beyond_fourier(vehicle, [layout])
    resolution = resolution or vehicle.resolution.map
    wall = wall_of(vehicle)
    mesh = shell_mesh(vehicle.body(), wall, 1e-3 * resolution.element_length_mm, resolution.wall_layers)
    gauges = gauge_layout(vehicle, layout, mesh)
    if vehicle.structure.support == "free_flight":
        mesh = replace(mesh, clamped_node=NO_NODES)
    return fourier_structure(
        mesh=mesh,
        material=wall.material,
        gauges=place_gauges(mesh, gauges.position, gauges.direction, gauges.names),
        properties=properties or load_properties(vehicle),
        max_harmonic=max_harmonic,
        progress=progress,
    )


def load_properties(vehicle: Vehicle) -> LoadProperties:
    """Return the density of the wall's material; of a body of revolution of regions and frames, too."""
    others = other_densities(wall_of(vehicle)) if vehicle.is_of_revolution else ()
    return LoadProperties(density=vehicle.material.density_kg_per_m3, other_densities=others)
