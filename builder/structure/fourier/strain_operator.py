"""Z_p, the linear map from nodal surface pressure to gauge strain.

Per harmonic, Z = B K^-1 L is built from its rows: one solve of the symmetric K per gauge station and strain
component (adjoint), then a product with the pressure load L. Source: the paper's eq. Z_p = B A^-1 C_map.

Consistent nodal forces of a pressure on the outer surface.
"""

from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csc_array

from builder.processors import one_thread_of_blas, processors
from builder.reporting import Progress
from builder.structure.fourier.fourier_elasticity import (
    FourierStiffness,
    HarmonicSolver,
    assemble_stiffness,
    factor_harmonic,
)
from builder.structure.fourier.free_flight import FlyingSolver
from builder.structure.fourier.inner_surface import PlacedGauges, SurfacePoints, inner_surface_points
from builder.structure.fourier.meridian_mesh import MeridianMesh, locate_on_edge, quadratic_shape
from builder.structure.wall import Material
from builder.vehicle.shape.geometry import SurfaceGrid
from strainfmu.arrays import ComplexArray, FloatArray
from strainfmu.errors import InputError

# Shape function (2) x radius (2) x slope (1) x pressure (1): degree 6 in xi.
LOAD_POINTS = 4
REACH_TOLERANCE = 1e-9


def pressure_load(mesh: MeridianMesh, station_x: FloatArray) -> csc_array:
    """Return nodal forces per unit pressure at each station, for pressure ~ cos(m phi).

    Pressure is linear in x between stations and may jump at a pair of equal ones. Edges are split at the
    stations and every part is integrated exactly, f = -integral of p n N r ds, so the forces sum to the
    exact resultant on the meshed surface. The integral over roll is left out, as in
    :mod:`builder.structure.fourier.fourier_elasticity`; the matrix is the same for all harmonics.

    Parameters
    ----------
    mesh : the mesh.
    station_x : (n_x,) stations [m], non-decreasing, from one end of the outer surface to the other.

    Returns
    -------
    (n_dof, n_x) force [N] per pressure [Pa] and per roll integral.

    Raises
    ------
    InputError
        Stations decrease or do not reach over the outer surface.
    """
    edge = mesh.outer_edge
    ends = mesh.node[edge[[0, -1], [0, 2]], 0]
    slack = REACH_TOLERANCE * (ends[1] - ends[0])
    if np.any(np.diff(station_x) < 0.0):
        raise InputError("pressure stations must not decrease")
    if station_x[0] > ends[0] + slack or station_x[-1] < ends[1] - slack:
        raise InputError(
            f"pressure stations reach from {station_x[0]:g} m to {station_x[-1]:g} m, "
            f"the surface from {ends[0]:g} m to {ends[1]:g} m"
        )
    cut = np.unique(np.concatenate([mesh.node[edge[:, ::2], 0].ravel(), np.clip(station_x, *ends)]))
    part, xi, weight = _points_of_parts(mesh, cut)
    shape, d_shape = quadratic_shape(xi)
    position = mesh.node[edge[part]]
    x, r = np.einsum("cqa,cad->dcq", shape, position)
    d_x, d_r = np.einsum("cqa,cad->dcq", d_shape, position)
    before, hat = _hat_functions(station_x, 0.5 * (cut[:-1] + cut[1:]), x)
    normal_force = np.stack([d_r, -d_x])  # -n ds/dxi for the outward normal n
    value = np.einsum("dcq,cqa,cqk->cadk", normal_force * (weight * r), shape, hat)
    row = np.broadcast_to((3 * edge[part][:, :, None] + np.arange(2))[..., None], value.shape)
    column = np.broadcast_to((before[:, None] + np.arange(2))[:, None, None, :], value.shape)
    return csc_array((value.ravel(), (row.ravel(), column.ravel())), shape=(mesh.n_dof, len(station_x)))


def _points_of_parts(mesh: MeridianMesh, cut: FloatArray) -> tuple[NDArray[np.intp], FloatArray, FloatArray]:
    """Return edge (n_part,), quadrature points xi and weights (n_part, n_q) between consecutive cuts."""
    part, middle = locate_on_edge(mesh, mesh.outer_edge, 0.5 * (cut[:-1] + cut[1:]))
    end_x = mesh.node[mesh.outer_edge[part][:, ::2], 0]
    half = np.diff(cut) / (end_x[:, 1] - end_x[:, 0])
    point, weight = np.polynomial.legendre.leggauss(LOAD_POINTS)
    return part, middle[:, None] + half[:, None] * point, half[:, None] * weight


