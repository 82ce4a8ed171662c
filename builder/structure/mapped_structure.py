"""The solid model's strain per pressure, brought to the pressure nodes of snapshots."""

from dataclasses import dataclass, field, replace

import numpy as np

from builder.aero.mapping_report import MappingTolerances, check_mapping, mapping_report
from builder.aero.pressure_map import pressure_map
from builder.aero.surface.mesh import SurfaceMesh, mesh_of_grid
from builder.campaign.snapshots import Snapshots
from builder.structure.structure_file import Structure
from builder.vehicle.gauges.layout import GaugeLayout
from builder.vehicle.shape.geometry import SurfaceGrid
from strainfmu.arrays import FloatArray
from strainfmu.errors import InputError

ROLL_REFINEMENT = 4

TOLERANCES_OF_CHECK = MappingTolerances(
    gap_relative=8e-3, area_mismatch=0.08, force_residual_relative=0.08, moment_residual_relative=0.02
)
"""Four times the usual ones: a mesh that another is compared with may have elements of twice the size, and chords
of twice the length lie four times as deep. What that changes of strain is part of the mesh error."""


@dataclass(frozen=True, eq=False, kw_only=True)
class MappedStructure:
    """Strain of a three-dimensional structure per pressure at the nodes of snapshots.

    Attributes
    ----------
    surface : the snapshots' nodes.
    description : the structure's model and resolution.
    layouts : per layout name, the gauges in body axes.
    operators : per layout name Z_p H (n_d, n_p) [1/Pa], with H the interpolation from the snapshots' surface.
    error_operators : per layout name the error (n_d, n_p) [1/Pa] by the mesh: strain by another discretisation
        less strain by this one; empty where there is no other.
    checked_against : name of the other discretisation.
    is_external : whether another structural code made it, so that the vehicle file's wall is not its wall.
    """

    surface: SurfaceGrid | SurfaceMesh
    description: str
    layouts: dict[str, GaugeLayout]
    operators: dict[str, FloatArray]
    error_operators: dict[str, FloatArray] = field(default_factory=dict)
    checked_against: str = ""
    is_external: bool = False

    def strain_operator(self, layout: str) -> FloatArray:
        """Return Z_p H (n_d, n_p) [1/Pa] of a layout."""
        return self.operators[layout]

    def error_operator(self, layout: str) -> FloatArray | None:
        """Return the error (n_d, n_p) [1/Pa] by the mesh, None where it is not known."""
        return self.error_operators.get(layout)


def mapped_structure(structure: Structure, snapshots: Snapshots) -> MappedStructure:
    """Refer a three-dimensional structure to the nodes of snapshots, as :func:`mapped_operator` does.

    Raises
    ------
    InputError
        The two surfaces do not coincide; the message gives the distance and what was probably meant.
    """
    surface, operator = mapped_operator(structure.strain_operator, structure.surface, snapshots)
    index = {name: structure.gauges_of(name) for name in structure.layouts}
    error = _error_operator(structure, snapshots, operator)
    return MappedStructure(
        surface=surface,
        description=f"{structure.model}, {structure.size}",
        layouts={
            name: GaugeLayout(
                tuple(structure.gauge_names[i] for i in gauges),
                structure.gauge_position[gauges],
                structure.gauge_direction[gauges],
            )
            for name, gauges in index.items()
        },
        operators={name: operator[gauges] for name, gauges in index.items()},
        error_operators={} if error is None else {name: error[gauges] for name, gauges in index.items()},
        checked_against="" if structure.check is None else structure.check.against,
        is_external=structure.is_external,
    )


def _error_operator(structure: Structure, snapshots: Snapshots, operator: FloatArray) -> FloatArray | None:
    """Return the difference of the structure's check from it, (n_d, n_p) [1/Pa] at the snapshots' nodes."""
    check = structure.check
    if check is None:
        return None
    surface = structure.surface
    if check.point is not None and check.triangle is not None:
        surface = SurfaceMesh(check.point, check.triangle)
    _, of_check = mapped_operator(check.strain_operator, surface, snapshots, TOLERANCES_OF_CHECK)
    return check.factor * (of_check - operator)


def mapped_operator(
    strain_operator: FloatArray,
    target: SurfaceMesh,
    snapshots: Snapshots,
    tolerances: MappingTolerances | None = None,
) -> tuple[SurfaceGrid | SurfaceMesh, FloatArray]:
    """Return the snapshots' surface and Z_p H (n_d, n_p) [1/Pa], strain per pressure at its nodes.

    Each node of the structure's surface takes the pressure of its closest point on the snapshots' surface
    (:func:`builder.aero.pressure_map.consistent_map`). Where their nodes are stations times roll angles,
    pressure is trigonometric in roll; a refined grid carries it there first, since linear interpolation over an
    angle h reduces harmonic m by (m h)^2 / 12. Where both surfaces are the same nothing is mapped.

    Parameters
    ----------
    strain_operator : (n_d, n_q) Z_p [1/Pa] per pressure at the nodes of ``target``.
    target : the structure's surface.
    snapshots : pressure on their own surface.
    tolerances : of the mapping; None for the default ones.

    Raises
    ------
    InputError
        The two surfaces do not coincide; the message gives the distance and what was probably meant.
    """
    grid = snapshots.grid
    if target.digest() == snapshots.surface.digest():
        return snapshots.surface if grid is None else grid, strain_operator
    ambient = np.array([condition.ambient_pressure for condition in snapshots.conditions()])[:, None]
    net = snapshots.pressure - ambient
    if grid is None:
        source, carried = snapshots.surface, net
    else:
        source = mesh_of_grid(replace(grid, n_roll=ROLL_REFINEMENT * grid.n_roll))
        carried = (grid.as_map(net) @ _roll_interpolation(grid.n_roll).T).reshape(len(net), -1)
    transfer = pressure_map(source, target)
    try:
        check_mapping(mapping_report(transfer, source, target, carried), tolerances or MappingTolerances())
    except InputError as error:
        raise InputError(f"structure: {error}") from error
    operator = strain_operator @ transfer.interpolation
    if grid is None:
        return source, operator
    by_ring = operator.reshape(len(operator), len(grid.x), -1)
    return grid, (by_ring @ _roll_interpolation(grid.n_roll)).reshape(len(operator), -1)


def mapped_fields(fields: FloatArray, target: SurfaceMesh, snapshots: Snapshots) -> FloatArray:
    """Return ``fields`` (n_p, k) at the nodes of snapshots of any shape, at the nodes (n_q, k) of ``target``.

    The surfaces coincide, as :func:`mapped_operator` has checked.
    """
    if target.digest() == snapshots.surface.digest():
        return fields
    return np.asarray(pressure_map(snapshots.surface, target).interpolation @ fields)


def _roll_interpolation(n_roll: int) -> FloatArray:
    """Return (ROLL_REFINEMENT * n_roll, n_roll): the trigonometric interpolant at finer roll angles."""
    spectrum = np.fft.rfft(np.eye(n_roll), axis=0)
    if n_roll % 2 == 0:
        spectrum[-1] *= 0.5  # the Nyquist harmonic is two in the longer spectrum
    return np.asarray(ROLL_REFINEMENT * np.fft.irfft(spectrum, n=ROLL_REFINEMENT * n_roll, axis=0))
