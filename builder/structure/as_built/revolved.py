"""A wall of revolution as built under pressure, solved for as few errors as a vehicle file states.

The wall of the file, its thickness as a whole, the gauges' stations and the clamp have solutions of their own; all
else follows from :mod:`builder.structure.as_built.as_built_structure`, which is solved where [noise] states such
an error. Strain is a parabola in the thickness and a line along the meridian and in the compliance of the clamp.
Roll and direction of the gauges are exact.
"""

from __future__ import annotations

from collections.abc import Callable, Collection
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from builder.structure.as_built.as_built_structure import SHIFT, AsBuiltStructure, as_built_structure
from builder.structure.as_built.as_built_vehicle import AsBuilt, Counts
from builder.structure.as_built.gauge_strain_terms import (
    BuiltGauges,
    FlightGauges,
    WallGauges,
    gain_of,
    operator_of,
    rows_of,
)
from builder.structure.as_built.reading_slopes import CLAMP
from builder.structure.as_built.response_tables import ResponseTable, of_all_vehicles
from builder.structure.as_built.wall_changes import WAVES
from builder.structure.as_built.wall_regions import counts_of, wall_regions
from builder.structure.as_built_kinds import BY_REGION, IN_NOISE, KINDS
from builder.structure.fourier.inner_surface import PlacedGauges, inner_surface_points
from builder.structure.fourier.meridian_mesh import MeridianMesh
from builder.structure.fourier.shell_mesh import MeshedWall, meshed_wall, yielding_clamp
from builder.structure.fourier.strain_operator import (
    HarmonicResponse,
    distinct_stations,
    harmonic_response,
    station_index,
)
from builder.vehicle.file import Vehicle
from builder.vehicle.shape.geometry import SurfaceGrid
from strainfmu.arrays import ComplexArray, FloatArray, IntArray
from strainfmu.errors import InputError

CLAMP_STEP, RIGID = 2e-3, 1e-7
"""Length of wall that yields as the clamp does, for its slope, and one that counts as none [m]."""

SOLVED = ("axial_shift", "wall_thickness", *CLAMP)
"""Kinds that have solutions of their own. Those of gauges need none."""


@dataclass(frozen=True, eq=False, kw_only=True)
class RevolvedStructure:
    """Strain of every gauge per harmonic of the pressure, of any vehicle as built.

    Attributes
    ----------
    names : of the n_d gauges.
    on_wall : the gauges on the inner surface.
    counts : numbers of what has errors of its own.
    surface : the pressure nodes.
    table : amplitudes per pressure at the stations of ``surface``, which lead [1/Pa].
    solved : kinds among :data:`SOLVED` and :data:`~builder.structure.as_built_kinds.BY_REGION` that may differ.
    """

    names: tuple[str, ...]
    on_wall: WallGauges
    counts: Counts
    surface: SurfaceGrid
    table: ResponseTable
    solved: frozenset[str]

    @property
    def placed(self) -> PlacedGauges:
        return self.on_wall.placed

    @property
    def n_harmonics(self) -> int:
        return int(self.table.nominal.shape[-3])

    def parts(self, as_built: AsBuilt, table: ResponseTable | None = None) -> BuiltGauges:
        """Return the gauges of a vehicle ``as_built``, or of many at once.

        ``table`` holds amplitudes under other pressures; None takes those per pressure at the stations.
        """
        for kind in (*SOLVED, *BY_REGION):
            if kind not in self.solved and getattr(as_built, kind).any():
                entry = KINDS[kind].entry
                raise InputError(f"{KINDS[kind].in_words}: this structure was solved without; noise.{entry} is 0")
        return self.on_wall.parts(self.table if table is None else table, as_built, self._thickness(as_built))

    def _thickness(self, as_built: AsBuilt) -> FloatArray:
        """Return (.., n_t) what the rows of the wall in the table are multiplied by, or (n_d,) as each gauge sees
        it."""
        thickness = as_built.of_all("wall_thickness")
        if "wall_taper" not in self.solved or thickness.shape[-1] != 1:
            return thickness
        rows = len(self.table.wall) - as_built.wall_taper.shape[-1]
        return np.concatenate(of_all_vehicles(thickness[..., :rows], as_built.wall_taper), axis=-1)

    def flight_gauges(self, as_built: AsBuilt, n_harmonics: int) -> FlightGauges:
        """Return the gauges of a vehicle ``as_built``, at as many harmonics as were solved for."""
        gauges, none = self.parts(as_built), np.zeros(len(self.names))
        response = np.stack([gauges.even, gauges.odd], axis=-1).transpose(2, 1, 0, 3)  # n_d, n_m, n_x, 2
        response = response * gain_of(as_built)[:, None, None, None]
        return FlightGauges(
            names=self.names,
            roll_angle=gauges.roll_angle,
            response=response,
            apparent=none + as_built.apparent_strain,
            per_ambient=-as_built.internal_pressure.item() * response[:, 0, :, 0].sum(axis=1),
            per_dynamic=none,
            record=as_built.record(IN_NOISE),
        )

    def strain_operator(self, as_built: AsBuilt) -> FloatArray:
        """Return Z_p (n_d, n_p) [1/Pa] of one vehicle: reading per pressure at every node of ``surface``."""
        return operator_of(self.parts(as_built), as_built, self.surface)

    def strain_amplitudes(self, as_built: AsBuilt) -> ComplexArray:
        """Return (n_d, k, n_m) the harmonics round the body of the strain at each gauge, under each of the k
        pressures of :attr:`table`: sum over m of Re(a_m e^(-i m psi)) where the pressure is rolled by psi."""
        gauges, harmonic = self.parts(as_built), np.arange(self.n_harmonics)[:, None]
        size = gain_of(as_built) / (1.0 + as_built.youngs_modulus)
        amplitudes = (gauges.even - 1j * gauges.odd) * (size * np.exp(1j * harmonic * gauges.roll_angle))
        return np.asarray(amplitudes.transpose(2, 0, 1))

    def some(self, gauges: IntArray) -> RevolvedStructure:
        """Return the structure with some of the ``gauges``, by their numbers."""
        on_wall = self.on_wall.some(gauges)
        stations, station = np.unique(on_wall.station, return_inverse=True)
        return replace(
            self,
            names=tuple(self.names[gauge] for gauge in gauges),
            on_wall=replace(on_wall, station=station),
            counts=self.counts._replace(gauge=len(gauges)),
            table=changed_alike(self.table, lambda strain: strain[..., stations, :]),
        )