def _hat_functions(
    station_x: FloatArray, part_x: FloatArray, x: FloatArray
) -> tuple[NDArray[np.intp], FloatArray]:
    """Return the station before each part (n_part,) and the two hat functions there (n_part, n_q, 2)."""
    before = np.clip(np.searchsorted(station_x, part_x, side="right") - 1, 0, len(station_x) - 2)
    start, end = station_x[before][:, None], station_x[before + 1][:, None]
    fraction = (x - start) / (end - start)
    return before, np.stack([1.0 - fraction, fraction], axis=-1)


SAME_STATION = 1e-9  # m
READINGS_AT_ONCE = 64


@dataclass(frozen=True, eq=False, kw_only=True)
class HarmonicResponse:
    """Strain on the inner surface per pressure 1 Pa * (hat function of station k) * cos(m phi).

    Attributes
    ----------
    gauge_x : (n_gauge_x,) distinct gauge stations [m].
    meridional, hoop : (n_gauge_x, max_harmonic + 1, n_x) normal strains [1/Pa]; they go as cos(m phi).
    shear : same shape; tensor shear strain between the meridional (aft) and the circumferential direction
        (increasing phi) [1/Pa]; it goes as sin(m phi).
    """

    gauge_x: FloatArray
    meridional: FloatArray
    hoop: FloatArray
    shear: FloatArray

    @property
    def max_harmonic(self) -> int:
        return self.meridional.shape[1] - 1


def strain_rows(mesh: MeridianMesh, x: FloatArray, harmonic: int) -> FloatArray:
    """Return strain on the inner surface per displacement amplitude.

    The strains of a surface follow from displacements on it alone:
    meridional du/ds . t, hoop (u_r + m u_phi)/r, and shear
    (du_phi/ds - u_phi t_r/r - m (u . t)/r)/2, with t the tangent and s the length along it.

    Parameters
    ----------
    mesh : the mesh.
    x : (n,) stations [m] on the inner surface.
    harmonic : the harmonic m.

    Returns
    -------
    (n, 3, n_dof) [1/m]: meridional, hoop, shear (tensor).
    """
    point, n = inner_surface_points(mesh, x), len(x)
    rows = np.zeros((n, 3, len(mesh.node), 3))
    rows[np.arange(n)[:, None], :, point.node] = strain_of_nodes(point, harmonic)
    return rows.reshape(n, 3, mesh.n_dof)


def strain_of_nodes(point: SurfacePoints, harmonic: int) -> FloatArray:
    """Return (n, nodes, 3 strains, 3 displacements) [1/m] of the nodes of the edge that each point is on."""
    t_x, t_r = point.tangent.T[:, :, None]
    by_s, over_r = point.slope, point.value / point.radius[:, None]
    local = np.zeros((*point.node.shape, 3, 3))
    local[:, :, 0, 0], local[:, :, 0, 1] = by_s * t_x, by_s * t_r
    local[:, :, 1, 1], local[:, :, 1, 2] = over_r, harmonic * over_r
    local[:, :, 2, 0], local[:, :, 2, 1] = -0.5 * harmonic * over_r * t_x, -0.5 * harmonic * over_r * t_r
    local[:, :, 2, 2] = 0.5 * (by_s - over_r * t_r)
    return local


def strain_of_displacements(mesh: MeridianMesh, x: FloatArray, harmonic: int, moved: FloatArray) -> FloatArray:
    """Return (n, 3, k) the strains of :func:`strain_rows` at stations ``x`` (n,) of displacements (n_dof, k)."""
    point = inner_surface_points(mesh, x)
    of_nodes = strain_of_nodes(point, harmonic).transpose(0, 2, 1, 3).reshape(len(x), 3, -1)
    at_nodes = moved.reshape(len(mesh.node), 3, -1)[point.node]  # n, nodes, 3 displacements, k
    return np.asarray(of_nodes @ at_nodes.reshape(len(x), of_nodes.shape[2], -1))


def harmonic_response(
    mesh: MeridianMesh,
    material: Material,
    gauge_x: FloatArray,
    station_x: FloatArray,
    max_harmonic: int,
    progress: Progress | None = None,
) -> HarmonicResponse:
    """Compute the strain at gauge stations per pressure at surface stations, harmonic by harmonic.

    Parameters
    ----------
    mesh : mesh with its supports.
    material : of the wall.
    gauge_x : stations of gauges [m] on the inner surface, in any order; equal ones are solved for once.
    station_x : (n_x,) stations [m] of the pressure, as in ``SurfaceGrid.x``.
    max_harmonic : highest harmonic in roll angle.
    progress : called with (harmonics done, harmonics in all) after each harmonic.

    Raises
    ------
    InputError
        ``max_harmonic`` is negative, stations do not cover the surface, or supports leave a motion free.
    """
    distinct, n_x = distinct_stations(gauge_x), len(station_x)
    if (
        3 * len(distinct) > n_x and mesh.masses is None
    ):  # fewer solutions: one per pressure; inertia needs the other
        fields = [np.eye(n_x)] * (max_harmonic + 1)
        response = np.stack(response_to_fields(mesh, material, distinct, station_x, fields, progress), axis=2)
    else:
        response = response_of_rows(
            mesh, material, lambda m: strain_rows(mesh, distinct, m), station_x, max_harmonic, progress
        )
    meridional, hoop, shear = response.reshape(len(distinct), 3, max_harmonic + 1, n_x).transpose(1, 0, 2, 3)
    return HarmonicResponse(gauge_x=distinct, meridional=meridional, hoop=hoop, shear=shear)


