"""Derivatives of the strain operator by errors of the vehicle as built, with the structural model of the map."""

from __future__ import annotations

from collections.abc import Callable, Collection

from builder.aero.surface.mesh import grid_of
from builder.structure.as_built.as_built_vehicle import AsBuilt, Counts, Key, as_drawn, parameter_derivatives
from builder.structure.as_built.displaced_structure import KNOWN, DisplacedGauges, ways_of
from builder.structure.as_built.revolved import SOLVED, RevolvedStructure, revolved_structure
from builder.structure.as_built.wall_regions import counts_in_flight
from builder.structure.as_built_kinds import BY_REGION, KINDS
from builder.structure.fourier.fourier_model import StructuralModel, structural_model_on
from builder.structure.mapped_structure import MappedStructure
from builder.structure.solid.gauge_layouts import displaced_name
from builder.vehicle.file import Vehicle
from strainfmu.arrays import FloatArray
from strainfmu.errors import InputError

WALL_STEP = 0.01
"""Step of the wall's thickness, relative to it."""

GAINS = ("gauge_gain", "common_gain")


def strain_derivatives(
    vehicle: Vehicle, structure: StructuralModel | MappedStructure, layout: str, keys: Collection[Key]
) -> dict[Key, FloatArray]:
    """Return the derivatives of Z_p (n_d, n_p) [1/Pa] by ``keys`` at the vehicle of the file, in their order.

    Raises
    ------
    InputError
        A gauge lies within a step of the end of its surface, the structure holds no displaced gauges, or the model
        has none of an error.
    """
    if isinstance(structure, StructuralModel):
        return _derivatives(of_model(vehicle, structure, layout, keys), keys)
    of_wall = [key for key in keys if key[0] in (*SOLVED, *BY_REGION) and key[0] != "axial_shift"]
    of_gauges = [key for key in keys if key not in of_wall]
    derivatives: dict[Key, FloatArray] = {}
    if of_wall:
        derivatives |= _wall_derivatives(vehicle, structure, layout, of_wall)
    strain = of_displaced(structure, layout, moved=any(key[0] not in GAINS for key in of_gauges))
    derivatives |= parameter_derivatives(strain, as_drawn(counts_of_layout(vehicle, structure, layout)), of_gauges)
    return {key: derivatives[key] for key in keys}


def _derivatives(model: RevolvedStructure, keys: Collection[Key]) -> dict[Key, FloatArray]:
    return parameter_derivatives(model.strain_operator, as_drawn(model.counts), list(keys))


def of_model(
    vehicle: Vehicle, structure: StructuralModel, layout: str, keys: Collection[Key]
) -> RevolvedStructure:
    """Return the semi-analytic model of the map, solved for ``keys``."""
    return revolved_structure(
        vehicle,
        layout,
        names=structure.layouts[layout].names,
        placed=structure.placed[layout],
        nominal=structure.response,
        surface=structure.surface,
        kinds={kind for kind, _ in keys},
        wall_step=WALL_STEP,
    )


def counts_of_layout(vehicle: Vehicle, structure: StructuralModel | MappedStructure, layout: str) -> Counts:
    """Return the numbers of what has errors of its own; errors as
    :func:`~builder.structure.as_built.wall_regions.counts_in_flight`."""
    return counts_in_flight(vehicle, DisplacedGauges(structure.layouts[layout].position).roll_angle)


def of_displaced(structure: MappedStructure, layout: str, moved: bool) -> Callable[[AsBuilt], FloatArray]:
    """Return Z_p (n_d, n_p) [1/Pa] of a vehicle as built, from the displaced gauges that ``structure`` holds.

    Raises
    ------
    InputError
        The structure holds no displaced gauges of ``layout``, and ``moved`` says that they are needed.
    """

    def strain_of(how: str) -> FloatArray:
        name = displaced_name(layout, how)
        if name not in structure.operators:
            raise InputError(
                f"structure: layout '{name}' is missing, which noise.gauge_position_mm, gauge_orientation_deg and "
                "layout_roll_deg need; compute the structure again with the same vehicle file, or set them to 0"
            )
        return structure.strain_operator(name)

    parts = ways_of(structure.strain_operator(layout), strain_of if moved else None).transpose(0, 2, 1)
    gauges = DisplacedGauges(structure.layouts[layout].position)
    return lambda as_built: gauges.as_built(parts, as_built).T


def _wall_derivatives(
    vehicle: Vehicle, structure: MappedStructure, layout: str, keys: Collection[Key]
) -> dict[Key, FloatArray]:
    """Return the derivatives by the wall and its support of a structure that is none of the semi-analytic model.

    That stands in with gauges at points inside: what counts is how strain changes, and that follows from membrane
    and bending alike. On a surface without stations, with gauges off the wall, or of a structure of another code,
    strain goes with 1 / t.

    Raises
    ------
    InputError
        The body is not one of revolution that is clamped aft, and an error is another than the thickness.
    """
    grid = grid_of(structure.surface)
    unknown_kind = next((kind for kind, _ in keys if kind not in KNOWN), None)
    if grid is not None and not (structure.is_external and unknown_kind is None):
        inside = _with_points_inside(vehicle, layout)
        try:
            model = structural_model_on(inside, grid, vehicle.resolution.map, [layout])
            return _derivatives(of_model(inside, model, layout, keys), keys)
        except InputError:
            if unknown_kind is not None:
                raise
    if unknown_kind is not None:
        entry = KINDS[unknown_kind].entry
        raise InputError(f"noise.{entry}: expected 0 but for a body of revolution that is clamped aft")
    counts = counts_of_layout(vehicle, structure, layout)
    return parameter_derivatives(of_displaced(structure, layout, moved=False), as_drawn(counts), list(keys))


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
