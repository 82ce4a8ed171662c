"""A ring about the x axis meshed with any kind of element: the body the locking check is run on.

Locking check: bending of the wall by the user's elements on a ring, against closed forms.

Pressure p cos(n phi) on a ring in plane strain bends its wall for n >= 2, and that bending is most of what hoop
gauges read. Elements with linear shape functions are too stiff in it (locking), by a factor that neither the
global compliance nor a test on a second mesh of the same kind shows.

Number of elements through the wall that a swept mesh needs, by the locking check.

One layer of quadratic hexahedra carries the bending of thin walls. In a thick one, strain is no longer linear
through the wall: on a ring of radius 4 t a single layer loses 2 % of the hoop strain under cos 2 phi and 6 % under
cos 4 phi.

Error of gauge strain by the mesh, as the difference of two models under loads that any surface can carry.

The loads are pressure cos(m phi) and sin(m phi), m = 0 to 4, constant along x and growing from 0 at the nose to 1
at the base: what air does to a slender body, and what bends its wall.
"""

import warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from itertools import permutations

import numpy as np
from scipy.sparse import csr_array

from builder.structure.fourier.inner_surface import place_gauges
from builder.structure.fourier.shell_mesh import shell_mesh
from builder.structure.fourier.strain_operator import harmonic_response, strain_operator
from builder.structure.solid.elements import (
    CORNERS,
    FACE_CORNERS,
    Quadrature,
    boundary_facets,
    element_edges,
    reference_nodes,
)
from builder.structure.solid.gauge_rows import Gauges, gauge_rows, gauges_at
from builder.structure.solid.nodal_loads import pressure_load, surface_points
from builder.structure.solid.solid_mesh import (
    EXTERNAL,
    HEXAHEDRON,
    INTERNAL,
    NODES_PER_ELEMENT,
    QUADRATIC,
    SUPPORT,
    SolidMesh,
)
from builder.structure.solid.sparse_problem import factor_symmetric
from builder.structure.solid.stiffness import assemble_stiffness
from builder.structure.solid.supports import free_motions
from builder.structure.wall import Material, Wall
from builder.vehicle.shape.geometry import BodyOfRevolution, SurfaceGrid
from strainfmu.arrays import FloatArray, IntArray
from strainfmu.errors import InputError

REGION, FRONT = "wall", "front"
MIN_AROUND = 6


def ring_mesh(
    element_type: str,
    inner_radius: float,
    outer_radius: float,
    width: float,
    counts: tuple[int, int, int],
) -> SolidMesh:
    """Mesh a tube piece with x from 0 to ``width``; nodes lie on true circles.

    Tetrahedra are cut from hexahedral cells, six along the diagonals of each in the same way (Kuhn's division).

    Parameters
    ----------
    element_type : kind of the elements.
    inner_radius, outer_radius, width : of the ring [m].
    counts : cells along x, round the axis and through the wall.

    Returns
    -------
    SolidMesh
        Surfaces external, internal, front (x = 0) and support (x = width).
    """
    if element_type not in NODES_PER_ELEMENT:
        raise InputError(f"element type '{element_type}' found, must be one of {sorted(NODES_PER_ELEMENT)}")
    if not (0.0 < inner_radius < outer_radius < np.inf and 0.0 < width < np.inf):
        raise InputError(
            f"ring: inner radius {inner_radius:g} m, outer radius {outer_radius:g} m, width {width:g} m found, "
            "must be positive and increase from inside out"
        )
    if min(counts) < 1 or counts[1] < MIN_AROUND:
        raise InputError(f"ring: {counts} cells found, must be at least (1, {MIN_AROUND}, 1)")
    node, element = _lattice(element_type, counts)
    x = width * node[:, 0] / (2 * counts[0])
    roll = 2.0 * np.pi * node[:, 1] / (2 * counts[1])
    r = inner_radius + (outer_radius - inner_radius) * node[:, 2] / (2 * counts[2])
    position = np.column_stack([x, r * np.sin(roll), r * np.cos(roll)])
    facet, _ = boundary_facets(element_type, element)
    corner = node[facet[:, : FACE_CORNERS[element_type]]]
    sides = {
        EXTERNAL: (corner[..., 2] == 2 * counts[2]).all(axis=1),
        INTERNAL: (corner[..., 2] == 0).all(axis=1),
        FRONT: (corner[..., 0] == 0).all(axis=1),
        SUPPORT: (corner[..., 0] == 2 * counts[0]).all(axis=1),
    }
    surface = {name: facet[on_side] for name, on_side in sides.items()}
    return SolidMesh(
        element_type=element_type,
        node=position,
        element=element,
        region=np.zeros(len(element), dtype=np.int64),
        region_names=(REGION,),
        surface=surface,
    )


