"""The structure of the independent model of a vehicle of any shape: another mesh than the map's."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from builder.aero.surface.mesh import SurfaceMesh
from builder.campaign.snapshots import Snapshots
from builder.reporting import Reporter
from builder.structure.as_built.displaced import DisplacedGauges, refuse_others, ways_of
from builder.structure.as_built.vehicle import Counts
from builder.structure.mapped_structure import mapped_operator
from builder.structure.mesh_check import MeshCheck
from builder.structure.solid.case import structure_case
from builder.structure.solid.free_case import FreeCase, flying_mesh
from builder.structure.solid.free_model import on_other_mesh
from builder.structure.solid.gauges.displaced_gauges import DISPLACED, displaced_name
from builder.structure.structure_file import Structure
from builder.vehicle.file import Vehicle
from strainfmu.arrays import FloatArray, IntArray
from strainfmu.errors import InputError

NO_SECOND_MESH = "structure.checked_by: entry is missing, a second mesh plays the vehicle in an independent model"


@dataclass(frozen=True, eq=False, kw_only=True)
class ShapeStructure:
    """Strain of the gauges in use on another mesh than the map's.

    Attributes
    ----------
    names : of the n_d gauges.
    position : (n_d, 3) [m].
    operator : (n_w, n_d, n_q) per pressure at the nodes of ``surface``, see
        :data:`~builder.structure.as_built.displaced.WAYS` [1/Pa, then 1/(Pa m) twice,
        1/Pa].
    surface : that carries the pressure.
    """

    names: tuple[str, ...]
    position: FloatArray
    operator: FloatArray
    surface: SurfaceMesh

    @cached_property
    def gauges(self) -> DisplacedGauges:
        return DisplacedGauges(self.position)

    @property
    def counts(self) -> Counts:
        """Numbers of what has errors of its own."""
        return Counts(gauge=len(self.names), row=int(self.gauges.row.max()) + 1)


def refuse_without_other_model(vehicle: Vehicle) -> None:
    """Refuse a vehicle of another shape than a profile that has no independent model, before anything is solved.

    Raises
    ------
    InputError
        Names the entry, and what it would need.
    """
    if vehicle.aerodynamics.engine == "table":
        raise InputError(
            "aerodynamics.engine: expected 'euler' or 'newtonian' for an independent model, got 'table', which "
            "holds the conditions of its manifest alone"
        )
    if vehicle.structure.external is not None:
        raise InputError(
            f"structure.{vehicle.structure.external}: expected none for an independent model, got another code's "
            "strains, of one mesh"
        )
    if vehicle.sensors is not None:
        raise InputError("sensors: expected none for an independent model of this shape, which has gauges alone")
    if vehicle.shape_kind == "surface" and vehicle.structure.checked_by is None:
        raise InputError(NO_SECOND_MESH)


def flying_structure(vehicle: Vehicle, known: Structure | None, reporter: Reporter) -> ShapeStructure:
    """Return the gauges in use on the mesh that plays the vehicle that flies.

    That of a body of sections is made finer than the map's; of a surface it is ``structure.checked_by``, whose
    strains are in ``known``, the structure of the map, if that was made with it.

    Raises
    ------
    InputError
        There is no second mesh.
    """
    if vehicle.shape_kind == "surface" and known is not None and known.check is not None:
        return structure_of_check(vehicle, known, known.check)
    layout = vehicle.gauges.layout
    case = structure_case(vehicle, [layout])
    assert isinstance(case, FreeCase)
    other = flying_mesh(vehicle) if vehicle.shape_kind == "sections" else case.other
    if other is None:
        raise InputError(NO_SECOND_MESH)
    with reporter.stage("Structure: the vehicle that flies") as progress:
        check = on_other_mesh(case, other, progress)
    ends = np.cumsum([len(one.name) for one in case.layouts.values()])
    found = {
        name: np.arange(end - len(one.name), end)
        for (name, one), end in zip(case.layouts.items(), ends.tolist(), strict=True)
    }
    gauges = case.layouts[layout]
    return _structure(vehicle, names=gauges.name, position=gauges.position, check=check, rows=found.__getitem__)


def structure_of_check(vehicle: Vehicle, known: Structure, check: MeshCheck) -> ShapeStructure:
    """Return the gauges in use on the mesh that ``known``, the structure of the map, was checked by."""
    own = known.gauges_of(vehicle.gauges.layout)
    return _structure(
        vehicle,
        names=tuple(known.gauge_names[i] for i in own),
        position=known.gauge_position[own],
        check=check,
        rows=known.gauges_of,
    )


def _structure(
    vehicle: Vehicle,
    *,
    names: tuple[str, ...],
    position: FloatArray,
    check: MeshCheck,
    rows: Callable[[str], IntArray],
) -> ShapeStructure:
    """Return the structure from ``check``, whose ``rows`` by name of layout hold gauges in place and displaced."""
    refuse_others(vehicle.noise)
    assert check.point is not None
    assert check.triangle is not None
    layout, operator = vehicle.gauges.layout, check.strain_operator
    moved = None
    if vehicle.noise.moves_gauges:
        moved = {how: operator[rows(displaced_name(layout, how))] for how in DISPLACED}.__getitem__
    return ShapeStructure(
        names=names,
        position=position,
        operator=ways_of(operator[rows(layout)], moved),
        surface=SurfaceMesh(check.point, check.triangle),
    )


def on_nodes_of(structure: ShapeStructure, snapshots: Snapshots) -> FloatArray:
    """Return the operator (n_w, n_d, n_p) of ``structure`` per pressure at the nodes of ``snapshots``.

    Raises
    ------
    InputError
        The surfaces of flow and structure do not coincide.
    """
    ways, n_d, n_q = structure.operator.shape
    flat = structure.operator.reshape(ways * n_d, n_q)
    return mapped_operator(flat, structure.surface, snapshots)[1].reshape(ways, n_d, -1)
