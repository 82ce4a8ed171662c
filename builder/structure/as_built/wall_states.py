"""Strain at the gauges per nodal force: of the wall as expected, of thinner and thicker regions, of uneven ones.

Loads act on the outer surface, or on the body as a whole in the lowest harmonics (weight, inner pressure). Only
these rows of the adjoint solutions are kept.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from builder.reporting import Progress
from builder.structure.as_built.wall_changes import (
    SIDES,
    WAVES,
    ElasticClamp,
    ExpectedWall,
    StifferRegion,
    ThickerWall,
    UnevenChange,
    harmonic_product,
    moved_elements,
    uneven_adjoints,
)
from builder.structure.as_built.wall_regions import WallRegions, thickened
from builder.structure.fourier.fourier_elasticity import FourierStiffness
from builder.structure.fourier.inner_surface import PlacedGauges
from builder.structure.fourier.meridian_mesh import MeridianMesh, line_nodes
from builder.structure.fourier.strain_operator import distinct_stations, station_index, strain_rows
from builder.structure.loads.fourier import FourierStructure
from builder.structure.loads.loaded_structure import LoadProperties
from builder.structure.wall import Wall
from strainfmu.arrays import BoolArray, FloatArray, IntArray
from strainfmu.errors import InputError

LOW = 5
"""Harmonics, from 0, in which loads may act within the wall and on its inner surface."""

ROUNDING = 1e-9
"""Forces relative to the largest that count as none."""

WALL_STEP = 0.04
"""Step of the thickness of a region, relative to it."""

THICKNESS_STEP = 2e-3
"""Step of the derivatives by the thickness and the taper of a region, relative to the thickness."""

HARMONIC_STEP = 1e-3
"""Step of the derivative by the amplitude of an uneven wall, relative to the thickness."""

CHANGED_PART, CHANGED_BY_FLOW = 5.0 / 6.0, 10
"""Part of the harmonics of known loads in which changes of the wall count, and the highest of a flow.

A change of 3 % needs less accuracy than what it changes: of pads that need twelve harmonics, the others of the
change are below 2e-5 of a case's largest strain, and of flows below 3e-5."""


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

    def split(self, force: FloatArray) -> SplitForces:
        """Return nodal forces (2, n_m, n_nodes, 3) on the outer surface and within."""
        loaded: BoolArray = np.asarray(np.moveaxis(force, 2, 0).reshape(self.n_nodes, -1).any(axis=1))
        loaded_nodes = np.flatnonzero(loaded[self.outer])
        span = slice(loaded_nodes[0], loaded_nodes[-1] + 1) if len(loaded_nodes) else slice(0)
        outer = force[:, :, self.outer[span]].reshape(2, force.shape[1], -1)
        columns = slice(3 * span.start, 3 * span.stop) if len(loaded_nodes) else span
        if not loaded[self.inner].any():
            return SplitForces(columns=columns, outer=outer, within=None)
        high = force[:, LOW:, self.inner]
        if max(high.max(initial=0.0), -high.min(initial=0.0)) > ROUNDING * np.abs(force).max():
            raise InputError(f"load: expected harmonics up to {LOW - 1} within the wall, got higher ones")
        within = force[:, :LOW].copy()
        within[:, :, self.outer] = 0.0
        return SplitForces(columns=columns, outer=outer, within=within.reshape(*within.shape[:2], -1))

    @cached_property
    def inner(self) -> IntArray:
        """(n,) the other nodes."""
        return np.setdiff1d(np.arange(self.n_nodes), self.outer)


@dataclass(frozen=True, eq=False, kw_only=True)
class SplitForces:
    """Nodal forces in two families of harmonics.

    Attributes
    ----------
    columns : where ``outer`` is among the (3 n_out) components on the outer surface; a pad loads few of them.
    outer : (2, n_m, k) forces there [N].
    within : (2, LOW, n_dof) of the other nodes, zero on the outer surface; None where they are not loaded.
    """

    columns: slice
    outer: FloatArray
    within: FloatArray | None


