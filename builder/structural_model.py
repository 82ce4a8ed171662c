"""One discretisation of a vehicle's structure: pressure nodes, gauges, and the strain each pressure causes."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from builder.gauge_layout import GaugeLayout, gauge_layout
from builder.geometry import SurfaceGrid, surface_grid
from builder.structure.fourier.gauges import PlacedGauges, place_gauges
from builder.structure.fourier.meridian_mesh import MeridianMesh
from builder.structure.fourier.shell_mesh import shell_mesh
from builder.structure.fourier.strain_operator import HarmonicResponse, harmonic_response, strain_operator
from builder.structure.wall import Material, Wall
from builder.vehicle import Resolution, Vehicle
from strainfmu.errors import InputError

FloatArray = NDArray[np.float64]
Progress = Callable[[int, int], None]


@dataclass(frozen=True)
class StructuralModel:
    """Strain per pressure of every gauge of the layouts asked for.

    Attributes
    ----------
    surface : the pressure nodes.
    response : strain per harmonic of the pressure at every gauge station.
    layouts, placed : per layout name, the gauges in body axes and on the inner surface.
    """

    surface: SurfaceGrid
    response: HarmonicResponse
    layouts: dict[str, GaugeLayout]
    placed: dict[str, PlacedGauges]

    def strain_operator(self, layout: str) -> FloatArray:
        """Return Z_p (n_d, n_p) [1/Pa] of a layout."""
        return strain_operator(self.response, self.placed[layout], self.surface)


def wall_of(vehicle: Vehicle) -> Wall:
    """Return the wall and its material."""
    material = Material(1e9 * vehicle.material.youngs_modulus_GPa, vehicle.material.poisson_ratio)
    return Wall(1e-3 * vehicle.structure.wall_thickness_mm, vehicle.structure.solid_tip_length_m, material)


def place_layouts(
    vehicle: Vehicle, mesh: MeridianMesh, layouts: list[str]
) -> tuple[dict[str, GaugeLayout], dict[str, PlacedGauges]]:
    """Return the gauges of each layout in body axes and on the inner surface of ``mesh``.

    Raises
    ------
    InputError
        A gauge is not on the inner surface; the message names it.
    """
    found = {name: gauge_layout(vehicle, name, mesh) for name in layouts}
    placed = {
        name: place_gauges(mesh, layout.position, layout.direction, layout.names) for name, layout in found.items()
    }
    return found, placed


def check_gauges(vehicle: Vehicle) -> dict[str, int]:
    """Place the gauges of every layout on a coarse mesh and return their number per layout.

    Raises
    ------
    InputError
        The wall does not fit the body or a gauge is not on the inner surface.
    """
    try:
        mesh = shell_mesh(vehicle.body(), wall_of(vehicle), 0.01 * vehicle.body().length)
    except InputError as error:
        raise InputError(f"structure: {error}") from error
    found, _ = place_layouts(vehicle, mesh, list(vehicle.gauges.layouts))
    return {name: len(layout.names) for name, layout in found.items()}


def check_map_size(vehicle: Vehicle, n_gauges: int) -> None:
    """Refuse more modes than the gauges or the snapshots can carry.

    Raises
    ------
    InputError
        ``map.modes`` is too large.
    """
    conditions = len(vehicle.flight_conditions())
    most = min(n_gauges, conditions) - 1
    if vehicle.map.modes > most:
        raise InputError(
            f"map.modes: {vehicle.map.modes} found, at most {most} allowed with {n_gauges} gauges and "
            f"{conditions} conditions"
        )


def structural_model(
    vehicle: Vehicle, resolution: Resolution, layouts: list[str], progress: Progress | None = None
) -> StructuralModel:
    """Mesh the wall, place the gauges and solve for their strain per harmonic of the pressure.

    Raises
    ------
    InputError
        The wall does not fit the body or a gauge is not on the inner surface.
    """
    body = vehicle.body()
    wall = wall_of(vehicle)
    mesh = shell_mesh(body, wall, 1e-3 * resolution.element_length_mm, resolution.wall_layers)
    surface = surface_grid(body, resolution.surface_stations, resolution.surface_roll_angles)
    found, placed = place_layouts(vehicle, mesh, layouts)
    stations = np.concatenate([gauges.x for gauges in placed.values()])
    response = harmonic_response(mesh, wall.material, stations, surface.x, resolution.harmonics, progress)
    return StructuralModel(surface, response, found, placed)


def used_layouts(vehicle: Vehicle) -> list[str]:
    """Return the layouts a map needs: the one in use and the one its noise is measured on."""
    reference = vehicle.noise.of_layout or vehicle.gauges.layout
    return sorted({vehicle.gauges.layout, reference})
