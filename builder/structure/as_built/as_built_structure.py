"""Strain of a vehicle as built: under any pressure on its surface, and under any known load.

The semi-analytic model is solved once, for the wall of the drawing, for every region thinner and thicker, for
tapered and uneven walls, and at stations ahead of and behind the gauges. What a vehicle as built reads follows by
parabolas in the thickness of each region and along the meridian, to second order in taper, to first order in the
uneven wall and the compliance of the clamp, and exactly in gains, mass, Young's modulus, direction, transverse
sensitivity and roll angle of the gauges:

    reading = (1 + common) (1 + gain) / (1 + E) a(theta) . strain(theta) + zero,

times 1 + mass under own weight and inertia.

Any resolution will do, so that a finer one plays the vehicle that is tested.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property, partial

import numpy as np

from builder.reporting import Progress
from builder.structure.as_built.as_built_vehicle import (
    AsBuilt,
    BuiltStructure,
    Counts,
    Key,
    StrainOfLoads,
    as_built_std,
    derivative_keys,
    exactly_built,
)
from builder.structure.as_built.gauge_strain_terms import FlightGauges, WallGauges, gain_of, operator_of, rows_of
from builder.structure.as_built.reading_slopes import load_slopes, operator_slopes, read_load
from builder.structure.as_built.response_tables import (
    LoadResponse,
    ResponseTable,
    combined,
    nominal_table,
    together,
)
from builder.structure.as_built.wall_changes import WAVES, rolled_quarter, times_waves
from builder.structure.as_built.wall_regions import WallRegions, counts_of, thickened, wall_regions
from builder.structure.as_built.wall_states import (
    ROUNDING,
    WALL_STEP,
    Adjoint,
    ChangedStrain,
    SplitForces,
    WallStates,
    changed_harmonic_of,
    wall_states,
)
from builder.structure.as_built_kinds import AS_BUILT
from builder.structure.fourier.fourier_model import (
    ERROR_HARMONICS,
    place_layouts,
    refuse_beyond_fourier,
    structural_model_on,
    with_mesh_error,
)
from builder.structure.fourier.inner_surface import PlacedGauges, inner_surface_points
from builder.structure.fourier.shell_mesh import meshed_wall
from builder.structure.fourier.strain_operator import pressure_load
from builder.structure.fourier.wall_layup import TOUCHES, change_stations
from builder.structure.loads.applied import (
    UNIT_VECTORS,
    Acceleration,
    ApparentStrain,
    Load,
    SurfacePressure,
    Weight,
)
from builder.structure.loads.fourier import MAX_HARMONIC, FourierStructure
from builder.structure.loads.gauge_strain import nodal_force
from builder.structure.loads.loaded_structure import INNER, LoadProperties
from builder.structure.loads.of_vehicle import load_properties
from builder.structure.loads.temperature import TemperatureField
from builder.vehicle.file import Vehicle
from builder.vehicle.gauges.layout import GaugeLayout
from builder.vehicle.map_options import Calibration
from builder.vehicle.model_entries import Resolution
from builder.vehicle.shape.geometry import SurfaceGrid, surface_grid
from strainfmu.arrays import BoolArray, FloatArray, IntArray
from strainfmu.errors import InputError

SHIFT = 1e-3
"""Step along the surface [m]."""

OF_MASS = (Weight, Acceleration)
"""Loads that go with the vehicle's mass."""

WITHIN_THE_WALL = (Weight, Acceleration, TemperatureField)
"""Loads whose forces change with the wall."""


