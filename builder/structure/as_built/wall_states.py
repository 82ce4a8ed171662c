"""Strain at the gauges under loads: of the wall as expected, of thinner and thicker regions, of uneven ones.

Loads act on the outer surface, or on the body as a whole in the lowest harmonics (weight, inner pressure). Only
these rows of the adjoint solutions of the expected wall stay in memory. Strain by changes of the wall is computed
for the loads that are asked for, harmonic by harmonic.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from builder.processors import one_thread_of_blas
from builder.reporting import Progress
from builder.structure.as_built.wall_changes import (
    SIDES,
    WAVES,
    ElasticClamp,
    ExpectedWall,
    StifferRegion,
    ThickerWall,
    UnevenChange,
    moved_by,
    solved,
)
from builder.structure.as_built.wall_regions import WallRegions, thickened
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
        by_component = force.reshape(-1, 3 * self.n_nodes).any(axis=0)
        loaded: BoolArray = np.asarray(by_component.reshape(-1, 3).any(axis=1))
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

    def of_harmonic(self, forces: Sequence[SplitForces], n: int) -> FloatArray:
        """Return the nodal forces (n_dof, 2 k) of k loads in harmonic ``n``, both families of a load in turn."""
        joined = np.zeros((len(forces), 2, 3 * self.n_nodes))
        outer = (3 * self.outer[:, None] + np.arange(3)).ravel()
        for families, force in zip(joined, forces, strict=True):
            families[:, outer[force.columns]] = force.outer[:, n]
            if force.within is not None and n < force.within.shape[1]:
                families += force.within[:, n]
        return joined.reshape(-1, 3 * self.n_nodes).T

    def of_outer(self, adjoint: FloatArray) -> FloatArray:
        """Return what of an ``adjoint`` (n_s, 3, n_dof) is by forces on the outer surface, (n_s, 3, 3 n_out)."""
        by_node = adjoint.reshape(*adjoint.shape[:-1], self.n_nodes, 3)
        return by_node[..., self.outer, :].reshape(*adjoint.shape[:-1], -1)

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
    outer : (n_m, n_s, 3, 3 n_out) of forces on the outer surface [1/N].
    low : (LOW, n_s, 3, n_dof) of all forces in the lowest harmonics [1/N].
    """

    outer: FloatArray
    low: FloatArray

    def strain(self, forces: SplitForces) -> FloatArray:
        """Return (2, n_m, n_s, 3) amplitudes of strain under forces."""
        strain = _product(self.outer[..., forces.columns], forces.outer)
        if forces.within is not None:
            strain[:, : len(self.low)] += _product(self.low, forces.within)
        return strain

    def at_stations(self, rows: IntArray) -> Adjoint:
        """Return the same at stations ``rows``."""
        return Adjoint(outer=self.outer[:, rows], low=self.low[:, rows])


def _product(adjoint: FloatArray, force: FloatArray) -> FloatArray:
    """Return (2, n_m, n_s, 3) of (n_m, n_s, 3, n) and (2, n_m, n): by BLAS, which einsum would not do."""
    n_m, n_s, _, n = adjoint.shape
    product = adjoint.reshape(n_m, 3 * n_s, n) @ force.transpose(1, 2, 0)  # n_m, 3 n_s, 2
    return np.asarray(np.moveaxis(product, -1, 0).reshape(2, n_m, n_s, 3))


