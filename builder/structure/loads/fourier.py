"""Known loads on the semi-analytic model of a body of revolution.

A load is split into two families of harmonics. In the first, axial and radial forces go as cos(m phi), tangential
ones as sin(m phi); the second is the first rolled by a quarter period, so they go as sin(m phi) and -cos(m phi).
The second family of m = 0 is torsion. Stiffness is the same for both.

Per harmonic the strains at every gauge station are solved for once (adjoint, as in
:mod:`~builder.structure.fourier.strain_operator`), so that a load costs a product. Nodal forces are arrays
(2 families, n_m, n_nodes, 3) [N per roll integral], components x, r, phi.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.sparse import csr_array

from builder.reporting import Progress
from builder.structure.fourier.fourier_elasticity import (
    assemble_stiffness,
    factor_harmonic,
    reference_points,
    reference_points_of_mass,
    roll_integral,
    strain_displacement,
)
from builder.structure.fourier.free_flight import held_at_points
from builder.structure.fourier.inner_surface import PlacedGauges
from builder.structure.fourier.meridian_mesh import MeridianMesh, line_nodes, locate_on_edge, quadratic_shape
from builder.structure.fourier.strain_operator import distinct_stations, station_index, strain_rows
from builder.structure.loads.applied import Load, PadForce, PadPressure, PointForce
from builder.structure.loads.loaded_structure import INNER, OUTER, LoadProperties, SurfacePoints, check_stations
from builder.structure.loads.temperature import TemperatureField, wall_depth
from builder.structure.wall import Material
from strainfmu.arrays import FloatArray, IntArray
from strainfmu.errors import InputError
from strainfmu.estimator.signal_names import TEMPERATURE

EDGE_POINTS = 4  # per element along a surface
FEWEST_ROLL_POINTS = 128

MAX_HARMONIC = 24
"""Highest harmonic in roll angle of known loads, where the loads do not say that fewer do."""


ROUNDING = 1e-9
"""By which a quotient may exceed the whole number that it is."""


def harmonics_of(load: Load) -> int:
    """Return the highest harmonic in roll angle that ``load`` needs, at most :data:`MAX_HARMONIC`."""
    if isinstance(load, PointForce):
        return MAX_HARMONIC
    if isinstance(load, PadForce | PadPressure):
        return pad_harmonics(load.half_angle)
    return min(MAX_HARMONIC, load.max_harmonic) if isinstance(load, TemperatureField) else 1


def pad_harmonics(half_angle: float) -> int:
    """Return the same of a pad of ``half_angle`` w [rad].

    Its force is zero at harmonic 2 pi / w and below 2.4 % of its mean beyond. There, pads of 30 deg on the shipped
    vehicle strain its gauges by about 1e-4 of a case's largest strain at most.
    """
    return min(MAX_HARMONIC, int(np.ceil(2.0 * np.pi / half_angle - ROUNDING)))


@dataclass(frozen=True, eq=False, kw_only=True)
class FourierStructure:
    """A :class:`~builder.structure.loads.loaded_structure.LoadedStructure` of revolution.

    Attributes
    ----------
    mesh, material : wall and supports; without a clamped or guided node the body is free.
    properties : density, expansion, compensation of the gauges, point masses.
    gauges : on the inner surface.
    station : (n_d,) index of each gauge's station in ``adjoint``.
    adjoint : (n_m, n_stations, 3, n_dof) meridional, hoop and shear strain per nodal force [1/N], the roll
        integral left out.
    """

    mesh: MeridianMesh
    material: Material
    properties: LoadProperties
    gauges: PlacedGauges
    station: IntArray
    adjoint: FloatArray

    @property
    def max_harmonic(self) -> int:
        """Highest harmonic in roll angle."""
        return len(self.adjoint) - 1

    @property
    def is_free(self) -> bool:
        """Whether nothing holds the body."""
        return is_free(self.mesh)

    @property
    def gauge_location(self) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Stations [m], roll angles [rad] and depths in the wall of the gauges, (n_d,) each."""
        return self.gauges.x, self.gauges.roll_angle, np.zeros(len(self.gauges.x))

    @property
    def outer_span(self) -> tuple[float, float]:
        """First and last station of the outer surface [m]."""
        front, aft = self.mesh.node[self.mesh.outer_edge[[0, -1], [0, 2]], 0]
        return float(front), float(aft)

    def surface_points(self, surface: str) -> SurfacePoints:
        """Return the quadrature points of ``"outer"`` or ``"inner"``: edge point * n_roll + roll index.

        They are kept for the next time.
        """
        if surface not in self._points:
            self._points[surface] = self._surface_points(self._meridian(surface))
        return self._points[surface]

    def _surface_points(self, meridian: _Meridian) -> SurfacePoints:
        n, roll = len(meridian.x), self._roll
        sine, cosine = np.tile(np.sin(roll), n), np.tile(np.cos(roll), n)
        x, r, n_x, n_r, width = (
            np.repeat(a, len(roll)) for a in (meridian.x, meridian.r, *meridian.normal.T, meridian.width)
        )
        return SurfacePoints(
            position=np.column_stack([x, r * sine, r * cosine]),
            normal=np.column_stack([n_x, n_r * sine, n_r * cosine]),
            area=width * r * 2.0 * np.pi / len(roll),
        )

    def spread_force(self, surface: str, force: FloatArray, chosen: IntArray | None = None) -> FloatArray:
        """Return nodal forces of forces (n, 3) [N] on quadrature points of a surface: all or ``chosen`` (n,)."""
        meridian = self._meridian(surface)
        n_roll = len(self._roll)
        if chosen is None:
            loaded, roll, rings = np.arange(len(meridian.x)), self._roll, force.reshape(-1, n_roll, 3)
        else:  # a pad loads few rings, at few roll angles
            loaded, ring = np.unique(chosen // n_roll, return_inverse=True)
            turned, place = np.unique(chosen % n_roll, return_inverse=True)
            roll, rings = self._roll[turned], np.zeros((len(loaded), len(turned), 3))
            rings[ring, place] = force
        local = _cylindrical(rings, roll)
        m_phi = np.arange(self.max_harmonic + 1)[:, None] * roll
        family = np.tensordot(np.stack([np.cos(m_phi), np.sin(m_phi)]), local, (2, 1))  # wave, m, ring, component
        family[..., 2] = family[1, ..., 2], -family[0, ..., 2]  # round the body as the other wave
        return self._scattered(family, meridian.shape[loaded])

    def point_force(self, station: FloatArray, roll_angle: FloatArray, force: FloatArray) -> FloatArray:
        """Return nodal forces of forces (k, 3) [N] at points of the outer surface."""
        shape = self._shape_at(station)
        local = _cylindrical(force[:, None], roll_angle[:, None])[:, 0]
        m_phi = np.arange(self.max_harmonic + 1)[:, None] * roll_angle
        cosine, sine = np.cos(m_phi)[..., None], np.sin(m_phi)[..., None]
        family = np.stack(
            [
                np.concatenate([cosine * local[:, :2], sine * local[:, 2:]], axis=-1),
                np.concatenate([sine * local[:, :2], -cosine * local[:, 2:]], axis=-1),
            ]
        )
        return self._scattered(family, shape)

    def outer_radius(self, station: float) -> float:
        """Return the radius of the outer surface at a station [m]."""
        return float((self._shape_at(np.array([station])) @ self.mesh.node[:, 1])[0])

    def inertia_force(self, acceleration: FloatArray) -> FloatArray:
        """Return nodal forces of mass times the acceleration (6,) of a rigid body about the origin."""
        motion = np.tensordot(acceleration, _rigid_families(self.mesh), axes=1)
        force = np.zeros((2, self.max_harmonic + 1, len(self.mesh.node), 3))
        for family in (0, 1):
            for m in range(min(2, self.max_harmonic + 1)):
                force[family, m] = self._mass_matrix @ motion[family, m]
        return force

    def thermal_force(self, temperature: TemperatureField) -> FloatArray:
        """Return the nodal forces that hinder thermal expansion; harmonics above ``max_harmonic`` are left out."""
        self._refuse_materials(TEMPERATURE)
        young, nu = self.material.youngs_modulus, self.material.poisson_ratio
        stress = self.properties.needed_expansion() * young / (1.0 - 2.0 * nu)
        outer = self.mesh.node[line_nodes(self.mesh.outer_edge)]
        inner = self.mesh.node[line_nodes(self.mesh.inner_edge)]
        x, r = self.mesh.node.T
        parts = temperature.amplitudes(x, wall_depth(x, r, inner, outer))
        force = np.zeros((2, self.max_harmonic + 1, self.mesh.n_dof))
        constant, linear = self._thermal_matrices
        for m in range(min(self.max_harmonic, temperature.max_harmonic) + 1):
            for family, part in enumerate(parts):
                if part[:, m].any():
                    force[family, m] = stress * (constant @ part[:, m] + m * (linear @ part[:, m]))
        return force.reshape(2, self.max_harmonic + 1, -1, 3)

    def resultant(self, force: FloatArray) -> FloatArray:
        """Return force [N] and moment about the origin [N m] of nodal forces, (6,)."""
        rigid = _rigid_families(self.mesh)
        n_m = min(2, self.max_harmonic + 1)
        integral = np.array([roll_integral(m) for m in range(n_m)])
        work = np.einsum("kfmnc,fmnc,m->k", rigid[:, :, :n_m], force[:, :n_m], integral)
        return np.asarray(work)

    def strain(self, force: FloatArray) -> FloatArray:
        """Return the strain of gauges (n_d,) under nodal forces, which of a free body must be balanced."""
        flat = force.reshape(2, len(self.adjoint), -1)
        of_family = np.stack([np.einsum("mskd,md->msk", self.adjoint, part, optimize=True) for part in flat])
        at_gauge = of_family[:, :, self.station]  # family, harmonic, gauge, strain
        phase = np.arange(len(self.adjoint))[:, None] * self.gauges.roll_angle
        cosine, sine = np.cos(phase)[..., None], np.sin(phase)[..., None]
        normal = (at_gauge[0, ..., :2] * cosine + at_gauge[1, ..., :2] * sine).sum(axis=0)
        shear = (at_gauge[0, ..., 2:] * sine - at_gauge[1, ..., 2:] * cosine).sum(axis=0)[:, 0]
        c, s = self.gauges.meridional, self.gauges.circumferential
        return np.asarray(c**2 * normal[:, 0] + s**2 * normal[:, 1] + 2.0 * c * s * shear)

    def _refuse_materials(self, what: str) -> None:
        if self.mesh.materials:
            raise InputError(
                f"known loads of {what}: expected a wall of one material, got structure.regions or frames"
            )

    @cached_property
    def _points(self) -> dict[str, SurfacePoints]:
        """Points of the surfaces that were asked for."""
        return {}

    @cached_property
    def _roll(self) -> FloatArray:
        n = max(FEWEST_ROLL_POINTS, 8 * self.max_harmonic)
        return 2.0 * np.pi * np.arange(n) / n

    def _meridian(self, surface: str) -> _Meridian:
        if surface == OUTER:
            return self._outer
        if surface == INNER:
            return self._inner
        raise InputError(f"surface '{surface}' found, a body of revolution has '{OUTER}' and '{INNER}'")

    @cached_property
    def _outer(self) -> _Meridian:
        return _meridian_points(self.mesh, self.mesh.outer_edge, 1.0)

    @cached_property
    def _inner(self) -> _Meridian:
        if not len(self.mesh.inner_edge):
            raise InputError("the body is solid: it has no inner surface")
        edge = np.concatenate([_tip_face(self.mesh), self.mesh.inner_edge])
        return _meridian_points(self.mesh, edge, -1.0)

    @cached_property
    def _mass_matrix(self) -> csr_array:
        density = self.properties.needed_densities(len(self.mesh.materials))
        return _mass_matrix(self.mesh, density[0 if self.mesh.material_of is None else self.mesh.material_of])

    @cached_property
    def _thermal_matrices(self) -> tuple[csr_array, csr_array]:
        return _thermal_matrices(self.mesh)

    def _shape_at(self, station: FloatArray) -> csr_array:
        """Return (k, n_nodes) weights of the nodes at points of the outer surface."""
        check_stations(self.outer_span, station)
        index, xi = locate_on_edge(self.mesh, self.mesh.outer_edge, station)
        shape, _ = quadratic_shape(xi)
        return _shape_matrix(self.mesh, self.mesh.outer_edge[index], shape)

    def _scattered(self, family: FloatArray, shape: csr_array) -> FloatArray:
        """Return nodal forces of amplitudes (2, n_m, n, 3) at points whose node weights are (n, n_nodes)."""
        n_m, n = family.shape[1:3]
        integral = np.array([roll_integral(m) for m in range(n_m)])[:, None, None]
        nodal = shape.T @ (family / integral).transpose(2, 0, 1, 3).reshape(n, 6 * n_m)
        return np.asarray(nodal.reshape(-1, 2, n_m, 3).transpose(1, 2, 0, 3))


def fourier_structure(
    mesh: MeridianMesh,
    material: Material,
    gauges: PlacedGauges,
    properties: LoadProperties | None = None,
    max_harmonic: int = MAX_HARMONIC,
    progress: Progress | None = None,
) -> FourierStructure:
    """Solve a body of revolution for the strains at its gauges.

    Parameters
    ----------
    mesh : the wall with its supports; without any the body is free, and its inertia balances the load.
    material : of the wall.
    gauges : on the inner surface.
    properties : what loads need in addition to stiffness.
    max_harmonic : highest harmonic in roll angle. A pad of half angle w needs about 2 pi / w of them; under a
        point force strain is smoothed within about 2 radii over ``max_harmonic``.
    progress : called with (harmonics done, harmonics in all).

    Raises
    ------
    InputError
        ``max_harmonic`` is less than 1, or supports leave a motion free.
    """
    if max_harmonic < 1:
        raise InputError(f"max_harmonic {max_harmonic} must be at least 1")
    stations = distinct_stations(gauges.x)
    stiffness = assemble_stiffness(mesh, material)
    free = is_free(mesh)
    adjoint = np.empty((max_harmonic + 1, len(stations), 3, mesh.n_dof))
    for m in range(max_harmonic + 1):
        if m < 2 and free and not len(mesh.clamped_node):
            solver = held_at_points(mesh, stiffness.matrix(m), m)
        else:
            solver = factor_harmonic(mesh, stiffness, m, twist=True)
        rows = strain_rows(mesh, stations, m)
        adjoint[m] = solver.solve(rows.reshape(-1, mesh.n_dof).T).T.reshape(rows.shape)
        if progress is not None:
            progress(m + 1, max_harmonic + 1)
    return FourierStructure(
        mesh=mesh,
        material=material,
        properties=properties or LoadProperties(),
        gauges=gauges,
        station=station_index(stations, gauges.x),
        adjoint=adjoint,
    )


def is_free(mesh: MeridianMesh) -> bool:
    """Return whether nothing holds a body: its inertia balances loads, or no node is held."""
    is_held = len(mesh.clamped_node) or len(mesh.guided_node) or mesh.foundation is not None
    return mesh.masses is not None or not is_held


@dataclass(frozen=True, eq=False, kw_only=True)
class _Meridian:
    """Quadrature points of a surface's meridian.

    Attributes
    ----------
    x, r : (n,) [m].
    normal : (n, 2) components x, r, out of the material.
    width : (n,) length along the meridian [m].
    shape : (n, n_nodes) weights of the nodes.
    """

    x: FloatArray
    r: FloatArray
    normal: FloatArray
    width: FloatArray
    shape: csr_array


def _meridian_points(mesh: MeridianMesh, edge: IntArray, side: float) -> _Meridian:
    """Return the points of edges; the normal is to the left of the way along them (outward) times ``side``."""
    xi, weight = np.polynomial.legendre.leggauss(EDGE_POINTS)
    shape, by_xi = quadratic_shape(xi)
    position = mesh.node[edge]
    x, r = np.einsum("qa,ead->deq", shape, position).reshape(2, -1)
    d_x, d_r = np.einsum("qa,ead->deq", by_xi, position).reshape(2, -1)
    length = np.hypot(d_x, d_r)
    return _Meridian(
        x=x,
        r=r,
        normal=side * np.column_stack([-d_r, d_x]) / length[:, None],
        width=length * np.tile(weight, len(edge)),
        shape=_shape_matrix(mesh, np.repeat(edge, EDGE_POINTS, axis=0), np.tile(shape, (len(edge), 1))),
    )


def _shape_matrix(mesh: MeridianMesh, node: IntArray, weight: FloatArray) -> csr_array:
    """Return (n, n_nodes) of weights (n, k) of nodes (n, k)."""
    row = np.repeat(np.arange(len(node)), node.shape[1])
    return csr_array((weight.ravel(), (row, node.ravel())), shape=(len(node), len(mesh.node)))


def _tip_face(mesh: MeridianMesh) -> IntArray:
    """Return the edges (n, 3), from the axis outwards, of the flat face that ends the hollow part, if any."""
    x, r = mesh.node[mesh.inner_edge[0, 0]]
    sides = mesh.element[:, [[0, 1, 2], [6, 7, 8]]].reshape(-1, 3)
    on_face = (np.abs(mesh.node[sides, 0] - x) < 1e-9).all(axis=1) & (mesh.node[sides, 1] <= r * (1.0 + 1e-9)).all(
        axis=1
    )
    face: IntArray = sides[on_face]
    return face[np.argsort(mesh.node[face[:, 1], 1])]


def _cylindrical(force: FloatArray, roll: FloatArray) -> FloatArray:
    """Turn vectors (..., 3) along body axes at roll angles (...,) into components x, r, phi."""
    sine, cosine = np.sin(roll), np.cos(roll)
    radial = force[..., 1] * sine + force[..., 2] * cosine
    around = force[..., 1] * cosine - force[..., 2] * sine
    return np.stack([force[..., 0], radial, around], axis=-1)


def _rigid_families(mesh: MeridianMesh) -> FloatArray:
    """Return amplitudes (6, 2, 2, n_nodes, 3) of translations along and rotations about body axes.

    Axes: motion, family, harmonic 0 or 1, node, component.
    """
    x, r = mesh.node.T
    unit = np.ones_like(x)
    motion = np.zeros((6, 2, 2, len(x), 3))
    motion[0, 0, 0, :, 0] = unit
    motion[1, 1, 1, :, 1], motion[1, 1, 1, :, 2] = unit, -unit
    motion[2, 0, 1, :, 1], motion[2, 0, 1, :, 2] = unit, -unit
    motion[3, 1, 0, :, 2] = r
    motion[4, 0, 1] = np.column_stack([r, -x, x])
    motion[5, 1, 1] = np.column_stack([-r, x, -x])
    return motion


def _mass_matrix(mesh: MeridianMesh, density: FloatArray) -> csr_array:
    """Return (n_nodes, n_nodes) the integral of density N_a N_b r dA [kg] per radian; ``density`` of each element,
    or one for all."""
    shape, volume = reference_points_of_mass(mesh)
    volume = volume * np.broadcast_to(density, len(mesh.element))[:, None]
    block = np.einsum("eq,qa,qb->eab", volume, shape, shape, optimize=True)
    row = np.broadcast_to(mesh.element[:, :, None], block.shape)
    column = np.broadcast_to(mesh.element[:, None, :], block.shape)
    n = len(mesh.node)
    return csr_array((block.ravel(), (row.ravel(), column.ravel())), shape=(n, n))


def _thermal_matrices(mesh: MeridianMesh) -> tuple[csr_array, csr_array]:
    """Return the integral of each displacement's dilatation times temperature, (n_dof, n_nodes) [m2] per radian.

    Of harmonic m: the first plus m times the second. It is taken at the points of the stiffness, so that a
    temperature whose free expansion the elements can follow leaves no stress.
    """
    constant, linear, weight = strain_displacement(mesh)
    shape = reference_points()[0]
    dof = (3 * mesh.element[:, :, None] + np.arange(3)).reshape(len(mesh.element), 27)
    matrices = []
    for part in (constant, linear):
        block = np.einsum("eqb,eq,qa->eba", part[:, :, :3].sum(axis=2), weight, shape, optimize=True)
        row = np.broadcast_to(dof[:, :, None], block.shape)
        column = np.broadcast_to(mesh.element[:, None, :], block.shape)
        size = (mesh.n_dof, len(mesh.node))
        matrices.append(csr_array((block.ravel(), (row.ravel(), column.ravel())), shape=size))
    return matrices[0], matrices[1]