def revolved_structure(
    vehicle: Vehicle,
    layout: str,
    names: tuple[str, ...],
    placed: PlacedGauges,
    nominal: HarmonicResponse,
    surface: SurfaceGrid,
    kinds: Collection[str],
    wall_step: float,
) -> RevolvedStructure:
    """Return the structure of gauges ``placed`` on the wall, solved for ``kinds`` of error.

    Parameters
    ----------
    layout, names : of the gauges, and theirs.
    nominal : response of the wall of the file at their stations, to pressure at the nodes of ``surface``.
    wall_step : of the wall's thickness, relative to it.

    Raises
    ------
    InputError
        The wall does not fit the body, a gauge lies within a step of the end of its surface, or the clamp is none.
    """
    solved = frozenset(kinds).intersection((*SOLVED, *BY_REGION))
    walled, x = meshed_wall(vehicle), distinct_stations(placed.x)
    table = revolved_table(walled, nominal, x, surface, solved, wall_step)
    if not solved.isdisjoint(BY_REGION):
        regions = len(wall_regions(vehicle.calibration, walled.wall, walled.body))
        by_region = as_built_structure(
            vehicle,
            layout,
            vehicle.resolution.map.model_copy(update={"harmonics": nominal.max_harmonic}),
            known_thickness=None if "wall_taper" in solved else np.zeros(regions),
            max_harmonic=nominal.max_harmonic,
            surface=surface,
        )
        table = _with_regions(table, by_region, "wall_taper" in solved)
    return RevolvedStructure(
        names=names,
        on_wall=WallGauges(
            placed=placed,
            radius=inner_surface_points(walled.mesh(), placed.x).radius,
            row=rows_of(placed.roll_angle),
            station=station_index(x, placed.x),
        ),
        counts=counts_of(vehicle, placed.roll_angle, in_flight=True),
        surface=surface,
        table=table,
        solved=solved,
    )


