"""Locking check: bending of the wall by the user's elements on a ring, against closed forms.

Pressure p cos(n phi) on a ring in plane strain bends its wall for n >= 2, and that bending is most of what hoop
gauges read. Elements with linear shape functions are too stiff in it (locking), by a factor that neither the
global compliance nor a test on a second mesh of the same kind shows.
"""

from __future__ import annotations

import warnings
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from scipy.sparse import csr_array

from builder.structure.solid.elements.elements import Quadrature
from builder.structure.solid.gauges.gauge_rows import gauge_rows, gauges_at
from builder.structure.solid.mesh.ring_mesh import REGION, ring_mesh
from builder.structure.solid.mesh.solid_mesh import EXTERNAL, QUADRATIC, SolidMesh
from builder.structure.solid.operators.stiffness import assemble_stiffness
from builder.structure.solid.operators.supports import free_motions
from builder.structure.solid.operators.surface_load import pressure_load, surface_points
from builder.structure.solid.solvers.superlu import factor_symmetric
from builder.structure.wall import Material
from strainfmu.arrays import FloatArray, IntArray
from strainfmu.errors import InputError

HARMONICS = (0, 2, 4)
WARN_BELOW, REFUSE_BELOW = 0.98, 0.90  # of the strain in the closed form


class LockingWarning(UserWarning):
    """The elements lose a part of the bending strain that is small enough to go on with."""


@dataclass(frozen=True, kw_only=True)
class WallElements:
    """Elements of the wall.

    Attributes
    ----------
    element_type : kind of the elements.
    size : their length round the axis [m].
    layers : elements through the wall.
    quadrature : how :mod:`builder.structure.solid.operators.stiffness` integrates their stiffness: ``"thin_wall"``
        for swept hexahedra, ``"full"`` for all others.
    """

    element_type: str
    size: float
    layers: int
    quadrature: Quadrature = "full"


def inner_hoop_strain(inner_radius: float, outer_radius: float, harmonic: int, material: Material) -> float:
    """Return the hoop strain on the inner face of a ring in plane strain, at phi = 0, per outer pressure [1/Pa].

    Pressure cos(n phi). For n = 0 Lame, -2 (1 - nu^2) b^2 / (E (b^2 - a^2)); for n >= 2 Michell's stress function
    (A r^n + B r^-n + C r^(n+2) + D r^(2-n)) cos(n phi) (Timoshenko and Goodier, Theory of Elasticity, sections 28
    and 43).

    Raises
    ------
    InputError
        The harmonic is 1, whose pressure has a resultant, or negative.
    """
    a, b, n = inner_radius, outer_radius, harmonic
    plane = (1.0 - material.poisson_ratio**2) / material.youngs_modulus
    if n == 0:
        return -2.0 * plane * b**2 / (b**2 - a**2)
    if n < 2:
        raise InputError(f"harmonic {n} found, must be 0 or at least 2: a ring is not in equilibrium under it")
    power = np.array([n, -n, n + 2, 2 - n])

    def stress(r: float) -> FloatArray:
        """Return (3, 4) radial, shear and hoop stress of each term, scaled to order 1 at the outer radius."""
        value = (r / b) ** power * b**2
        first, second = power * value / r, power * (power - 1) * value / r**2
        return np.array([first / r - n**2 * value / r**2, n * (first / r - value / r**2), second])

    inner, outer = stress(a), stress(b)
    amplitude = np.linalg.solve(np.stack([inner[0], inner[1], outer[0], outer[1]]), [0.0, 0.0, -1.0, 0.0])
    return float(plane * (inner[2] @ amplitude))


def locking_ratios(
    elements: WallElements, radius: float, thickness: float, material: Material
) -> dict[int, float]:
    """Return hoop strain on the inner face over the closed form's, per harmonic of :data:`HARMONICS`.

    The ring is two elements wide and of the wall's outer radius and thickness; no node moves along x. The strain
    is read by a gauge per element round the inner face and projected on cos(n phi).

    Parameters
    ----------
    elements : how the wall is meshed.
    radius, thickness : outer radius of the wall and its thickness [m].
    material : of the wall.

    Raises
    ------
    InputError
        A length or number is not positive, or the wall is thicker than its radius.
    """
    if not (0.0 < elements.size < np.inf and elements.layers >= 1 and 0.0 < thickness < radius):
        raise InputError(
            f"locking check: element size {elements.size:g} m, {elements.layers} layers, thickness {thickness:g} "
            f"m, radius {radius:g} m found, must be positive and the wall thinner than its radius"
        )
    inner = radius - thickness
    # A multiple of 4, so that the mesh has the symmetry of the loads.
    around = max(8, 4 * round(0.5 * np.pi * radius / elements.size))
    mesh = ring_mesh(elements.element_type, inner, radius, 2.0 * elements.size, (2, around, elements.layers))
    roll = 2.0 * np.pi * (np.arange(around) + 0.5) / around
    stiffness = assemble_stiffness(mesh, {REGION: material}, elements.quadrature)
    strain = _hoop_strain(mesh, stiffness, inner, roll)
    return {
        n: float(strain[:, i] @ np.cos(n * roll) / (np.cos(n * roll) @ np.cos(n * roll)))
        / inner_hoop_strain(inner, radius, n, material)
        for i, n in enumerate(HARMONICS)
    }