def response_of_rows(
    mesh: MeridianMesh,
    material: Material,
    rows: Callable[[int], FloatArray],
    station_x: FloatArray,
    max_harmonic: int,
    progress: Progress | None = None,
) -> FloatArray:
    """Return what linear functions of the displacements read per pressure at surface stations.

    Parameters and errors are as in :func:`harmonic_response`; ``rows`` gives the functions (.., n_dof) of a
    harmonic's amplitudes.

    Returns
    -------
    (n_rows, max_harmonic + 1, n_x), per pascal.
    """
    if max_harmonic < 0:
        raise InputError(f"max_harmonic {max_harmonic} must be at least 0")
    stiffness, load = assemble_stiffness(mesh, material), pressure_load(mesh, station_x)

    def of_harmonic(m: int) -> FloatArray:
        adjoint = _solver(mesh, stiffness, m).solve(rows(m).reshape(-1, mesh.n_dof).T)
        return np.asarray((load.T @ adjoint).T)

    return np.stack(_each_harmonic(of_harmonic, max_harmonic + 1, progress), axis=1)


def response_to_fields(
    mesh: MeridianMesh,
    material: Material,
    gauge_x: FloatArray,
    station_x: FloatArray,
    fields: Sequence[FloatArray],
    progress: Progress | None = None,
) -> list[FloatArray]:
    """Return the strain at gauge stations under given pressures, harmonic by harmonic: one solution per pressure.

    With many stations and few pressures this is cheaper than :func:`harmonic_response`, which has one per station.

    Parameters
    ----------
    mesh, material, station_x, progress : as in :func:`harmonic_response`.
    gauge_x : (n,) stations [m] on the inner surface.
    fields : per harmonic m, (n_x, k_m) pressures at the stations ``station_x`` times cos(m phi).

    Returns
    -------
    Per harmonic (n, 3, k_m): meridional, hoop and shear strain per unit of the pressures.
    """
    stiffness, load = assemble_stiffness(mesh, material), pressure_load(mesh, station_x)

    def of_harmonic(m: int) -> FloatArray:
        if not fields[m].any():
            return np.zeros((len(gauge_x), 3, fields[m].shape[1]))
        moved = _solver(mesh, stiffness, m).solve(np.asarray(load @ fields[m]))
        return strain_of_displacements(mesh, gauge_x, m, moved)

    return _each_harmonic(of_harmonic, len(fields), progress)


def _each_harmonic(
    of_harmonic: Callable[[int], FloatArray], count: int, progress: Progress | None
) -> list[FloatArray]:
    """Return what each of the first harmonics gives."""
    parts = []
    # The solver releases the interpreter lock, so harmonics run in parallel; BLAS threads would compete.
    with one_thread_of_blas(), ThreadPoolExecutor(min(processors(), count)) as pool:
        for m, part in enumerate(pool.map(of_harmonic, range(count))):
            parts.append(part)
            if progress is not None:
                progress(m + 1, count)
    return parts


def _solver(mesh: MeridianMesh, stiffness: FourierStiffness, m: int) -> HarmonicSolver | FlyingSolver:
    """Return the factored stiffness of harmonic ``m``, in free flight with the inertia that balances the load."""
    flies = m < 2 and mesh.masses is not None
    return FlyingSolver(mesh, stiffness, m) if flies else factor_harmonic(mesh, stiffness, m)


def distinct_stations(x: FloatArray) -> FloatArray:
    """Return the distinct values of ``x`` in increasing order, those within a nanometre taken as one."""
    ordered = np.sort(np.asarray(x, dtype=float))
    return ordered[np.diff(ordered, prepend=-np.inf) > SAME_STATION]


def strain_operator(response: HarmonicResponse, gauges: PlacedGauges, grid: SurfaceGrid) -> FloatArray:
    """Return Z_p, the strain of every gauge per pressure at every surface node.

    The pressure in roll is the trigonometric interpolant of the nodal values, harmonics above
    ``max_harmonic`` left out; at the Nyquist harmonic it is the cosine alone. A pressure ~ sin(m phi) is
    the cosine one rolled by a quarter period, so the sum over cosine and sine parts depends on the roll
    angle between gauge and node only.

    Parameters
    ----------
    response : strain per station pressure; it has the stations of ``grid``.
    gauges : the gauges, at stations of ``response``.
    grid : pressure nodes, node = station * n_roll + roll index.

    Returns
    -------
    (n_gauges, n_nodes) [1/Pa].

    Raises
    ------
    InputError
        The grid has too few roll angles for ``max_harmonic``, or the response is of other stations.
    """
    if response.hoop.shape[2] != len(grid.x):
        raise InputError(f"the response has {response.hoop.shape[2]} surface stations, the grid {len(grid.x)}")
    even, odd = _along_gauges(gauges, response.gauge_x, response.meridional, response.hoop, response.shear)
    return operator_in_roll(even, odd, gauges.roll_angle, grid)


