"""Strain at the gauges per nodal force: of the wall as expected, of thinner and thicker regions, of uneven ones.

Loads act on the outer surface, or on the body as a whole in the lowest harmonics (weight, inner pressure). Only
these rows of the adjoint solutions are kept.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from builder.calibration.wall_harmonics import SIDES, WAVES, harmonic_product, neighbour_weight, reflected
from builder.calibration.wall_regions import WallRegions, thickened
from builder.reporting import Progress
from builder.structure.fourier.fourier_elasticity import assemble_stiffness, factor_harmonic
from builder.structure.fourier.gauges import PlacedGauges
from builder.structure.fourier.meridian_mesh import MeridianMesh, line_nodes
from builder.structure.fourier.strain_operator import distinct_stations, station_index, strain_rows
from builder.structure.loads.fourier import FourierStructure, fourier_structure
from builder.structure.loads.loaded_structure import LoadProperties
from builder.structure.wall import Wall
from strainfmu.arrays import FloatArray, IntArray
from strainfmu.errors import InputError

LOW = 5
"""Harmonics, from 0, in which loads may act within the wall and on its inner surface."""

ROUNDING = 1e-9
"""Forces relative to the largest that count as none."""

WALL_STEP = 0.04
"""Step of the thickness of a region, relative to it."""

HARMONIC_STEP = 1e-3
"""Step of the derivative by the amplitude of an uneven wall, relative to the thickness."""


@dataclass(frozen=True, eq=False, kw_only=True)
class ForceRows:
    """Which nodal forces count.

    Attributes
    ----------
    outer : (n_out,) nodes of the outer surface.
    n_nodes : of the mesh.
    """

    outer: IntArray
    n_nodes: int

    def split(self, force: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return nodal forces (2, n_m, n_nodes, 3) on the outer surface (2, n_m, 3 n_out), and within (2, LOW, n).

        Raises
        ------
        InputError
            Forces within the wall go round the body faster than harmonic LOW - 1.
        """
        within = force.copy()
        within[:, :, self.outer] = 0.0
        if np.abs(within[:, LOW:]).max(initial=0.0) > ROUNDING * np.abs(force).max(initial=0.0):
            raise InputError(f"load: expected harmonics up to {LOW - 1} within the wall, got higher ones")
        return (
            force[:, :, self.outer].reshape(2, force.shape[1], -1),
            within[:, :LOW].reshape(2, min(LOW, force.shape[1]), -1),
        )


@dataclass(frozen=True, eq=False, kw_only=True)
class Adjoint:
    """Strain per nodal force: meridional, hoop and shear at n_s stations.

    Attributes
    ----------
    outer : (.., n_m, n_s, 3, 3 n_out) of forces on the outer surface [1/N].
    low : (.., LOW, n_s, 3, n_dof) of all forces in the lowest harmonics [1/N].
    """

    outer: FloatArray
    low: FloatArray

    def strain(self, forces: tuple[FloatArray, FloatArray]) -> FloatArray:
        """Return (.., 2, n_m, n_s, 3) amplitudes of strain under split forces."""
        outer, within = forces
        found = _product(self.outer, outer)
        if within.any():
            found[..., : within.shape[1], :, :] += _product(self.low, within)
        return found

    def at(self, rows: IntArray) -> Adjoint:
        """Return the same at stations ``rows``."""
        return Adjoint(outer=self.outer[..., rows, :, :], low=self.low[..., rows, :, :])


def _product(adjoint: FloatArray, force: FloatArray) -> FloatArray:
    """Return (.., 2, n_m, n_s, 3) of (.., n_m, n_s, 3, n) and (2, n_m, n): by BLAS, which einsum would not do."""
    *lead, n_s, _, n = adjoint.shape
    found = adjoint.reshape(*lead, 3 * n_s, n) @ force.transpose(1, 2, 0)  # .., n_m, 3 n_s, 2
    return np.asarray(np.moveaxis(found, -1, -3).reshape(*lead[:-1], 2, lead[-1], n_s, 3))