def revolved_table(
    walled: MeshedWall,
    nominal: HarmonicResponse,
    x: FloatArray,
    surface: SurfaceGrid,
    kinds: Collection[str],
    wall_step: float,
) -> ResponseTable:
    """Return the table of ``kinds`` among :data:`SOLVED` about the ``nominal`` response, at stations ``x`` (n_s,).

    What changes is small: the mesh of the map shows it as well as a finer one. The rest is as in
    :func:`revolved_structure`.
    """
    wall, mesh = walled.wall, walled.mesh()
    material = wall.material

    def amplitudes_at(on: MeridianMesh, *stations: FloatArray) -> list[FloatArray]:
        response = harmonic_response(on, material, np.concatenate(stations), surface.x, nominal.max_harmonic)
        return [amplitudes(response, station) for station in stations]

    expected = amplitudes(nominal, x)
    along, wall_rows, soft = None, np.zeros((2, 0, *expected.shape)), np.zeros((0, *expected.shape))
    if "axial_shift" in kinds:
        step = SHIFT * inner_surface_points(mesh, x).tangent[:, 0]
        fore, middle, aft = amplitudes_at(mesh, x - step, x, x + step)
        along = (aft - fore) / (2.0 * SHIFT)
    elif "wall_thickness" in kinds:
        (middle,) = amplitudes_at(mesh, x)
    if "wall_thickness" in kinds:
        walls = (walled.mesh(wall.thicker(factor)) for factor in (1.0 - wall_step, 1.0 + wall_step))
        thin, thick = (amplitudes_at(mesh_of_wall, x)[0] for mesh_of_wall in walls)
        slope, bend = (thick - thin) / (2.0 * wall_step), (thick - 2.0 * middle + thin) / (2.0 * wall_step**2)
        wall_rows = np.stack([slope[None], bend[None]])
    if not set(CLAMP).isdisjoint(kinds):
        lengths = (RIGID, RIGID), (CLAMP_STEP, RIGID), (RIGID, CLAMP_STEP)
        yielding = [amplitudes_at(yielding_clamp(mesh, material, *length), x)[0] for length in lengths]
        soft = np.array([yielding[1] - yielding[0], yielding[2] - yielding[0]]) / CLAMP_STEP
    return ResponseTable(
        nominal=expected,
        along=along,
        along_twice=None,
        wall=wall_rows[0],
        wall_twice=wall_rows[1],
        uneven=np.zeros((len(WAVES), 2, 0, 3, *expected.shape)),
        soft=soft,
    )


def _with_regions(table: ResponseTable, by_region: AsBuiltStructure, with_taper: bool) -> ResponseTable:
    """Return ``table`` with changes by regions of the wall and by joints."""
    solved, n_r = by_region.pressure, by_region.n_regions
    clamp = table.soft if len(table.soft) else solved.soft[: len(CLAMP)]
    changed = replace(
        table,
        uneven=solved.uneven,
        soft=np.concatenate([clamp, solved.soft[len(CLAMP) :]]),
    )
    if not with_taper:
        return changed
    return replace(
        changed,
        wall=np.concatenate([table.wall, solved.wall[n_r:]]),
        wall_twice=np.concatenate([table.wall_twice, solved.wall_twice[n_r:]]),
    )


def table_under(table: ResponseTable, pressure: FloatArray | ComplexArray) -> ResponseTable:
    """Return ``table`` under pressures (k, n_x, n_m), which lead instead of the stations.

    Of each harmonic m the pressures at the stations times the amplitudes per pressure there are one product. The
    phase of a pressure round the body makes the table complex.
    """
    k, _, n_m = pressure.shape
    of_harmonic = np.moveaxis(pressure, 2, 0)  # n_m, k, n_x

    def under(responses: FloatArray) -> Any:
        lead, (n_x, _, n_s, n_c) = responses.shape[:-4], responses.shape[-4:]
        by_station = np.moveaxis(responses[..., :n_m, :, :], -3, -4).reshape(*lead, n_m, n_x, n_s * n_c)
        return np.moveaxis((of_harmonic @ by_station).reshape(*lead, n_m, k, n_s, n_c), -4, -3)

    return changed_alike(table, under)


def amplitudes(response: HarmonicResponse, x: FloatArray | None = None) -> FloatArray:
    """Return (n_x, n_m, n_s, 3) [1/Pa] at the stations ``x`` (n_s,) of the response, all by default."""
    station: Any = slice(None) if x is None else station_index(response.gauge_x, x)
    parts = (response.meridional, response.hoop, response.shear)
    return np.stack([part.T[:, :, station] for part in parts], axis=-1)


def changed_alike(table: ResponseTable, change: Callable[[FloatArray], FloatArray]) -> ResponseTable:
    """Return the table with every array changed alike; ``change`` takes (.., n_x, n_m, n_s, 3)."""
    arrays = {name: change(value) for name, value in vars(table).items() if value is not None}
    return replace(table, **arrays)