def _hoop_strain(mesh: SolidMesh, stiffness: csr_array, inner_radius: float, roll: FloatArray) -> FloatArray:
    """Return (len(roll), len(HARMONICS)) hoop strain per pressure [1/Pa] inside, at a quarter of the width."""
    free = free_motions(mesh.n_nodes, *_plane_strain(mesh))
    held = csr_array(free.T @ stiffness @ free)
    point = surface_points(mesh, EXTERNAL)
    pressure = np.cos(np.outer(np.arctan2(point[:, 1], point[:, 2]), HARMONICS))
    force = pressure_load(mesh, EXTERNAL) @ pressure
    displacement = free @ factor_symmetric(held).solve(np.asarray(free.T @ force))
    x = np.full(len(roll), 0.25 * mesh.node[:, 0].max())
    sine, cosine = np.sin(roll), np.cos(roll)
    on_chord = inner_radius * np.cos(roll[0]) if mesh.element_type.endswith(("4", "8")) else inner_radius
    position = np.column_stack([x, on_chord * sine, on_chord * cosine])
    rows = gauge_rows(mesh, gauges_at(position, np.column_stack([0.0 * x, cosine, -sine])))
    return np.asarray(rows @ displacement)


def _plane_strain(mesh: SolidMesh) -> tuple[IntArray, FloatArray]:
    """Return nodes and directions that hold x everywhere and the ring's three rigid motions in its plane.

    The loads are in equilibrium, so the three take no force.
    """
    everywhere = np.arange(mesh.n_nodes)
    top, bottom = mesh.node[:, 2].argmax(), mesh.node[:, 2].argmin()
    side = mesh.node[:, 1].argmax()
    x, y, z = np.eye(3)
    node = np.concatenate([everywhere, [top, bottom, side]])
    return node, np.concatenate([np.tile(x, (mesh.n_nodes, 1)), [y, y, z]])


def check_locking(
    elements: WallElements, radius: float, thickness: float, material: Material, allow_locking: bool = False
) -> Mapping[int, float]:
    """Warn of, or refuse, elements that lose bending strain; arguments as in :func:`locking_ratios`.

    A loss above 2 % of the closed form in any harmonic gives a :class:`LockingWarning`, above 10 % an error unless
    ``allow_locking``.

    Returns
    -------
    The ratios per harmonic.

    Raises
    ------
    InputError
        The loss is above 10 %, or an argument is wrong.
    """
    ratios = locking_ratios(elements, radius, thickness, material)
    worst = min(ratios, key=lambda n: ratios[n])
    if ratios[worst] >= WARN_BELOW:
        return ratios
    text = (
        f"locking: {elements.element_type} ({elements.quadrature} quadrature), {1e3 * elements.size:.3g} mm round "
        f"the axis, {elements.layers} through a wall of {1e3 * thickness:.3g} mm at radius {1e3 * radius:.4g} mm, "
        f"give {100.0 * ratios[worst]:.3g} % of the hoop strain under cos({worst} phi)"
    )
    if ratios[worst] < REFUSE_BELOW and not allow_locking:
        raise InputError(
            f"{text}, must be at least {100.0 * REFUSE_BELOW:g} %; take quadratic or smaller elements"
        )
    warnings.warn(text, LockingWarning, stacklevel=2)
    return ratios


def check_solid_elements(element_type: str, allow_locking: bool = False) -> None:
    """Refuse linear elements of a body without a wall, of which no closed form shows what they lose in bending.

    Raises
    ------
    InputError
        They are linear, and ``allow_locking`` is not given.
    """
    if element_type not in QUADRATIC and not allow_locking:
        raise InputError(
            f"locking: {element_type} of a body without a cavity bend too little; expected one of "
            f"{', '.join(QUADRATIC)}"
        )
