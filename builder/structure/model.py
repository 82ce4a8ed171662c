"""One discretisation of a vehicle's structure: pressure nodes, gauges, and the strain each pressure causes.

:class:`StructuralModel` is semi-analytic; :func:`solid_case` says what the three-dimensional model is made of.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from builder.structure.fourier.gauges import PlacedGauges, place_gauges
from builder.structure.fourier.meridian_mesh import MeridianMesh
from builder.structure.fourier.shell_mesh import shell_mesh
from builder.structure.fourier.strain_operator import HarmonicResponse, harmonic_response, strain_operator
from builder.structure.gauge_placement import gauge_layout
from builder.structure.solid.displaced_gauges import displaced_gauges
from builder.structure.solid.gauge_layouts import solid_gauges
from builder.structure.solid.mesh_choice import MeshChoice
from builder.structure.solid.model import SolidCase, check_gauges_on_mesh
from builder.structure.solid.solid_mesh import SUPPORT
from builder.structure.solid.supports import Clamped, Foundation, Support
from builder.structure.wall import Material, Wall
from builder.vehicle.file import GaugeLayoutEntry, GaugeRow, Resolution, Vehicle
from builder.vehicle.gauge_layout import GaugeLayout
from builder.vehicle.geometry import SurfaceGrid, surface_grid
from strainfmu.arrays import FloatArray
from strainfmu.errors import InputError

Progress = Callable[[int, int], None]


@dataclass(frozen=True, eq=False)
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

    @property
    def description(self) -> str:
        return "fourier"

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
        A gauge is not on the inner surface, or the model cannot do what is asked for; the message names it.
    """
    refuse_beyond_fourier(vehicle, layouts)
    found = {name: gauge_layout(vehicle, name, mesh) for name in layouts}
    placed = {
        name: place_gauges(mesh, layout.position, layout.direction, layout.names) for name, layout in found.items()
    }
    return found, placed


def refuse_beyond_fourier(vehicle: Vehicle, layouts: list[str]) -> None:
    """Refuse what the Fourier model cannot do: other supports, gauges outside or of a length.

    Raises
    ------
    InputError
        Names the entry, and the model that can.
    """
    cannot = "the Fourier model cannot do that, structure.model = 'solid' and `strainfmu structure` can"
    support = vehicle.structure.support
    if support != "clamped_aft":
        raise InputError(f"structure.support: '{support}' found, {cannot}")
    for name in layouts:
        entry = vehicle.gauges.layouts[name]
        for where, one in _with_surface_and_length(name, entry):
            if one.surface == "outer":
                raise InputError(f"{where}.surface: 'outer' found, {cannot}")
            if one.length_mm:
                raise InputError(f"{where}.length_mm: {one.length_mm:g} found, {cannot}")


def _with_surface_and_length(
    name: str, entry: GaugeLayoutEntry
) -> list[tuple[str, GaugeLayoutEntry] | tuple[str, GaugeRow]]:
    """Return the parts of a layout that say surface and length, each with its place in the file."""
    where = f"gauges.layouts.{name}"
    if entry.rows is None:
        return [(where, entry)]
    return [(f"{where}.rows.{number}", row) for number, row in enumerate(entry.rows, start=1)]


def check_gauges(vehicle: Vehicle) -> dict[str, int]:
    """Place the gauges of every layout on a coarse mesh and return their number per layout.

    Raises
    ------
    InputError
        The wall does not fit the body, a gauge is not on its surface, or the model cannot do what is asked for.
    """
    names = list(vehicle.gauges.layouts)
    mesh = _gauge_mesh(vehicle)
    if vehicle.structure.model == "solid":
        gauges = {name: solid_gauges(vehicle, name, mesh) for name in names}
        check_gauges_on_mesh(vehicle.body(), wall_of(vehicle), gauges)
        return {name: len(one.name) for name, one in gauges.items()}
    found, _ = place_layouts(vehicle, mesh, names)
    return {name: len(layout.names) for name, layout in found.items()}


def _gauge_mesh(vehicle: Vehicle) -> MeridianMesh:
    """Return a coarse meridian mesh, on whose inner surface rows of gauges are laid."""
    try:
        return shell_mesh(vehicle.body(), wall_of(vehicle), 0.01 * vehicle.body().length)
    except InputError as error:
        raise InputError(f"structure: {error}") from error


def check_map_size(vehicle: Vehicle, n_gauges: int) -> None:
    """Refuse more modes than the gauges or the snapshots can carry.

    Raises
    ------
    InputError
        ``map.modes`` is too large.
    """
    conditions = len(vehicle.flight_conditions())
    most = min(n_gauges, conditions) - 1
    if vehicle.map.case == 1 and vehicle.map.modes > most:
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


def support_of(vehicle: Vehicle) -> Support | None:
    """Return what holds the vehicle, None in free flight."""
    entry = vehicle.structure
    if entry.support == "free_flight":
        return None
    if entry.support == "clamped_aft":
        return Clamped(SUPPORT)
    assert entry.foundation_normal_N_per_m3 is not None
    assert entry.foundation_tangential_N_per_m3 is not None
    return Foundation(SUPPORT, entry.foundation_normal_N_per_m3, entry.foundation_tangential_N_per_m3)


def solid_case(
    vehicle: Vehicle,
    layouts: list[str],
    mesh: MeshChoice | None = None,
    solver: str | None = None,
    allow_locking: bool = False,
) -> SolidCase:
    """Return what the three-dimensional model of a vehicle is made of, by default on a swept mesh.

    Where the section [noise] has position or orientation errors, the layout in use is there displaced as well.

    Raises
    ------
    InputError
        A layout does not exist or is wrong, or the wall does not fit the body.
    """
    known = vehicle.gauges.layouts
    for name in layouts:
        if name not in known:
            raise InputError(f"layout '{name}' found, must be one of {', '.join(known)}")
    rows_on = _gauge_mesh(vehicle)
    gauges = {name: solid_gauges(vehicle, name, rows_on) for name in dict.fromkeys(layouts)}
    in_use = vehicle.gauges.layout
    if vehicle.noise.moves_gauges and in_use in gauges:
        gauges |= displaced_gauges(in_use, gauges[in_use], vehicle.body())
    return SolidCase(
        vehicle=vehicle.name,
        body=vehicle.body(),
        wall=wall_of(vehicle),
        density=vehicle.material.density_kg_per_m3,
        support=support_of(vehicle),
        mesh=mesh or MeshChoice(resolution=vehicle.structure.resolution),
        layouts=gauges,
        solver=solver,
        allow_locking=allow_locking,
    )


def used_layouts(vehicle: Vehicle) -> list[str]:
    """Return the layouts a map needs: the one in use and the one its noise is measured on."""
    reference = vehicle.noise.of_layout or vehicle.gauges.layout
    return sorted({vehicle.gauges.layout, reference})