@dataclass(frozen=True, eq=False, kw_only=True)
class AsBuiltStructure(BuiltStructure):
    """The structure of a vehicle with what may differ from its drawing.

    Attributes
    ----------
    surface : pressure nodes.
    regions : of the wall.
    gauges : names, positions and directions by the drawing.
    on_wall : the gauges on the inner surface.
    solved : the vehicle whose wall was solved for, without other errors; others are taken from there.
    states : adjoint solutions.
    joint_stations : where the wall may be softer [m].
    at_break : (n_d,) whether a gauge is within one element of a change of slope, thickness or material. Strain has
        a kink there: its change along the meridian is taken to first order.
    n_harmonics : number of harmonics of a pressure.
    in_flight : the same vehicle in free flight, where the test alone holds it; its inertia is the drawing's.
    mesh_error : (n_d, n_p) of the drawing's strain operator [1/Pa]; found when it is first asked for.
    """

    surface: SurfaceGrid
    regions: WallRegions
    gauges: GaugeLayout
    on_wall: WallGauges
    solved: AsBuilt
    states: WallStates
    n_harmonics: int
    joint_stations: tuple[float, ...]
    at_break: BoolArray
    _mesh_error: Callable[[], FloatArray | None]
    in_flight: AsBuiltStructure | None = None
    _responses: dict[Load, LoadResponse] = field(default_factory=dict)
    _pressure: list[ResponseTable] = field(default_factory=list)

    @cached_property
    def mesh_error(self) -> FloatArray | None:
        return self._mesh_error()

    @property
    def pressure(self) -> ResponseTable:
        """Table per pressure at the stations of ``surface`` [1/Pa], which lead."""
        if not self._pressure:
            self._solve([])
        return self._pressure[0]

    @property
    def placed(self) -> PlacedGauges:
        return self.on_wall.placed

    @property
    def counts(self) -> Counts:
        """Numbers of what has parameters of its own."""
        return self.solved.counts

    @property
    def has_moduli(self) -> bool:
        """Whether Young's modulus may differ between regions."""
        return self.states.changes.with_moduli

    @property
    def solved_keys(self) -> list[Key]:
        """Keys of all that may differ on this structure."""
        known = {"wall_thickness", "wall_taper"} if not self.states.changes.with_regions else set[str]()
        known |= set() if self.has_moduli else {"region_modulus"}
        return [key for key in derivative_keys(self.counts) if key[0] not in known]

    @property
    def outer_span(self) -> tuple[float, float]:
        """First and last station of the outer surface [m]."""
        return self.loaded.outer_span

    @property
    def loaded(self) -> FourierStructure:
        """The structure that loads act on, without gauges."""
        return self.states.forces[0]

    @property
    def weightless(self) -> str:
        """Why a test cannot have loads of own weight; empty where it can."""
        if self.in_flight is not None:
            return "what a vehicle in free flight carries in the test is not known"
        return "" if self.loaded.properties.density is not None else "material.density_kg_per_m3 is missing"

    def prior(self, entry: Calibration) -> AsBuilt:
        """Return the standard deviation of every parameter before a test, by the section [calibration]."""
        return as_built_std(entry, self.counts)

    def strain_operator(self, parameters: AsBuilt) -> FloatArray:
        """Return Z_p (n_d, n_p) [1/Pa]: reading, without zeros, per pressure at every node of ``surface``."""
        if self.in_flight is not None:
            return self.in_flight.strain_operator(parameters)
        gauges = self.on_wall.parts(self.pressure, parameters, self._thickness(parameters))
        return operator_of(gauges, parameters, self.surface)

    def flight_gauges(self, as_built: AsBuilt, n_harmonics: int) -> FlightGauges:
        """Return the gauges of a vehicle ``as_built``, at harmonics 0 to ``n_harmonics``.

        That holds for an uneven wall as well, whose strain goes round the body otherwise than the pressure does.
        """
        grid, n_d, m = self.surface, self.n_gauges, np.arange(n_harmonics + 1)
        operator = self.strain_operator(as_built).reshape(n_d, len(grid.x), grid.n_roll)
        angle = np.outer(grid.roll_angle, m)
        cosine, sine = (np.moveaxis(operator @ wave(angle), 1, 2) for wave in (np.cos, np.sin))
        c, s = (wave(np.outer(self.placed.roll_angle, m))[:, :, None] for wave in (np.cos, np.sin))
        return FlightGauges(
            names=self.gauges.names,
            roll_angle=self.placed.roll_angle,
            response=np.stack([cosine * c + sine * s, cosine * s - sine * c], axis=-1),
            apparent=as_built.zero,
            per_ambient=np.zeros(n_d),
            per_dynamic=np.zeros(n_d),
            record={kind.name: getattr(as_built, kind.name).tolist() for kind in AS_BUILT},
        )

    def response(self, load: Load) -> LoadResponse:
        """Return what ``load`` strains, kept for the next time; errors as :meth:`load_strain`."""
        if isinstance(load, ApparentStrain):
            return self._apparent(load)
        self.solve_for([load])
        return self._responses[load]

    def responses(self, loads: Sequence[Load]) -> LoadResponse:
        """Return the responses of loads as one, with the readings (n_loads, n_d) of every load."""
        self.solve_for(loads)
        return together([self.response(load) for load in loads])

    def solve_for(self, loads: Sequence[Load]) -> None:
        """Find the responses of ``loads`` together: the first of them costs as much as a hundred more.

        The first loads are solved together with the pressure that flies.
        """
        new = [load for load in loads if load not in self._responses and not isinstance(load, ApparentStrain)]
        units = {load: _along_axes(load) for load in new if isinstance(load, Weight)}
        unsolved: list[Load] = [load for load in new if load not in units]
        unsolved += [unit for parts in units.values() for unit in parts if unit not in self._responses]
        if unsolved := list(dict.fromkeys(unsolved)):
            self._solve(unsolved)
        for load, parts in units.items():
            of_units = [self._responses[unit] for unit in parts]
            self._responses[load] = combined(of_units, np.array(list(parts.values())))

    def response_strain(self, parameters: AsBuilt, response: LoadResponse) -> FloatArray:
        """Return the readings (n_d,) [m/m] under the load of ``response``, (n_loads, n_d) under several."""
        reading = read_load(self.on_wall, response.table, parameters, self._thickness(parameters))
        stiffness = 1.0 + parameters.youngs_modulus * np.asarray(response.by_stress)[..., None]
        weight = 1.0 + parameters.mass * np.asarray(response.by_mass)[..., None]
        return np.asarray(gain_of(parameters) * reading * weight / stiffness + response.constant)

    def response_slopes(
        self, parameters: AsBuilt, response: LoadResponse, keys: Sequence[Key]
    ) -> tuple[FloatArray, dict[Key, FloatArray]]:
        """Return the readings (n_d, n_loads) [m/m] under the loads of ``response``, and their derivatives by
        ``keys``."""
        thickness = self._thickness_that_changes(parameters, keys)
        return load_slopes(self.on_wall, response, parameters, thickness, keys)

    def operator_slopes(
        self, parameters: AsBuilt, keys: Sequence[Key], gauges: slice = slice(None)
    ) -> dict[Key, FloatArray]:
        """Return the derivatives (n_d, n_p) of :meth:`strain_operator` by ``keys``, of some ``gauges``
        [1/Pa per unit]."""
        if self.in_flight is not None:
            return self.in_flight.operator_slopes(parameters, keys, gauges)
        return operator_slopes(
            self.on_wall.some(gauges),
            self.pressure,
            parameters.of_some(gauges),
            thickness=self._thickness_that_changes(parameters, keys),
            grid=self.surface,
            keys=keys,
        )

    def nominal_response(self, loads: Sequence[Load], moves: bool = False) -> LoadResponse:
        """Return what each of ``loads`` strains on the wall that was solved for: for differences between loads.

        It costs a fortieth of :meth:`response`, three times that if a gauge ``moves`` along the surface.
        """
        states, wall = self.states, self.states.forces[0]
        force = {load: states.rows.split(nodal_force(wall, load)) for load in dict.fromkeys(loads)}

        def of_all(state: Adjoint) -> FloatArray:
            return np.stack([state.strain(force[load]) for load in loads], axis=1)

        table = nominal_table(of_all(states.nominal), self.n_regions)
        if moves:
            table = replace(table, along=(of_all(states.aft) - of_all(states.fore)) / (2.0 * SHIFT))
        return LoadResponse(table=table, constant=np.zeros((len(loads), self.n_gauges)))

    def strain_near(self, parameters: AsBuilt) -> StrainOfLoads:
        """Return what each of several loads strains on a wall of the vehicle's mean thickness at each station."""
        nominal = self.states.with_wall(self._thickness(parameters))
        built = replace(self, states=replace(self.states, nominal=nominal))

        def strain(loads: Sequence[Load]) -> FloatArray:
            return self.response_strain(parameters, built.nominal_response(loads, moves=True))

        return strain

    def _apparent(self, load: ApparentStrain) -> LoadResponse:
        if np.shape(load.strain) != (self.n_gauges,):
            raise InputError(f"apparent strain: expected ({self.n_gauges},) values, got {np.shape(load.strain)}")
        table = nominal_table(np.zeros((2, 1, len(self.states.nominal.outer[0]), 3)), self.n_regions)
        return LoadResponse(table=table, constant=np.asarray(load.strain, dtype=float))

    def _solve(self, loads: Sequence[Load]) -> None:
        """Find the responses of ``loads``, and the table of the pressure where it is not found yet."""
        states, acting = self.states, [self._acting(load) for load in loads]
        forces = [force for forces_of_load in acting for force in forces_of_load]
        flies_here = self.in_flight is None and not self._pressure
        pressure = pressure_load(self.loaded.mesh, self.surface.x).toarray() if flies_here else None

        def force(n: int) -> FloatArray:
            of_loads = states.rows.of_harmonic(forces, n)
            if pressure is None:
                return of_loads
            return np.hstack([of_loads, pressure if n < self.n_harmonics else np.zeros_like(pressure)])

        n_m = states.changes.n_m if loads else self.n_harmonics
        k = 2 * len(forces) + (0 if pressure is None else pressure.shape[1])
        changed, end = states.changes.strain(force, k, n_m), 0
        for load, forces_of_load in zip(loads, acting, strict=True):
            start, end = end, end + 2 * len(forces_of_load)
            of_load = changed.of_families(slice(start, end))
            self._responses[load] = self._response_of(load, forces_of_load, of_load)
        if pressure is not None:
            of_pressure = changed.of_loads(slice(end, None), self.n_harmonics)
            self._pressure.append(_pressure_table(states, pressure, self.n_harmonics, self.at_break, of_pressure))

    def _acting(self, load: Load) -> list[SplitForces]:
        """Return the nodal forces of ``load``; and where they change with the wall, what they change per thickness
        and taper of each region, and per their squares."""
        split, changes = self.states.rows.split, self.states.changes
        even, thin, thick = self.states.forces
        force = nodal_force(even, load)
        if not _changes_with_wall(load) or not changes.with_regions:
            return [split(force)]
        lighter, heavier = ([nodal_force(structure, load) for structure in part] for part in (thin, thick))
        pairs = list(zip(lighter, heavier, strict=True))
        first = [split((b - a) / (2.0 * WALL_STEP)) for a, b in pairs]
        second = [split((b - 2.0 * force + a) / (2.0 * WALL_STEP**2)) for a, b in pairs]
        return [split(force), *first, *second]

    def _response_of(self, load: Load, forces: Sequence[SplitForces], changed: ChangedStrain) -> LoadResponse:
        """Return the response to a load of which :meth:`_acting` gives ``forces``; ``changed`` is their strain on
        walls that differ."""
        states, split = self.states, self.states.rows.split
        even, thin, thick = states.forces
        total, uneven_load, region_mass = forces[0], None, None
        wall, wall_twice = changed.wall[:, 0], changed.wall_twice[:, 0]
        if len(forces) > 1:
            wall, wall_twice = self._of_moving_load(forces[1:], changed)
        if _changes_with_wall(load):
            n_r = self.n_regions
            pairs = zip(thin[:n_r], thick[:n_r], strict=True)
            by_thickness = [(nodal_force(b, load) - nodal_force(a, load)) / (2.0 * WALL_STEP) for a, b in pairs]
            waved = map(times_waves, by_thickness)  # region, wave, cosine or sine
            strain = [[[states.nominal.strain(split(f)) for f in parts] for parts in region] for region in waved]
            uneven_load = np.moveaxis(np.array(strain), 0, 2)
        if isinstance(load, OF_MASS):
            force = nodal_force(even, load)
            share = self.regions.mass_share(even.mesh.node[:, 0]).T[:, :, None]
            region_mass = np.array(
                [states.nominal.strain(split(part_of_region * force)) for part_of_region in share]
            )
        # Strain is linear in both families of the load's harmonics, so that it rolls as the load does.
        uneven = [
            np.stack([part, np.moveaxis(rolled_quarter(np.moveaxis(part, (2, 3), (0, 1)), wave), (0, 1), (2, 3))])
            for wave, part in zip(WAVES, changed.uneven[:, :, :, 0], strict=True)
        ]
        table = _table(
            states.nominal.strain(total),
            (states.fore.strain(total), states.aft.strain(total)),
            (wall, wall_twice),
            np.stack(uneven),
            changed.soft[:, 0],
            states.station[self.at_break],
        )
        constant = np.zeros(self.n_gauges)
        if isinstance(load, TemperatureField):
            temperature = load.at(self.placed.x, self.placed.roll_angle, np.zeros(self.n_gauges))
            apparent = np.polynomial.polynomial.polyval(temperature, (0.0, *even.properties.apparent_strain))
            constant = np.asarray(apparent - even.properties.compensation * temperature)
        return LoadResponse(
            table=replace(table, uneven_load=uneven_load, region_mass=region_mass),
            constant=constant,
            by_stress=not isinstance(load, TemperatureField),
            by_mass=isinstance(load, OF_MASS),
        )

    def _of_moving_load(
        self, changes: Sequence[SplitForces], changed: ChangedStrain
    ) -> tuple[FloatArray, FloatArray]:
        """Return what a load that changes with the wall strains per thickness and taper of each region, and per
        their squares: by thin and thick walls a step to both sides.

        ``changes`` are the load's own per thickness and taper, then per their squares.
        """
        n_t, n_m, square = len(changed.wall), changed.wall.shape[-3], WALL_STEP**2
        k = np.arange(n_t)
        by_first, by_second = np.split(
            np.array([self.states.nominal.strain(force)[:, :n_m] for force in changes]), 2
        )
        (wall, wall_of_first, wall_of_second), (twice, twice_of_first, twice_of_second) = (
            (part[:, 0], part[k, 1 + k], part[k, 1 + n_t + k]) for part in (changed.wall, changed.wall_twice)
        )
        by_wall = by_first + wall + square * (wall_of_second + twice_of_first)
        return by_wall, by_second + wall_of_first + twice + square * twice_of_second

    def _thickness_that_changes(self, parameters: AsBuilt, keys: Sequence[Key]) -> FloatArray:
        """Return :meth:`_thickness`; refuse keys of what this structure was not solved for."""
        for kind, _ in keys:
            if kind in ("wall_thickness", "wall_taper", "region_modulus"):
                self._thickness(parameters.changed(**{kind: getattr(parameters, kind) + 1.0}))
        return self._thickness(parameters)

    def _thickness(self, parameters: AsBuilt) -> FloatArray:
        """Return (2 n_r,) thickness and taper of the regions over those that were solved for."""
        wanted, known = (
            np.concatenate([parameters_of.wall_thickness, parameters_of.wall_taper])
            for parameters_of in (parameters, self.solved)
        )
        if not self.states.changes.with_regions and np.abs(wanted - known).max() > 1e-12:
            raise InputError("this structure was solved for one wall; its thickness cannot change")
        if not self.has_moduli and parameters.region_modulus.any():
            raise InputError("this structure was solved for one modulus; calibration.region_modulus_percent is 0")
        return np.asarray(wanted - known)