def strain_harmonics(response: HarmonicResponse, gauges: PlacedGauges, harmonics: ComplexArray) -> ComplexArray:
    """Return the product of Z_p's conjugate harmonics round the body with the pressures' ones, without Z_p.

    Parameters
    ----------
    response, gauges : as in :func:`strain_operator`.
    harmonics : (n_m, N, n_x) of N pressures round the body, at the stations of the grid [Pa].

    Returns
    -------
    (n_gauges, N, n_m) with as many harmonics as both have.
    """
    n_m = min(len(harmonics), response.max_harmonic + 1)
    pressure = harmonics[:n_m].transpose(0, 2, 1)  # n_m, n_x, N
    strain = (response.meridional, response.hoop, response.shear)
    under = ((part[:, :n_m].transpose(1, 0, 2) @ pressure).transpose(1, 2, 0) for part in strain)
    even, odd = _along_gauges(gauges, response.gauge_x, *under)
    # The harmonic of even cos m(phi - psi) + odd sin m(phi - psi) is (even - i odd) exp(-i m psi).
    return (even + 1j * odd) * np.exp(1j * gauges.roll_angle[:, None] * np.arange(n_m))[:, None]


def _along_gauges(
    gauges: PlacedGauges, station_x: FloatArray, meridional: Any, hoop: Any, shear: Any
) -> tuple[Any, Any]:
    """Return (n_gauges, ..) strain of gauges that goes as cos(m phi) and as sin(m phi).

    It follows from the wall's strains (n_stations, ..) at ``station_x``.
    """
    station = station_index(station_x, gauges.x)
    c, s = gauges.meridional[:, None, None], gauges.circumferential[:, None, None]
    return c**2 * meridional[station] + s**2 * hoop[station], 2.0 * c * s * shear[station]


def operator_in_roll(even: FloatArray, odd: FloatArray, roll_angle: FloatArray, grid: SurfaceGrid) -> FloatArray:
    """Return readings per nodal pressure from those per harmonic of the pressure.

    Parameters
    ----------
    even, odd : (n, max_harmonic + 1, n_x) parts that go as cos(m phi) and sin(m phi) [unit/Pa].
    roll_angle : (n,) of the readings [rad].
    grid : pressure nodes, node = station * n_roll + roll index.

    Returns
    -------
    (n, n_nodes) [unit/Pa].

    Raises
    ------
    InputError
        The grid has too few roll angles for the harmonics.
    """
    top, n_roll = even.shape[1] - 1, grid.n_roll
    if top > n_roll // 2:
        raise InputError(f"max_harmonic {top} needs at least {2 * top} roll angles, the grid has {n_roll}")
    m = np.arange(top + 1)
    weight = np.where((m == 0) | (2 * m == n_roll), 1.0, 2.0) / n_roll
    # cos m(phi - psi) and sin m(phi - psi) by cosine and sine of m psi at the nodes, which all readings share.
    # At the Nyquist harmonic sin(m phi) vanishes on every node, so the rolled sine part is zero by itself.
    node = np.outer(m, grid.roll_angle)
    waves = np.concatenate([weight[:, None] * np.cos(node), weight[:, None] * np.sin(node)])
    z = np.empty((len(roll_angle), len(grid.x), n_roll))
    for first in range(0, len(z), READINGS_AT_ONCE):
        some = slice(first, first + READINGS_AT_ONCE)
        phase = m[:, None] * roll_angle[some, None, None]
        cosine, sine = np.cos(phase), np.sin(phase)
        along, across = even[some] * cosine + odd[some] * sine, even[some] * sine - odd[some] * cosine
        np.matmul(np.concatenate([along, across], axis=1).transpose(0, 2, 1), waves, out=z[some])
    return z.reshape(len(roll_angle), grid.n_nodes)


def station_index(station_x: FloatArray, x: FloatArray) -> NDArray[np.intp]:
    """Return the index of the station nearest to each ``x`` [m], refusing those that have none."""
    index = np.abs(x[:, None] - station_x).argmin(axis=1)
    for i in np.flatnonzero(np.abs(x - station_x[index]) > 2.0 * SAME_STATION):
        raise InputError(f"gauge {i + 1}: the response holds no station at x = {x[i]:.6g} m")
    return index