@dataclass(frozen=True, eq=False, kw_only=True)
class WallStates:
    """All that strain under any load follows from; stations are distinct ones.

    Attributes
    ----------
    rows : nodal forces that count.
    nominal, fore, aft : of the wall as expected at the stations, and a step ahead of and behind them.
    thin, thick : per region, of a wall thinner and thicker there, then of one that tapers towards its aft end and
        towards its fore end; empty where the wall is known.
    uneven : for each of :data:`~builder.calibration.wall_harmonics.WAVES`, (n_r, 3 sides) per region of a wall
        whose thickness goes as cos(wave phi), as in :data:`~builder.calibration.wall_harmonics.SIDES`.
    forces : structures that give nodal forces only: of the wall as expected, thin ones, thick ones.
    station : (n_d,) of each gauge.
    """

    rows: ForceRows
    nominal: Adjoint
    fore: Adjoint
    aft: Adjoint
    thin: tuple[Adjoint, ...]
    thick: tuple[Adjoint, ...]
    uneven: tuple[Adjoint, ...]
    forces: tuple[FourierStructure, tuple[FourierStructure, ...], tuple[FourierStructure, ...]]
    station: IntArray


def wall_states(
    mesh: MeridianMesh,
    wall: Wall,
    regions: WallRegions,
    gauges: PlacedGauges,
    along: FloatArray,
    properties: LoadProperties,
    max_harmonic: int,
    with_regions: bool = True,
    progress: Progress | None = None,
) -> WallStates:
    """Solve every state of the wall for the strains at the gauges.

    Parameters
    ----------
    mesh : of the wall as expected.
    wall : its thickness and material.
    regions : of the wall.
    gauges : on the inner surface.
    along : (n_d,) step of the stations [m].
    properties : density and what else loads need.
    max_harmonic : highest harmonic in roll angle.
    with_regions : whether thickness and taper by regions are not known.
    progress : called with (states done, states in all).
    """
    outer = np.unique(line_nodes(mesh.outer_edge))
    rows = ForceRows(outer=outer, n_nodes=len(mesh.node))
    n_r = len(regions)
    meshes = {0: mesh}
    for k in range(2 * n_r):
        even, taper = np.split(WALL_STEP * np.eye(2 * n_r)[k], 2)
        meshes[-1 - k], meshes[1 + k] = (
            thickened(mesh, wall, regions, sign * even, sign * taper) for sign in (-1.0, 1.0)
        )
    states = list(meshes) if with_regions else [0]
    steps = len(states) + 1

    def solved(key: int, x: FloatArray) -> FourierStructure:
        made = fourier_structure(meshes[key], wall.material, _at_stations(x), properties, max_harmonic)
        if progress is not None:
            progress(states.index(key) + 1, steps)
        return made

    x, first = _stations(gauges.x)
    step = along[first]
    full = solved(0, np.concatenate([x - step, x, x + step]))
    place = full.station.reshape(3, -1)
    whole = _kept(full.adjoint, rows)
    uneven = _uneven(mesh, wall, regions, x, full.adjoint[:, place[1]], rows)
    changed = {key: _kept(solved(key, x).adjoint, rows) for key in states[1:]}
    bare = {key: _forces_only(one, wall, properties, max_harmonic) for key, one in meshes.items()}
    order = range(1, 2 * n_r + 1)
    if progress is not None:
        progress(steps, steps)
    return WallStates(
        rows=rows,
        nominal=whole.at(place[1]),
        fore=whole.at(place[0]),
        aft=whole.at(place[2]),
        thin=tuple(changed[-k] for k in order if -k in changed),
        thick=tuple(changed[k] for k in order if k in changed),
        uneven=uneven,
        forces=(bare[0], tuple(bare[-k] for k in order), tuple(bare[k] for k in order)),
        station=station_index(x, gauges.x),
    )


