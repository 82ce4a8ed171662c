"""The semi-analytic model of a vehicle: gauges on the inner surface of its wall, and their strain per pressure.

Displacement of points on the inner surface per surface pressure, by the adjoint solves that give strain.
"""

from dataclasses import dataclass, replace

import numpy as np

from builder.reporting import Progress
from builder.structure.fourier.inner_surface import PlacedGauges, inner_surface_points, place_gauges
from builder.structure.fourier.meridian_mesh import MeridianMesh
from builder.structure.fourier.shell_mesh import meshed_wall
from builder.structure.fourier.strain_operator import (
    HarmonicResponse,
    harmonic_response,
    operator_in_roll,
    response_of_rows,
    strain_operator,
)
from builder.structure.gauge_placement import gauge_layout
from builder.structure.wall import Material
from builder.vehicle.file import Vehicle
from builder.vehicle.gauges.gauge_entries import GaugeLayoutEntry, GaugeRow, Gauges
from builder.vehicle.gauges.layout import GaugeLayout
from builder.vehicle.model_entries import Resolution
from builder.vehicle.shape.geometry import SurfaceGrid, surface_grid
from strainfmu.arrays import FloatArray
from strainfmu.errors import InputError

ERROR_HARMONICS = 6
"""Highest harmonic that the error of the mesh is measured in."""

CANNOT = "the Fourier model cannot do that, structure.model = 'solid' and `strainfmu structure` can"


@dataclass(frozen=True, eq=False, kw_only=True)
class StructuralModel:
    """Strain per pressure of every gauge of the requested layouts.

    Attributes
    ----------
    surface : the pressure nodes.
    response : strain per harmonic of the pressure at every gauge station.
    layouts, placed : per layout name, the gauges in body axes and on the inner surface.
    error : strain per harmonic that longer elements add, as much as these are off; None where it is not known.
    """

    surface: SurfaceGrid
    response: HarmonicResponse
    layouts: dict[str, GaugeLayout]
    placed: dict[str, PlacedGauges]
    error: HarmonicResponse | None = None

    checked_against = "the same model on elements twice as long"

    @property
    def description(self) -> str:
        return "fourier"

    def strain_operator(self, layout: str) -> FloatArray:
        """Return Z_p (n_d, n_p) [1/Pa] of a layout."""
        return strain_operator(self.response, self.placed[layout], self.surface)

    def error_operator(self, layout: str) -> FloatArray | None:
        """Return the error (n_d, n_p) [1/Pa] by the mesh, None where it is not known."""
        return None if self.error is None else strain_operator(self.error, self.placed[layout], self.surface)


def structural_model(
    vehicle: Vehicle, resolution: Resolution, layouts: list[str], progress: Progress | None = None
) -> StructuralModel:
    """Mesh the wall, place the gauges and solve for their strain per harmonic of the pressure.

    Raises
    ------
    InputError
        The wall does not fit the body or a gauge is not on the inner surface.
    """
    surface = surface_grid(vehicle.body(), *resolution.surface_nodes)
    return structural_model_on(vehicle, surface, resolution, layouts, progress)


