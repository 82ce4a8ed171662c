"""Derivatives of strain by position and direction of the gauges, roll of the layout, and wall thickness."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from builder.inverse.noise.model import central_difference
from builder.structure.fourier.gauges import PlacedGauges
from builder.structure.fourier.inner_surface import inner_surface_points
from builder.structure.fourier.model import StructuralModel, place_layouts, structural_model
from builder.structure.fourier.shell_mesh import shell_mesh, yielding_clamp
from builder.structure.fourier.strain_operator import harmonic_response, strain_operator
from builder.structure.mapped_structure import MappedStructure
from builder.structure.solid.gauges import displaced_gauges as displaced
from builder.structure.wall import wall_of
from builder.vehicle.file import Vehicle
from builder.vehicle.shape.geometry import SurfaceGrid
from strainfmu.arrays import FloatArray
from strainfmu.errors import InputError

STEP = 1e-3
"""Step of the differences: 1 mm along the surface, 1 mrad of direction."""

WALL_STEP = 0.01
"""Step of the wall's thickness, relative to it."""

CLAMP_STEP, RIGID = 2e-3, 1e-7
"""Length of wall that yields as the clamp does, for its slope, and one that counts as none [m]."""


@dataclass(frozen=True, eq=False)
class GaugeDerivatives:
    """Derivatives of Z_p (n_d, n_p).

    Attributes
    ----------
    axial, circumferential : by the gauge's position along the surface [1/(Pa m)].
    orientation : by the angle of its direction in the surface [1/(Pa rad)].
    layout_roll : by the roll angle of all gauges together [1/(Pa rad)].
    """

    axial: FloatArray
    circumferential: FloatArray
    orientation: FloatArray
    layout_roll: FloatArray


def gauge_derivatives(
    vehicle: Vehicle, structure: StructuralModel | MappedStructure, layout: str
) -> GaugeDerivatives:
    """Return the derivatives at the gauges of ``layout`` with the structural model of the map.

    Raises
    ------
    InputError
        A gauge lies within a step of the end of its surface, or the structure holds no displaced gauges.
    """
    if isinstance(structure, StructuralModel):
        return fourier_gauge_derivatives(vehicle, structure, layout)
    return solid_gauge_derivatives(structure, layout)


def solid_gauge_derivatives(structure: MappedStructure, layout: str) -> GaugeDerivatives:
    """Return the derivatives from the displaced gauges of :mod:`builder.structure.solid.gauges.displaced_gauges`.

    Raises
    ------
    InputError
        The structure holds no displaced gauges of ``layout``.
    """

    def of(how: str) -> FloatArray:
        name = displaced.displaced_name(layout, how)
        if name not in structure.operators:
            raise InputError(
                f"structure: layout '{name}' is missing, which noise.gauge_position_mm, gauge_orientation_deg and "
                "layout_roll_deg need; compute the structure again with the same vehicle file, or set them to 0"
            )
        return structure.strain_operator(name)

    along = central_difference(of(displaced.AFT), of(displaced.FORE), displaced.STEP)
    around = central_difference(of(displaced.AROUND), of(displaced.BACK), displaced.STEP)
    position = structure.layouts[layout].position
    return GaugeDerivatives(
        axial=along,
        circumferential=around,
        orientation=of(displaced.TURNED_AROUND) - of(displaced.TURNED_BACK),
        layout_roll=np.hypot(position[:, 1], position[:, 2])[:, None] * around,
    )


def wall_thickness_derivative(
    vehicle: Vehicle, structure: StructuralModel | MappedStructure, layout: str
) -> FloatArray:
    """Return the derivative of Z_p (n_d, n_p) by the relative wall thickness [1/Pa].

    By the semi-analytic model, which for a solid structure stands in with gauges at a point inside: what counts is
    how strain changes, and that follows from membrane and bending alike. On a surface without stations, with
    gauges off the wall, or of a structure of another code, strain goes with 1 / t.
    """
    surface = structure.surface
    foreign = isinstance(structure, MappedStructure) and structure.is_external
    if foreign or not isinstance(surface, SurfaceGrid):
        return -structure.strain_operator(layout)
    try:
        inside = _with_points_inside(vehicle, layout)
        thin, thick = (
            structural_model(with_wall(inside, factor), vehicle.resolution.map, [layout])
            for factor in (1.0 - WALL_STEP, 1.0 + WALL_STEP)
        )
    except InputError:
        return -structure.strain_operator(layout)
    placed = thin.placed[layout]
    after, before = (strain_operator(model.response, placed, surface) for model in (thick, thin))
    return central_difference(after, before, WALL_STEP)