def _stations(x: FloatArray) -> tuple[FloatArray, IntArray]:
    """Return the distinct stations (n_s,) and a gauge at each."""
    stations = distinct_stations(x)
    return stations, np.abs(stations[:, None] - x).argmin(axis=1)


def _at_stations(x: FloatArray) -> PlacedGauges:
    zero = np.zeros(len(x))
    return PlacedGauges(x=x, roll_angle=zero, meridional=zero, circumferential=zero)


def _kept(adjoint: FloatArray, rows: ForceRows) -> Adjoint:
    """Return the rows that count of (.., n_m, n_s, 3, n_dof)."""
    by_node = adjoint.reshape(*adjoint.shape[:-1], rows.n_nodes, 3)
    outer = by_node[..., rows.outer, :].reshape(*adjoint.shape[:-1], -1)
    return Adjoint(outer=outer, low=adjoint[..., :LOW, :, :, :].copy())


def _forces_only(
    mesh: MeridianMesh, wall: Wall, properties: LoadProperties, max_harmonic: int
) -> FourierStructure:
    """Return a structure without gauges, for the nodal forces of loads."""
    return FourierStructure(
        mesh=mesh,
        material=wall.material,
        properties=properties,
        gauges=_at_stations(np.zeros(0)),
        station=np.zeros(0, dtype=np.intp),
        adjoint=np.zeros((max_harmonic + 1, 0, 3, mesh.n_dof)),
    )


def _uneven(
    mesh: MeridianMesh, wall: Wall, regions: WallRegions, x: FloatArray, adjoint: FloatArray, rows: ForceRows
) -> tuple[Adjoint, ...]:
    """Return for each wave (n_r, 3 sides) change of the adjoint by the amplitude of cos(wave phi).

    ``adjoint`` (n_m, n_s, 3, n_dof) is that of the even wall; the load's harmonic is n.
    """
    n_m, n_s, _, n_dof = adjoint.shape
    n_r, step = len(regions), HARMONIC_STEP
    stiffness = assemble_stiffness(mesh, wall.material)
    pairs = [[thickened(mesh, wall, regions, s * step * np.eye(n_r)[k]) for s in (1.0, -1.0)] for k in range(n_r)]
    products = [
        harmonic_product(plus, wall.material).less(harmonic_product(minus, wall.material), 2.0 * step)
        for plus, minus in pairs
    ]
    lead = (len(WAVES), n_r, len(SIDES))
    outer = np.zeros((*lead, n_m, n_s, 3, 3 * len(rows.outer)))
    low = np.zeros((*lead, min(LOW, n_m), n_s, 3, n_dof))
    for n in range(n_m):
        load = np.zeros((*lead, 3 * n_s, n_dof))
        for k, (plus, minus) in enumerate(pairs):
            change = (strain_rows(plus, x, n) - strain_rows(minus, x, n)) / (2.0 * step)
            load[:, k, SIDES.index(0)] = change.reshape(-1, n_dof)
            for number, wave in enumerate(WAVES):
                for side in (-1, 1):
                    m = n + wave * side
                    if (m >= 0 or n > 0) and abs(m) < n_m:
                        motion = (adjoint[m] if m >= 0 else reflected(adjoint[-m])).reshape(-1, n_dof).T
                        force = products[k].times(n, m, motion).T
                        load[number, k, SIDES.index(side)] = -neighbour_weight(n) * force
        solved = factor_harmonic(mesh, stiffness, n, twist=True).solve(load.reshape(-1, n_dof).T).T
        part = solved.reshape(*lead, n_s, 3, n_dof)
        by_node = part.reshape(*part.shape[:-1], rows.n_nodes, 3)
        outer[..., n, :, :, :] = by_node[..., rows.outer, :].reshape(*part.shape[:-1], -1)
        if n < LOW:
            low[..., n, :, :, :] = part
    return tuple(Adjoint(outer=a, low=b) for a, b in zip(outer, low, strict=True))