def structural_model_on(
    vehicle: Vehicle,
    surface: SurfaceGrid,
    resolution: Resolution,
    layouts: list[str],
    progress: Progress | None = None,
) -> StructuralModel:
    """Return :func:`structural_model` with other pressure nodes than ``resolution`` has."""
    walled = meshed_wall(vehicle, resolution)
    mesh = walled.mesh()
    found_layouts, placed = place_layouts(vehicle, mesh, layouts)
    stations = np.concatenate([gauges.x for gauges in placed.values()])
    harmonics = min(resolution.harmonics, (surface.n_roll - 1) // 2)
    response = harmonic_response(mesh, walled.wall.material, stations, surface.x, harmonics, progress)
    return StructuralModel(surface=surface, response=response, layouts=found_layouts, placed=placed)


def with_mesh_error(model: StructuralModel, vehicle: Vehicle, resolution: Resolution) -> StructuralModel:
    """Return ``model``, made at ``resolution``, with its error: half of what elements twice as long add.

    Low harmonics alone, which bend the wall. With errors in proportion to the length's square it would be a third;
    the longer elements may be too long for that.
    """
    longer = 2.0 * resolution.element_length_mm
    coarse = resolution.model_copy(
        update={"element_length_mm": longer, "harmonics": min(ERROR_HARMONICS, resolution.harmonics)}
    )
    coarse_response = structural_model_on(vehicle, model.surface, coarse, list(model.layouts)).response
    count = coarse_response.max_harmonic + 1

    def of(name: str) -> FloatArray:
        difference: FloatArray = (getattr(coarse_response, name) - getattr(model.response, name)[:, :count]) / 2.0
        return difference

    error = HarmonicResponse(
        gauge_x=coarse_response.gauge_x, meridional=of("meridional"), hoop=of("hoop"), shear=of("shear")
    )
    return replace(model, error=error)


def place_layouts(
    vehicle: Vehicle, mesh: MeridianMesh, layouts: list[str]
) -> tuple[dict[str, GaugeLayout], dict[str, PlacedGauges]]:
    """Return the gauges of each layout in body axes and on the inner surface of ``mesh``.

    Raises
    ------
    InputError
        A gauge is not on the inner surface, or the model cannot do what is requested; the message names it.
    """
    refuse_beyond_fourier(vehicle, layouts)
    layouts_by_name = {
        name: gauge_layout(vehicle.gauges.layouts[name], vehicle.beside(""), name, mesh) for name in layouts
    }
    placed = {
        name: place_gauges(mesh, layout.position, layout.direction, layout.names)
        for name, layout in layouts_by_name.items()
    }
    return layouts_by_name, placed


def refuse_beyond_fourier(vehicle: Vehicle, layouts: list[str]) -> None:
    """Refuse what the Fourier model cannot do: another shape than a profile, gauges outside or of a length.

    Raises
    ------
    InputError
        Names the entry, and the model that can.
    """
    vehicle.body()
    refuse_gauges_beyond_fourier(vehicle.gauges, layouts)


def refuse_gauges_beyond_fourier(gauges: Gauges, layouts: list[str]) -> None:
    """Refuse gauges that the Fourier model cannot do: outside or of a length.

    Raises
    ------
    InputError
        Names the entry, and the model that can.
    """
    for name in layouts:
        entry = gauges.layouts[name]
        for where, part in _with_surface_and_length(name, entry):
            if part.surface == "outer":
                raise InputError(f"{where}.surface: 'outer' found, {CANNOT}")
            if part.length_mm:
                raise InputError(f"{where}.length_mm: {part.length_mm:g} found, {CANNOT}")


def _with_surface_and_length(
    name: str, entry: GaugeLayoutEntry
) -> list[tuple[str, GaugeLayoutEntry] | tuple[str, GaugeRow]]:
    """Return the parts of a layout that have surface and length, each with its entry in the file."""
    where = f"gauges.layouts.{name}"
    if entry.rows is None:
        return [(where, entry)]
    return [(f"{where}.rows.{number}", row) for number, row in enumerate(entry.rows, start=1)]


@dataclass(frozen=True, eq=False, kw_only=True)
class SurfaceTargets:
    """Points of the inner surface whose displacement along a direction is read.

    Attributes
    ----------
    x, roll_angle : (n,) stations [m] and roll angles [rad].
    direction : (n, 3) unit vectors, body axes.
    """

    x: FloatArray
    roll_angle: FloatArray
    direction: FloatArray


def displacement_rows(mesh: MeridianMesh, x: FloatArray) -> FloatArray:
    """Return (n, 3, n_dof) [1]: axial, radial, circumferential displacement at stations ``x`` (n,) [m].

    The same for every harmonic: the first two go as cos(m phi), the last, towards growing roll angle, as sin.
    """
    point = inner_surface_points(mesh, x)
    rows = np.zeros((len(x), 3, len(mesh.node), 3))
    for component in range(3):
        rows[np.arange(len(x))[:, None], component, point.node, component] = point.value
    return rows.reshape(len(x), 3, mesh.n_dof)


def displacement_operator(
    mesh: MeridianMesh, material: Material, targets: SurfaceTargets, grid: SurfaceGrid, max_harmonic: int
) -> FloatArray:
    """Return (n, n_p) [m/Pa], displacement of ``targets`` per pressure at the nodes of ``grid``.

    Errors are as in :func:`builder.structure.fourier.strain_operator.harmonic_response`.
    """
    rows = displacement_rows(mesh, targets.x)
    response = response_of_rows(mesh, material, lambda _: rows, grid.x, max_harmonic)
    axial, radial, around = response.reshape(len(targets.x), 3, *response.shape[1:]).transpose(1, 0, 2, 3)
    sin, cos = np.sin(targets.roll_angle), np.cos(targets.roll_angle)
    along_x, along_y, along_z = targets.direction.T
    outward, tangential = along_y * sin + along_z * cos, along_y * cos - along_z * sin
    even = along_x[:, None, None] * axial + outward[:, None, None] * radial
    return operator_in_roll(even, tangential[:, None, None] * around, targets.roll_angle, grid)