@dataclass(frozen=True, eq=False, kw_only=True)
class Adjoint:
    """Strain per nodal force: meridional, hoop and shear at n_s stations.

    Attributes
    ----------
    outer : (.., n_m, n_s, 3, 3 n_out) of forces on the outer surface [1/N].
    low : for each of the lowest harmonics, at most LOW, (.., n_s, 3, n_dof) of all forces [1/N].
    """

    outer: FloatArray
    low: tuple[FloatArray, ...]

    def strain(self, forces: SplitForces) -> FloatArray:
        """Return (.., 2, n_m, n_s, 3) amplitudes of strain under forces, in the harmonics of the adjoint."""
        n_m = self.outer.shape[-4]
        strain = _product(self.outer[..., forces.columns], forces.outer[:, :n_m])
        if forces.within is None:
            return strain
        highest_within = np.abs(forces.within[:, len(self.low) :]).max(initial=0.0)
        if highest_within > ROUNDING * np.abs(forces.within).max():
            raise InputError(
                f"load: expected harmonics up to {len(self.low) - 1} within the wall, got higher ones"
            )
        for n, adjoint in enumerate(self.low[: forces.within.shape[1]]):
            strain[..., n : n + 1, :, :] += _product(adjoint[..., None, :, :, :], forces.within[:, n : n + 1])
        return strain

    def at_stations(self, rows: IntArray) -> Adjoint:
        """Return the same at stations ``rows``."""
        return Adjoint(
            outer=self.outer[..., rows, :, :], low=tuple(adjoint[..., rows, :, :] for adjoint in self.low)
        )


def _product(adjoint: FloatArray, force: FloatArray) -> FloatArray:
    """Return (.., 2, n_m, n_s, 3) of (.., n_m, n_s, 3, n) and (2, n_m, n): by BLAS, which einsum would not do."""
    *lead, n_s, _, n = adjoint.shape
    product = adjoint.reshape(*lead, 3 * n_s, n) @ force.transpose(1, 2, 0)  # .., n_m, 3 n_s, 2
    return np.asarray(np.moveaxis(product, -1, -3).reshape(*lead[:-1], 2, lead[-1], n_s, 3))


@dataclass(frozen=True, eq=False, kw_only=True)
class WallStates:
    """All that strain under any load follows from; stations are distinct ones.

    Attributes
    ----------
    rows : nodal forces that count.
    nominal, fore, aft : of the wall as expected at the stations, and a step ahead of and behind them.
    wall, wall_twice : per relative thickness of each region, then per taper of each, and per their squares; empty
        where the wall is known. These and the next two have the harmonics in which changes count.
    uneven : for each of :data:`~builder.structure.as_built.wall_changes.WAVES`, (n_r, 3 sides) per region of a
        wall whose thickness goes as cos(wave phi), as in
        :data:`~builder.structure.as_built.wall_changes.SIDES`.
    soft : derivatives by the clamp's compliance along and across the body, then by the softness of each joint,
        then by the modulus of each region, where that is not known.
    forces : structures that give nodal forces only: of the wall as expected, thin ones, thick ones.
    station : (n_d,) of each gauge.
    """

    rows: ForceRows
    nominal: Adjoint
    fore: Adjoint
    aft: Adjoint
    wall: tuple[Adjoint, ...]
    wall_twice: tuple[Adjoint, ...]
    uneven: tuple[Adjoint, ...]
    soft: tuple[Adjoint, ...]
    forces: tuple[FourierStructure, tuple[FourierStructure, ...], tuple[FourierStructure, ...]]
    station: IntArray

    def with_wall(self, thickness: FloatArray) -> Adjoint:
        """Return the nominal state with the ``thickness`` (n_t,) that multiplies :attr:`wall`."""
        outer, low = self.nominal.outer.copy(), [part.copy() for part in self.nominal.low]
        for size, first, second in zip(thickness, self.wall, self.wall_twice, strict=False):
            if size != 0.0:
                outer[: len(first.outer)] += size * (first.outer + size * second.outer)
                for part, by_size, by_square in zip(low, first.low, second.low, strict=False):
                    part += size * (by_size + size * by_square)
        return Adjoint(outer=outer, low=tuple(low))