def _along_axes(load: Weight) -> dict[Load, float]:
    """Return own weight as accelerations along body axes, which attitudes share, each with its size."""
    along = load.acceleration
    axes = np.flatnonzero(np.abs(along) >= ROUNDING * abs(load.gravity))
    return {Acceleration(linear=UNIT_VECTORS[axis]): -float(along[axis]) for axis in axes}


def _changes_with_wall(load: Load) -> bool:
    return isinstance(load, WITHIN_THE_WALL) or (isinstance(load, SurfacePressure) and load.surface == INNER)


def refuse_unheld(vehicle: Vehicle, layout: str) -> None:
    """Refuse a vehicle of which no independent one can be built, tested and flown."""
    refuse_beyond_fourier(vehicle, [layout])
    if vehicle.structure.support == "free_flight":
        raise InputError("structure.support: expected a body that is held, got 'free_flight'")


def as_built_structure(
    vehicle: Vehicle,
    layout: str,
    resolution: Resolution | None = None,
    properties: LoadProperties | None = None,
    known_thickness: FloatArray | None = None,
    max_harmonic: int = MAX_HARMONIC,
    progress: Progress | None = None,
    known_taper: FloatArray | None = None,
    surface: SurfaceGrid | None = None,
) -> AsBuiltStructure:
    """Solve the structure of a vehicle for all errors of a vehicle as built.

    A vehicle that flies free is held at its aft ring in the test.

    Parameters
    ----------
    vehicle, layout : the vehicle and the name of one of its layouts.
    resolution : mesh and pressure nodes; by default the resolution of the vehicle's map.
    properties : what loads need; the density of the vehicle file by default.
    known_thickness : (n_r,) relative thickness where it is known: solved for then, without tables.
    max_harmonic : highest harmonic in roll angle of known loads.
    progress : called with (harmonics done, harmonics in all).
    known_taper : (n_r,) relative thickness by which regions of known thickness grow from their middle to their
        aft end; none by default.
    surface : pressure nodes; by default the resolution's.

    Raises
    ------
    InputError
        The Fourier model cannot do what the file requests, or a gauge is not on the inner surface.
    """
    mapped = resolution or vehicle.resolution.map

    def solve(supported: Vehicle) -> AsBuiltStructure:
        if layout not in supported.gauges.layouts:
            raise InputError(f"layout '{layout}' found, must be one of {', '.join(supported.gauges.layouts)}")
        refuse_beyond_fourier(supported, [layout])
        walled = meshed_wall(supported, mapped)
        body, wall, drawing = walled.body, walled.wall, walled.mesh()
        regions, joints = wall_regions(supported.calibration, wall, body), supported.calibration.joint_stations_m
        layouts, all_placed = place_layouts(supported, drawing, [layout])
        placed, mesh = all_placed[layout], drawing
        errors = exactly_built(counts_of(supported, placed.roll_angle, in_flight=False))
        if known_thickness is not None:
            taper = np.zeros(len(regions)) if known_taper is None else np.asarray(known_taper, dtype=float)
            errors = errors.changed(wall_thickness=known_thickness, wall_taper=taper)
            mesh = thickened(drawing, wall, regions, errors.wall_thickness, taper)
        at_gauge = inner_surface_points(drawing, placed.x)
        grid = surface or surface_grid(body, *mapped.surface_nodes)
        states = wall_states(
            mesh=mesh,
            wall=wall,
            regions=regions,
            gauges=placed,
            along=SHIFT * at_gauge.tangent[:, 0],
            properties=properties or load_properties(vehicle.material, vehicle.temperature, wall),
            max_harmonic=max(max_harmonic, mapped.harmonics),
            changed_harmonic=changed_harmonic_of(max_harmonic, mapped.harmonics),
            with_regions=known_thickness is None,
            joints=joints,
            with_moduli=any(
                section.region_modulus_percent > 0.0 for section in (supported.calibration, supported.noise)
            ),
            progress=progress,
        )
        changes = np.array(list(change_stations(body, wall)))
        near = np.abs(placed.x[:, None] - changes).min(axis=1) <= 1e-3 * mapped.element_length_mm + TOUCHES
        return AsBuiltStructure(
            surface=grid,
            regions=regions,
            gauges=layouts[layout],
            on_wall=WallGauges(
                placed=placed, radius=at_gauge.radius, row=rows_of(placed.roll_angle), station=states.station
            ),
            solved=errors,
            states=states,
            n_harmonics=mapped.harmonics + 1,
            at_break=near,
            joint_stations=joints,
            _mesh_error=partial(_mesh_error, supported, grid, mapped, layout),
        )

    if vehicle.structure.support != "free_flight":
        return solve(vehicle)
    on_ground_entries = vehicle.structure.model_copy(
        update={"support": "clamped_aft", "covers": [], "point_masses": []}
    )
    on_ground, in_flight = solve(vehicle.model_copy(update={"structure": on_ground_entries})), solve(vehicle)
    return replace(on_ground, in_flight=in_flight, _mesh_error=in_flight._mesh_error)