def clamp_derivatives(
    vehicle: Vehicle, structure: StructuralModel | MappedStructure, layout: str
) -> tuple[FloatArray, FloatArray]:
    """Return the derivatives of Z_p (n_d, n_p) by the clamp's compliance along and across the body [1/(Pa m)].

    By the semi-analytic model, as :func:`wall_thickness_derivative`.

    Raises
    ------
    InputError
        The body is not one of revolution that is clamped aft.
    """
    surface = structure.surface
    if not isinstance(surface, SurfaceGrid):
        raise InputError("noise.clamp_compliance_mm: expected 0 but for a body of revolution that is clamped aft")
    inside, resolution = _with_points_inside(vehicle, layout), vehicle.resolution.map
    wall = wall_of(inside)
    mesh = shell_mesh(inside.body(), wall, 1e-3 * resolution.element_length_mm, resolution.wall_layers)
    placed = place_layouts(inside, mesh, [layout])[1][layout]

    def operator(axial: float, transverse: float) -> FloatArray:
        held = yielding_clamp(mesh, wall.material, axial, transverse)
        response = harmonic_response(held, wall.material, placed.x, surface.x, resolution.harmonics)
        return strain_operator(response, placed, surface)

    rigid = operator(RIGID, RIGID)
    along, across = operator(CLAMP_STEP, RIGID), operator(RIGID, CLAMP_STEP)
    return (along - rigid) / CLAMP_STEP, (across - rigid) / CLAMP_STEP


def with_wall(vehicle: Vehicle, factor: float) -> Vehicle:
    """Return the vehicle with a wall ``factor`` as thick."""
    changed = {
        "wall_thickness_mm": factor * vehicle.structure.wall_thickness_mm,
        "wall_thickness_at": [
            one.model_copy(update={"thickness_mm": factor * one.thickness_mm})
            for one in vehicle.structure.wall_thickness_at
        ],
    }
    return vehicle.model_copy(update={"structure": vehicle.structure.model_copy(update=changed)})


def _with_points_inside(vehicle: Vehicle, layout: str) -> Vehicle:
    """Return the vehicle with the gauges of ``layout`` at points on the inner surface."""
    entry = vehicle.gauges.layouts[layout]
    changed = {
        "rows": None
        if entry.rows is None
        else [row.model_copy(update={"surface": "inner", "length_mm": 0.0}) for row in entry.rows],
        "surface": None if entry.file is None else "inner",
        "length_mm": None,
    }
    layouts = {**vehicle.gauges.layouts, layout: entry.model_copy(update=changed)}
    return vehicle.model_copy(update={"gauges": vehicle.gauges.model_copy(update={"layouts": layouts})})


def fourier_gauge_derivatives(vehicle: Vehicle, structure: StructuralModel, layout: str) -> GaugeDerivatives:
    """Return the derivatives at the gauges of ``layout``, with the mesh and harmonics of the map.

    Raises
    ------
    InputError
        A gauge lies within a step of the end of the inner surface.
    """
    resolution, wall = vehicle.resolution.map, wall_of(vehicle)
    mesh = shell_mesh(vehicle.body(), wall, 1e-3 * resolution.element_length_mm, resolution.wall_layers)
    surface, placed = structure.surface, structure.placed[layout]
    at_gauge = inner_surface_points(mesh, placed.x)
    along_x, around = STEP * at_gauge.tangent[:, 0], STEP / at_gauge.radius
    stations = np.concatenate([placed.x - along_x, placed.x, placed.x + along_x])
    response = harmonic_response(mesh, wall.material, stations, surface.x, structure.response.max_harmonic)

    def difference(plus: PlacedGauges, minus: PlacedGauges) -> FloatArray:
        after, before = (strain_operator(response, gauges, surface) for gauges in (plus, minus))
        return central_difference(after, before, STEP)

    circumferential = difference(
        replace(placed, roll_angle=placed.roll_angle + around),
        replace(placed, roll_angle=placed.roll_angle - around),
    )
    return GaugeDerivatives(
        axial=difference(replace(placed, x=placed.x + along_x), replace(placed, x=placed.x - along_x)),
        circumferential=circumferential,
        orientation=difference(_turned(placed, STEP), _turned(placed, -STEP)),
        layout_roll=at_gauge.radius[:, None] * circumferential,
    )


def _turned(placed: PlacedGauges, angle: float) -> PlacedGauges:
    """Return the gauges with their directions turned by ``angle`` [rad] in the surface."""
    c, s = np.cos(angle), np.sin(angle)
    return replace(
        placed,
        meridional=c * placed.meridional - s * placed.circumferential,
        circumferential=s * placed.meridional + c * placed.circumferential,
    )