def wall_states(
    mesh: MeridianMesh,
    wall: Wall,
    regions: WallRegions,
    gauges: PlacedGauges,
    along: FloatArray,
    properties: LoadProperties,
    max_harmonic: int,
    changed_harmonic: int,
    changed_within: int = LOW - 1,
    with_regions: bool = True,
    with_moduli: bool = False,
    joints: Sequence[float] = (),
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
    max_harmonic, changed_harmonic : highest harmonic in roll angle, and the highest in which changes of the wall
        count, as by :func:`changed_harmonic_of`.
    changed_within : highest harmonic of loads within the wall and on its inner surface, where the wall changes.
    with_regions : whether thickness and taper by regions are not known.
    with_moduli : whether Young's modulus by regions is not known.
    joints : stations at which the wall may be softer [m].
    progress : called with (harmonics done, harmonics in all).
    """
    rows = ForceRows(outer=np.unique(line_nodes(mesh.outer_edge)), n_nodes=len(mesh.node))
    n_m, count = max_harmonic + 1, 2 * len(regions)
    x, first = _stations(gauges.x)
    moved = np.concatenate([x - along[first], x, x + along[first]])
    stations = distinct_stations(moved)
    fore, middle, aft = station_index(stations, moved).reshape(3, -1)
    pairs = [_thin_and_thick(mesh, wall, regions, k, WALL_STEP) for k in range(count)]
    expected = ExpectedWall(mesh, wall.material, stations, middle, n_m)
    thicker = [_thicker(expected, wall, regions, k) for k in range(count if with_regions else 0)]
    uneven = [_uneven_change(expected, wall, regions, k) for k in range(len(regions))]
    clamp = None if mesh.masses is not None else ElasticClamp(mesh, wall.material)
    stiffer = [_soft_joint(mesh, wall, station, expected.stiffness) for station in joints]
    stiffer += _stiffer_regions(mesh, wall, regions, expected.stiffness) if with_moduli else []
    unchanged = _Kept((), n_m, len(stations), rows)
    changed = changed_harmonic + 1
    of_wall, of_square, of_soft, of_uneven = (
        _Kept(lead, changed, len(x), rows, min(LOW, changed_within + 1))
        for lead in (
            (len(thicker),),
            (len(thicker),),
            (2 + len(stiffer),),
            (len(WAVES), len(regions), len(SIDES)),
        )
    )
    for n in range(n_m):
        solver, adjoint = expected.at_harmonic(n)
        unchanged.take(n, adjoint)
        if progress is not None:
            progress(n + 1, n_m)
        if n >= changed:
            continue
        for number, wall_change in enumerate(thicker):
            per_change, per_square = wall_change.adjoints(solver, n)
            of_wall.take(n, per_change, number)
            of_square.take(n, per_square, number)
        if clamp is not None:
            of_soft.take(n, clamp.adjoints(expected.stiffness, solver, strain_rows(mesh, x, n), n), slice(2))
        for number, region in enumerate(stiffer, start=2):
            of_soft.take(n, region.adjoint(expected.at_gauges(n), solver, n), number)
        for place, change in uneven_adjoints(uneven, expected, solver, n):
            of_uneven.take(n, change, *place)
    bare = [
        _forces_only(changed_mesh, wall, properties, max_harmonic)
        for changed_mesh in (mesh, *itertools.chain(*pairs))
    ]
    return WallStates(
        rows=rows,
        nominal=unchanged.adjoint.at_stations(middle),
        fore=unchanged.adjoint.at_stations(fore),
        aft=unchanged.adjoint.at_stations(aft),
        wall=of_wall.by_first,
        wall_twice=of_square.by_first,
        uneven=of_uneven.by_first,
        soft=of_soft.by_first,
        forces=(bare[0], tuple(bare[1::2]), tuple(bare[2::2])),
        station=station_index(x, gauges.x),
    )


def changed_harmonic_of(of_loads: int, of_flows: int) -> int:
    """Return the highest harmonic in which changes of the wall count, by the highest of loads and of flows."""
    return max(math.ceil(CHANGED_PART * of_loads), min(CHANGED_BY_FLOW, of_flows))


def _thin_and_thick(
    mesh: MeridianMesh, wall: Wall, regions: WallRegions, k: int, step: float
) -> tuple[MeridianMesh, MeridianMesh]:
    """Return the meshes of a wall that is thinner and thicker by ``step`` in region ``k``, then of one that
    tapers."""
    even, taper = np.split(step * np.eye(2 * len(regions))[k], 2)
    thin, thick = (thickened(mesh, wall, regions, sign * even, sign * taper) for sign in (-1.0, 1.0))
    return thin, thick


def _thicker(expected: ExpectedWall, wall: Wall, regions: WallRegions, k: int) -> ThickerWall:
    """Return the wall that is thicker in region ``k``, then the one that tapers."""
    minus, plus = _thin_and_thick(expected.mesh, wall, regions, k, THICKNESS_STEP)
    return ThickerWall(minus, plus, THICKNESS_STEP, expected, wall.material)


def _stiffer_regions(
    mesh: MeridianMesh, wall: Wall, regions: WallRegions, even: FourierStiffness
) -> list[StifferRegion]:
    """Return the walls whose modulus is larger in one region each."""
    share = regions.share(mesh.node[mesh.element, 0].mean(axis=1))
    return [StifferRegion(mesh, wall.material, weight, even) for weight in share.T]


def _soft_joint(mesh: MeridianMesh, wall: Wall, station: float, even: FourierStiffness) -> StifferRegion:
    """Return the wall with a joint at ``station`` [m], per length of wall that it yields like.

    It is in the elements through the wall that are nearest.
    """
    x = mesh.node[mesh.element, 0]
    first, last = mesh.node[line_nodes(mesh.inner_edge)[[0, -1]], 0]
    if not first < station < last:
        raise InputError(
            f"calibration.joint_stations_m: expected stations of the wall, {first:g} .. {last:g} m, "
            f"got {station:g}"
        )
    distance = np.abs(x.mean(axis=1) - station)
    length = float(np.ptp(x[distance.argmin()]))
    nearest = distance < distance.min() + 0.25 * length
    return StifferRegion(mesh, wall.material, nearest.astype(np.float64), even, size=-1.0 / length)


def _uneven_change(expected: ExpectedWall, wall: Wall, regions: WallRegions, k: int) -> UnevenChange:
    """Return the derivative by the amplitude of an uneven wall in region ``k``."""
    step, region = HARMONIC_STEP, np.eye(len(regions))[k]
    plus, minus = (thickened(expected.mesh, wall, regions, sign * step * region) for sign in (1.0, -1.0))
    moved, even = moved_elements(plus, minus), expected.stiffness
    of_plus, of_minus = (harmonic_product(wall_mesh, wall.material, even, moved) for wall_mesh in (plus, minus))
    return UnevenChange(plus, minus, step, expected.x, of_plus.less(of_minus, 2.0 * step))


def _stations(x: FloatArray) -> tuple[FloatArray, IntArray]:
    """Return the distinct stations (n_s,) and a gauge at each."""
    stations = distinct_stations(x)
    return stations, np.abs(stations[:, None] - x).argmin(axis=1)


def _at_stations(x: FloatArray) -> PlacedGauges:
    zero = np.zeros(len(x))
    return PlacedGauges(x=x, roll_angle=zero, meridional=zero, circumferential=zero)


class _Kept:
    """The rows that count of adjoints (.., n_m, n_s, 3, n_dof), harmonic by harmonic."""

    def __init__(self, lead: tuple[int, ...], n_m: int, n_s: int, rows: ForceRows, n_low: int = LOW) -> None:
        """Make room for ``lead`` adjoints; those that are not taken are zero."""
        self._rows = rows
        self._outer = np.zeros((*lead, n_m, n_s, 3, 3 * len(rows.outer)))
        self._low = np.zeros((min(n_low, n_m), *lead, n_s, 3, 3 * rows.n_nodes))

    def take(self, n: int, adjoint: FloatArray, *place: int | slice) -> None:
        """Keep adjoints (.., n_s, 3, n_dof) of harmonic ``n`` at ``place`` of the first dimensions."""
        by_node = adjoint.reshape(*adjoint.shape[:-1], -1, 3)
        outer = self._outer[(*place, ..., n, slice(None), slice(None), slice(None))]
        outer = outer.reshape(*outer.shape[:-1], -1, 3)
        np.take(by_node, self._rows.outer, axis=-2, out=outer, mode="clip")
        if n < len(self._low):
            self._low[(n, *place)] = adjoint

    @property
    def adjoint(self) -> Adjoint:
        return Adjoint(outer=self._outer, low=tuple(self._low))

    @property
    def by_first(self) -> tuple[Adjoint, ...]:
        """One adjoint for each of the first dimension."""
        return tuple(
            Adjoint(outer=outer, low=tuple(adjoint[k] for adjoint in self._low))
            for k, outer in enumerate(self._outer)
        )


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