def with_surface_of(structure: AsBuiltStructure, flown: AsBuiltStructure) -> AsBuiltStructure:
    """Return ``structure`` with pressure nodes, harmonics of the pressure and mesh error of ``flown``."""
    return replace(
        structure,
        surface=flown.surface,
        n_harmonics=flown.n_harmonics,
        _mesh_error=flown._mesh_error,
        _pressure=[],
    )


def _mesh_error(vehicle: Vehicle, grid: SurfaceGrid, resolution: Resolution, layout: str) -> FloatArray | None:
    low = resolution.model_copy(update={"harmonics": min(ERROR_HARMONICS, resolution.harmonics)})
    return with_mesh_error(structural_model_on(vehicle, grid, low, [layout]), vehicle, low).error_operator(layout)


def _table(
    nominal: FloatArray,
    along: tuple[FloatArray, FloatArray],
    wall: tuple[FloatArray, FloatArray],
    uneven: FloatArray,
    soft: FloatArray,
    kinks: IntArray,
) -> ResponseTable:
    """Return the table through values a step SHIFT before and behind; ``wall`` are by thickness and its square.

    ``wall``, ``uneven`` and ``soft`` may have fewer harmonics; in the others they change nothing. ``kinks`` are
    stations at which strain has no second derivative.
    """
    fore, aft = along
    along_twice = (aft - 2.0 * nominal + fore) / (2.0 * SHIFT**2)
    along_twice[..., kinks, :] = 0.0
    n_m = nominal.shape[-3]

    def of_all(change: FloatArray) -> FloatArray:
        return np.pad(change, [(0, 0)] * (change.ndim - 3) + [(0, n_m - change.shape[-3]), (0, 0), (0, 0)])

    return ResponseTable(
        nominal=nominal,
        along=(aft - fore) / (2.0 * SHIFT),
        along_twice=along_twice,
        wall=of_all(wall[0]),
        wall_twice=of_all(wall[1]),
        uneven=of_all(uneven),
        soft=of_all(soft),
    )


def _pressure_table(
    states: WallStates, force: FloatArray, n_m: int, at_break: BoolArray, changed: ChangedStrain
) -> ResponseTable:
    """Return the table per pressure at stations, by its nodal ``force`` (n_dof, n_x) on the outer surface [m2].

    ``changed`` is its strain on walls that differ.
    """
    load = force.reshape(-1, 3, force.shape[1])[states.rows.outer].reshape(-1, force.shape[1])

    def amplitudes(state: Adjoint) -> FloatArray:
        outer = state.outer[:n_m]
        # One product of two matrices takes a fifth of the time of many of three rows.
        strain = outer.reshape(-1, len(load)) @ load
        return np.moveaxis(strain.reshape(*outer.shape[:-1], -1), -1, 0)

    table = _table(
        amplitudes(states.nominal),
        (amplitudes(states.fore), amplitudes(states.aft)),
        (changed.wall, changed.wall_twice),
        changed.uneven[:, None],
        changed.soft,
        states.station[at_break],
    )
    frames = (table.uneven.shape[0], 2, *table.uneven.shape[2:])
    return replace(table, uneven=np.broadcast_to(table.uneven, frames))