@dataclass(frozen=True, eq=False, kw_only=True)
class ChangedStrain:
    """Amplitudes of the strain that k loads make more on walls that differ, in the harmonics in which that counts.

    Attributes
    ----------
    wall, wall_twice : (n_t, k, n_m, n_s, 3) per relative thickness of each region, then per taper of each, and per
        their squares; empty where the wall is known.
    uneven : (n_w, n_r, 3 sides, k, n_m, n_s, 3) per region of a wall whose thickness goes as cos(wave phi), for
        each of :data:`~builder.structure.as_built.wall_changes.WAVES` and of
        :data:`~builder.structure.as_built.wall_changes.SIDES`.
    soft : (n_soft, k, n_m, n_s, 3) per compliance of the clamp along and across the body, then per softness of
        each joint, then per modulus of each region, where that is not known.
    """

    wall: FloatArray
    wall_twice: FloatArray
    uneven: FloatArray
    soft: FloatArray

    def of_loads(self, some: slice, n_m: int | None = None) -> ChangedStrain:
        """Return the same of ``some`` of the loads, up to ``n_m`` harmonics."""
        return ChangedStrain(**{name: value[..., some, :n_m, :, :] for name, value in vars(self).items()})

    def of_families(self, some: slice) -> ChangedStrain:
        """Return the same of ``some`` of the loads, which are both families of others in turn: (.., k, 2, ..)."""
        return ChangedStrain(
            **{
                name: part.reshape(*part.shape[:-4], part.shape[-4] // 2, 2, *part.shape[-3:])
                for name, part in vars(self.of_loads(some)).items()
            }
        )


@dataclass(frozen=True, eq=False, kw_only=True)
class WallChanges:
    """What may differ of the wall, ready for any load; stations are the gauges' distinct ones.

    Attributes
    ----------
    mesh, wall : as expected.
    x : (n_s,) stations [m].
    n_m, n_changed : number of harmonics, and of those in which changes of the wall count.
    """

    mesh: MeridianMesh
    wall: Wall
    regions: WallRegions
    x: FloatArray
    n_m: int
    n_changed: int
    with_regions: bool
    with_moduli: bool
    joints: tuple[float, ...]

    @property
    def n_walls(self) -> int:
        """Number of thicknesses and tapers that are not known."""
        return 2 * len(self.regions) if self.with_regions else 0

    @property
    def n_soft(self) -> int:
        """Number of compliances, softnesses and moduli that are not known."""
        return 2 + len(self.joints) + (len(self.regions) if self.with_moduli else 0)

    def strain(self, force: Callable[[int], FloatArray], k: int, n_m: int) -> ChangedStrain:
        """Return what k loads strain, whose nodal forces in a harmonic are ``force`` (n_dof, k), up to ``n_m``
        harmonics."""
        n_m, shape = min(n_m, self.n_changed), (len(self.x), 3)
        strain = ChangedStrain(
            wall=np.zeros((self.n_walls, k, n_m, *shape)),
            wall_twice=np.zeros((self.n_walls, k, n_m, *shape)),
            uneven=np.zeros((len(WAVES), len(self.regions), len(SIDES), k, n_m, *shape)),
            soft=np.zeros((self.n_soft, k, n_m, *shape)),
        )
        with one_thread_of_blas():
            for n in range(n_m):
                self._add_strain(strain, force(n), n)
        self._expected.forget(self.n_m)
        return strain

    def _add_strain(self, strain: ChangedStrain, force: FloatArray, n: int) -> None:
        """Set harmonic ``n`` of ``strain`` to what forces (n_dof, k) strain."""
        loaded = np.flatnonzero(force.any(axis=0))
        if not len(loaded):
            return
        acting = force[:, loaded]
        moved = moved_by(self._expected.at_harmonic(n), acting).T
        last, motion = None, acting
        for name, place, rows, dof in self._rows(n):
            if dof is not last:  # rows of one change follow one another
                last, motion = dof, acting if dof is None else moved[:, dof].T
            of_rows = rows.reshape(-1, rows.shape[-1]) @ motion
            getattr(strain, name)[place][loaded, n] = of_rows.T.reshape(-1, len(self.x), 3)

    def thicker_adjoint(self, thickness: FloatArray, n: int) -> FloatArray:
        """Return what a ``thickness`` (n_t,) of :attr:`ChangedStrain.wall` changes of the adjoint (n_s, 3, n_dof)
        of harmonic ``n``; harmonics follow one another."""
        solver = self._expected.at_harmonic(n)
        total = np.zeros((len(self.x), 3, self.mesh.n_dof))
        for size, wall in zip(thickness, self._thicker, strict=False):
            if size != 0.0:
                first, second = wall.rows(n)
                total[..., wall.dof] += size * (first + size * second)
        return solved(solver, total)

    def _rows(self, n: int) -> Iterator[tuple[str, tuple[int, ...], FloatArray, IntArray | None]]:
        """Yield rows (n_s, 3, n) of harmonic ``n``, with where in a :class:`ChangedStrain` their product belongs:
        with the motion of the dofs (n,), or with the forces where these are None."""
        expected = self._expected
        solver = expected.at_harmonic(n)
        for number, wall in enumerate(self._thicker):
            first, second = wall.rows(n)
            yield "wall", (number,), first, wall.dof
            yield "wall_twice", (number,), second, wall.dof
        if self._clamp is not None:
            adjoints = self._clamp.adjoints(expected.stiffness, solver, strain_rows(self.mesh, self.x, n), n)
            for number, adjoint in enumerate(adjoints):
                yield "soft", (number,), adjoint, None
        for number, region in enumerate(self._stiffer, start=2):
            yield "soft", (number,), region.rows(n), region.dof
        for number, change in enumerate(self._uneven):
            for wave, side, rows in change.rows(n):
                yield "uneven", (wave, number, side), rows, change.dof

    @cached_property
    def _expected(self) -> ExpectedWall:
        return ExpectedWall(self.mesh, self.wall.material, self.x, self.n_m)

    @cached_property
    def _thicker(self) -> list[ThickerWall]:
        """Walls with one thicker region each, then walls with one tapered region each."""
        pairs = thin_and_thick(self.mesh, self.wall, self.regions, THICKNESS_STEP)[: self.n_walls]
        return [ThickerWall(minus, plus, THICKNESS_STEP, self._expected) for minus, plus in pairs]

    @cached_property
    def _uneven(self) -> list[UnevenChange]:
        pairs = thin_and_thick(self.mesh, self.wall, self.regions, HARMONIC_STEP)[: len(self.regions)]
        return [UnevenChange(plus, minus, HARMONIC_STEP, self._expected) for minus, plus in pairs]

    @cached_property
    def _stiffer(self) -> list[StifferRegion]:
        """The wall with each joint, then the ones whose modulus is larger in one region."""
        soft = [_soft_joint(self._expected, station) for station in self.joints]
        if not self.with_moduli:
            return soft
        share = self.regions.share(self.mesh.node[self.mesh.element, 0].mean(axis=1))
        return soft + [StifferRegion(self._expected, weight) for weight in share.T]

    @cached_property
    def _clamp(self) -> ElasticClamp | None:
        return None if self.mesh.masses is not None else ElasticClamp(self.mesh, self.wall.material)


@dataclass(frozen=True, eq=False, kw_only=True)
class WallStates:
    """All that strain under any load follows from; stations are distinct ones.

    Attributes
    ----------
    rows : nodal forces that count.
    nominal, fore, aft : of the wall as expected at the stations, and a step ahead of and behind them.
    changes : what may differ of the wall.
    forces : structures that give nodal forces only: of the wall as expected, thin ones, thick ones.
    station : (n_d,) of each gauge.
    """

    rows: ForceRows
    nominal: Adjoint
    fore: Adjoint
    aft: Adjoint
    changes: WallChanges
    forces: tuple[FourierStructure, tuple[FourierStructure, ...], tuple[FourierStructure, ...]]
    station: IntArray

    def with_wall(self, thickness: FloatArray) -> Adjoint:
        """Return the nominal state with the ``thickness`` (n_t,) of :attr:`ChangedStrain.wall`."""
        outer, low = self.nominal.outer.copy(), self.nominal.low.copy()
        for n in range(self.changes.n_changed if thickness.any() else 0):
            change = self.changes.thicker_adjoint(thickness, n)
            outer[n] += self.rows.of_outer(change)
            if n < len(low):
                low[n] += change
        return Adjoint(outer=outer, low=low)


def wall_states(
    mesh: MeridianMesh,
    wall: Wall,
    regions: WallRegions,
    gauges: PlacedGauges,
    along: FloatArray,
    properties: LoadProperties,
    max_harmonic: int,
    changed_harmonic: int,
    with_regions: bool = True,
    with_moduli: bool = False,
    joints: Sequence[float] = (),
    progress: Progress | None = None,
) -> WallStates:
    """Solve the wall as expected for the strains at the gauges, and prepare what may differ of it.

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
    with_regions : whether thickness and taper by regions are not known.
    with_moduli : whether Young's modulus by regions is not known.
    joints : stations at which the wall may be softer [m].
    progress : called with (harmonics done, harmonics in all).
    """
    rows = ForceRows(outer=np.unique(line_nodes(mesh.outer_edge)), n_nodes=len(mesh.node))
    n_m = max_harmonic + 1
    x, first = _stations(gauges.x)
    moved = np.concatenate([x - along[first], x, x + along[first]])
    stations = distinct_stations(moved)
    fore, middle, aft = station_index(stations, moved).reshape(3, -1)
    expected = ExpectedWall(mesh, wall.material, stations, n_m)
    outer = np.empty((n_m, len(stations), 3, 3 * len(rows.outer)))
    low = np.empty((min(LOW, n_m), len(stations), 3, mesh.n_dof))
    for n in range(n_m):
        expected.at_harmonic(n)
        adjoint = expected.adjoint(n)
        outer[n] = rows.of_outer(adjoint)
        if n < len(low):
            low[n] = adjoint
        if progress is not None:
            progress(n + 1, n_m)
    unchanged = Adjoint(outer=outer, low=low)
    pairs = thin_and_thick(mesh, wall, regions, WALL_STEP)
    bare = [
        _forces_only(changed_mesh, wall, properties, max_harmonic)
        for changed_mesh in (mesh, *itertools.chain(*pairs))
    ]
    changes = WallChanges(
        mesh=mesh,
        wall=wall,
        regions=regions,
        x=x,
        n_m=n_m,
        n_changed=changed_harmonic + 1,
        with_regions=with_regions,
        with_moduli=with_moduli,
        joints=tuple(joints),
    )
    return WallStates(
        rows=rows,
        nominal=unchanged.at_stations(middle),
        fore=unchanged.at_stations(fore),
        aft=unchanged.at_stations(aft),
        changes=changes,
        forces=(bare[0], tuple(bare[1::2]), tuple(bare[2::2])),
        station=station_index(x, gauges.x),
    )


def changed_harmonic_of(of_loads: int, of_flows: int) -> int:
    """Return the highest harmonic in which changes of the wall count, by the highest of loads and of flows."""
    return max(math.ceil(CHANGED_PART * of_loads), min(CHANGED_BY_FLOW, of_flows))


def thin_and_thick(
    mesh: MeridianMesh, wall: Wall, regions: WallRegions, step: float
) -> list[tuple[MeridianMesh, MeridianMesh]]:
    """Return the meshes of a wall that is thinner and thicker by ``step`` in each region, then of those that
    taper."""
    pairs = []
    for change in step * np.eye(2 * len(regions)):
        even, taper = np.split(change, 2)
        thin, thick = (thickened(mesh, wall, regions, sign * even, sign * taper) for sign in (-1.0, 1.0))
        pairs.append((thin, thick))
    return pairs


def _soft_joint(expected: ExpectedWall, station: float) -> StifferRegion:
    """Return the wall with a joint at ``station`` [m], per length of wall that it yields like.

    It is in the elements through the wall that are nearest.
    """
    mesh = expected.mesh
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
    return StifferRegion(expected, nearest.astype(np.float64), size=-1.0 / length)


def _stations(x: FloatArray) -> tuple[FloatArray, IntArray]:
    """Return the distinct stations (n_s,) and a gauge at each."""
    stations = distinct_stations(x)
    return stations, np.abs(stations[:, None] - x).argmin(axis=1)


def _at_stations(x: FloatArray) -> PlacedGauges:
    zero = np.zeros(len(x))
    return PlacedGauges(x=x, roll_angle=zero, meridional=zero, circumferential=zero)


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