def _lattice(element_type: str, counts: tuple[int, int, int]) -> tuple[IntArray, IntArray]:
    """Return nodes (n, 3) as points of a lattice of half cells, and elements (m, n_e); closed round the axis."""
    cells = np.stack(np.meshgrid(*(np.arange(count) for count in counts), indexing="ij"), axis=-1).reshape(
        -1, 1, 3
    )
    point = np.concatenate([2 * cells + local for local in _local_points(element_type)])
    point[..., 1] %= 2 * counts[1]
    size = np.array([2 * count + 1 for count in counts])
    key = (point[..., 0] * size[1] + point[..., 1]) * size[2] + point[..., 2]
    used, element = np.unique(key, return_inverse=True)
    node = np.stack([used // (size[1] * size[2]), used // size[2] % size[1], used % size[2]], axis=-1)
    return node.astype(np.int64), element.reshape(key.shape).astype(np.int64)


def _local_points(element_type: str) -> list[IntArray]:
    """Return the points (n_e, 3) on a cell's lattice of half cells of the nodes of each element in it."""
    if CORNERS[element_type] == 8:
        # Reference axes along x, round, outward: right-handed, because roll goes from +z towards +y.
        return [np.rint(2.0 * reference_nodes(element_type)).astype(np.int64)]
    points = []
    for order in permutations(range(3)):
        corner = np.zeros((4, 3), dtype=np.int64)
        for step, axis in enumerate(order):
            corner[step + 1 :, axis] = 2
        if np.linalg.det(corner[1:] - corner[0]) < 0.0:
            corner = corner[[0, 2, 1, 3]]
        middle = corner[element_edges(element_type)].sum(axis=1) // 2
        points.append(np.concatenate([corner, middle]) if element_type in QUADRATIC else corner)
    return points


HARMONICS = (0, 2, 4)
WARN_BELOW, REFUSE_BELOW = 0.98, 0.90  # of the strain in the closed form


class LockingWarning(UserWarning):
    """The elements lose a part of the bending strain that is small enough to go on with."""


@dataclass(frozen=True, kw_only=True)
class WallElements:
    """Elements of the wall, where the locking check is run on them.

    Attributes
    ----------
    element_type : kind of the elements.
    size : their length round the axis [m].
    layers : elements through the wall.
    radius, thickness : outer radius of the wall and its thickness [m].
    material : of the wall.
    quadrature : how :mod:`builder.structure.solid.stiffness` integrates their stiffness: ``"thin_wall"``
        for swept hexahedra, ``"full"`` for all others.
    """

    element_type: str
    size: float
    layers: int
    radius: float
    thickness: float
    material: Material
    quadrature: Quadrature = "full"


def inner_hoop_strain(inner_radius: float, outer_radius: float, harmonic: int, material: Material) -> float:
    """Return the hoop strain on the inner face of a ring in plane strain, at phi = 0, per outer pressure [1/Pa].

    Pressure cos(n phi). For n = 0 Lame, -2 (1 - nu^2) b^2 / (E (b^2 - a^2)); for n >= 2 Michell's stress function
    (A r^n + B r^-n + C r^(n+2) + D r^(2-n)) cos(n phi) (Timoshenko and Goodier, Theory of Elasticity, sections 28
    and 43).
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


@cache
def locking_ratios(elements: WallElements) -> Mapping[int, float]:
    """Return hoop strain on the inner face over the closed form's, per harmonic of :data:`HARMONICS`.

    The ring is two elements wide and of the wall's outer radius and thickness; no node moves along x. The strain
    is read by a gauge per element round the inner face and projected on cos(n phi).
    """
    radius, thickness, material = elements.radius, elements.thickness, elements.material
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
    held_stiffness = csr_array(free.T @ stiffness @ free)
    point = surface_points(mesh, EXTERNAL)
    pressure = np.cos(np.outer(np.arctan2(point[:, 1], point[:, 2]), HARMONICS))
    force = pressure_load(mesh, EXTERNAL) @ pressure
    displacement = free @ factor_symmetric(held_stiffness).solve(np.asarray(free.T @ force))
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


def check_locking(elements: WallElements, allow_locking: bool = False) -> Mapping[int, float]:
    """Warn of, or refuse, elements that lose bending strain.

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
    ratios = locking_ratios(elements)
    worst = min(ratios, key=lambda n: ratios[n])
    if ratios[worst] >= WARN_BELOW:
        return ratios
    text = (
        f"locking: {elements.element_type} ({elements.quadrature} quadrature), {1e3 * elements.size:.3g} mm round "
        f"the axis, {elements.layers} through a wall of {1e3 * elements.thickness:.3g} mm at radius "
        f"{1e3 * elements.radius:.4g} mm, "
        f"give {100.0 * ratios[worst]:.3g} % of the hoop strain under cos({worst} phi)"
    )
    if ratios[worst] < REFUSE_BELOW and not allow_locking:
        raise InputError(
            f"{text}, must be at least {100.0 * REFUSE_BELOW:g} %; take quadratic or smaller elements"
        )
    warnings.warn(text, LockingWarning, stacklevel=2)
    return ratios


def check_solid_elements(element_type: str, allow_locking: bool = False) -> None:
    """Refuse linear elements of a body without a wall, of which no closed form shows what they lose in bending."""
    if element_type not in QUADRATIC and not allow_locking:
        raise InputError(
            f"locking: {element_type} of a body without a cavity bend too little; expected one of "
            f"{', '.join(QUADRATIC)}"
        )


MOST_LAYERS = 8
SMALLEST_RADIUS = 1.25  # of the thickness: nearer to the axis the closed forms of a ring say little of the wall


def layers_needed(wall: Wall, radius: FloatArray, n_sectors: int, fewest: int = 1) -> int:
    """Return the fewest layers whose loss of bending the locking check accepts without a warning.

    Parameters
    ----------
    wall : thickness and material.
    radius : (k,) outer radii [m] at which it must hold: of the base and at the gauges.
    n_sectors : elements round the axis.
    fewest : layers to begin with.

    Returns
    -------
    At most :data:`MOST_LAYERS`, whether they suffice or not: the locking check itself follows.
    """
    at_least = SMALLEST_RADIUS * wall.thickness
    # The smallest radius needs most layers, the largest has the longest elements round the axis.
    ends = sorted({max(at_least, float(np.min(radius))), max(at_least, float(np.max(radius)))})
    for layers in range(fewest, MOST_LAYERS):
        rings = (
            swept_elements(wall, radius=outer_radius, n_sectors=n_sectors, layers=layers) for outer_radius in ends
        )
        if all(min(locking_ratios(ring).values()) >= WARN_BELOW for ring in rings):
            return layers
    return MOST_LAYERS


def swept_elements(wall: Wall, *, radius: float, n_sectors: int, layers: int) -> WallElements:
    """Return the elements of a swept mesh where the wall has an outer ``radius`` [m]."""
    return WallElements(
        element_type=HEXAHEDRON,
        size=2.0 * np.pi * radius / n_sectors,
        layers=layers,
        radius=radius,
        thickness=wall.thickness,
        material=wall.material,
        quadrature="thin_wall",
    )


NO_REFERENCE = "no other mesh"
"""What the mesh error of a structure is measured against that no second mesh checks."""
REFERENCE_HARMONICS = 5
PROFILES = 2
ROLL_ANGLES = 16  # enough for the interpolation in roll to be exact
ELEMENT_FRACTION = 1.0 / 480.0  # of the body's length, in two layers: 7.5 mm on the shipped vehicle


def reference_pressures(point: FloatArray, length: float) -> FloatArray:
    """Return pressures (n_p, 20) of amplitude 1 at points (n_p, 3) [m] of a body of a length [m].

    Column = (m * 2 + profile) * 2 + phase: profile 0 constant, 1 growing; phase 0 cosine, 1 sine.
    """
    roll = np.arctan2(point[:, 1], point[:, 2])
    harmonic = np.arange(REFERENCE_HARMONICS) * roll[:, None]
    wave = np.stack([np.cos(harmonic), np.sin(harmonic)], axis=-1)
    profile = np.stack([np.ones(len(point)), point[:, 0] / length], axis=-1)
    return (wave[:, :, None, :] * profile[:, None, :, None]).reshape(len(point), -1)


def largest_amplitude(strain: FloatArray) -> FloatArray:
    """Return (n_d,) the largest of strains (n_d, 20) over loads, each at its worst phase, [1/Pa] per pressure."""
    phases = strain.reshape(len(strain), REFERENCE_HARMONICS * PROFILES, 2)
    return np.asarray(np.hypot(phases[..., 0], phases[..., 1]).max(axis=1))


def fourier_can(gauges: Gauges) -> bool:
    """Return whether the Fourier model can place these gauges: points on the inner surface."""
    return bool((gauges.length == 0.0).all()) and set(gauges.surface) <= {INTERNAL}


def fourier_reference_strain(body: BodyOfRevolution, wall: Wall, layouts: Sequence[Gauges]) -> FloatArray:
    """Return strain (n_d, 20) [1/Pa] under :func:`reference_pressures` by the Fourier model, clamped aft.

    Rows are the gauges of ``layouts``, one layout after the other: one solution serves all of them.
    """
    mesh = shell_mesh(body, wall, ELEMENT_FRACTION * body.length, 2)
    position, direction = (
        np.concatenate([getattr(gauges, name) for gauges in layouts]) for name in ("position", "direction")
    )
    placed = place_gauges(mesh, position, direction, [name for gauges in layouts for name in gauges.name])
    ends = np.array([0.0, body.length])  # pressure is linear in x between stations
    grid = SurfaceGrid(x=ends, radius=np.ones(2), angle=np.zeros(2), n_roll=ROLL_ANGLES)
    response = harmonic_response(mesh, wall.material, placed.x, ends, REFERENCE_HARMONICS - 1)
    roll = np.tile(grid.roll_angle, 2)
    on_unit_radius = np.column_stack([np.repeat(ends, ROLL_ANGLES), np.sin(roll), np.cos(roll)])
    return strain_operator(response, placed, grid) @ reference_pressures(on_unit_radius, body.length)
