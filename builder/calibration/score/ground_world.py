"""What all ground tests of a trial share: the map's structure, vehicles of the truth, flights, proposed tests.

Vehicles are of an independent truth: a mesh of its own, and a wall as stated, or a smooth one. The calibration
knows a wall of few regions, each of one thickness. Of a smooth wall thickness and its first harmonic round the
body are smooth random functions of the station, of the standard deviations that the section [calibration] states.
They are taken piece by piece over other, shorter regions on a finer mesh: thickness linearly and without steps,
the others by the mean of each piece. The tables of the structure are solved once; all vehicles share them."""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from itertools import cycle
from pathlib import Path
from typing import Any

import numpy as np

from builder.aero.load_operator import coefficients_of, load_operator
from builder.calibration.after_test.calibrated_map import calibrated_map, calibrated_structure
from builder.calibration.after_test.left_by_test import LeftByTest, Remaining
from builder.calibration.estimate.readings_model import ReadingsModel
from builder.calibration.ground_test.candidate_cases import LoadLimits, PlannedCase, known_loads
from builder.calibration.ground_test.load_test import KnownLoad, LoadCase, LoadErrors, LoadTest
from builder.calibration.ground_test.structure_of_test import prior_of_test, structure_of_test
from builder.calibration.plan.load_plan import PlanParts, load_plan, run_order
from builder.calibration.score.simulated_test import standard_load_cases
from builder.campaign.snapshots import Snapshots, load_snapshots, snapshots_on
from builder.inverse.ensemble import Ensemble, ensemble_of
from builder.structure.as_built.as_built_structure import AsBuiltStructure, as_built_structure, with_surface_of
from builder.structure.as_built.as_built_vehicle import AsBuilt, StrainOfLoads, as_built_std, draw_as_built
from builder.structure.as_built.wall_regions import wall_regions
from builder.structure.loads.applied import NO_VECTOR, UNIT_VECTORS, Load, PadForce
from builder.structure.loads.loaded_structure import LoadProperties
from builder.structure.mapped_structure import MappedStructure
from builder.structure.wall import wall_of
from builder.trial.cases import GroundTest, GroundTests
from builder.trial.conditions import held_out_conditions, quantities
from builder.trial.faults import MICRO
from builder.trial.readings import Readings, Shared, navigation_at
from builder.truth.flow_table import FlowTable, load_flow_table, ratio_at
from builder.vehicle.file import Vehicle
from builder.vehicle.model_entries import Resolution
from builder.vehicle.shape.geometry import SurfaceGrid
from strainfmu.arrays import FloatArray
from strainfmu.estimator.air_inputs import DYNAMIC_PRESSURE, STATIC_PRESSURE
from strainfmu.estimator.map.inverse_map import InverseMap

HARMONICS = 14
"""Of loads: pads of half angle 30 deg need 12."""

DENSITY = 4430.0
"""Where the vehicle file names none: titanium [kg/m3]."""

PIECES = 7
"""Regions of the wall of the truth; none of their ends is one of the default regions'."""

SMOOTH = 0.75
"""Length over which a smooth variation forgets itself, over the length of the wall [1]."""

JOINT = 0.47
"""Station of the joint, over the length of the wall from the solid tip: at the break of the shipped profile."""

ELEMENT, LAYERS = 0.75, 2
"""Element length over the map's, and elements through the wall."""


def smooth(station: FloatArray, random: np.random.Generator) -> FloatArray:
    """Return (n,) values of a Gaussian process of standard deviation 1 at increasing stations (n,) [m].

    Its covariance is exp(-s^2 / 2) with the distance s over :data:`SMOOTH` times the span of the stations.
    """
    apart = (station[:, None] - station) / (SMOOTH * np.ptp(station))
    value, vector = np.linalg.eigh(np.exp(-0.5 * apart**2))
    return np.asarray(vector @ (np.sqrt(np.maximum(value, 0.0)) * random.standard_normal(len(value))))


def properties_of(vehicle: Vehicle) -> LoadProperties:
    """Return what known loads need; a vehicle whose file names no density is of titanium."""
    return LoadProperties(density=vehicle.material.density_kg_per_m3 or DENSITY)


def structure_of_truth(vehicle: Vehicle, is_smooth: bool) -> AsBuiltStructure:
    """Solve the structure of the truth, pressure nodes of its own."""
    tested, resolution = vehicle, vehicle.resolution.truth
    if is_smooth:
        tested, coarse = with_smooth_wall(vehicle), vehicle.resolution.map
        resolution = Resolution(
            **resolution.model_dump(exclude={"element_length_mm", "wall_layers", "harmonics"}),
            element_length_mm=ELEMENT * coarse.element_length_mm,
            wall_layers=LAYERS,
            harmonics=min(resolution.harmonics, max(coarse.harmonics, HARMONICS)),
        )
    return as_built_structure(
        tested, tested.gauges.layout, resolution, properties_of(vehicle), max_harmonic=HARMONICS
    )


def with_smooth_wall(vehicle: Vehicle) -> Vehicle:
    """Return ``vehicle`` with the regions, the joint and the moduli of a smooth wall."""
    end = wall_regions(vehicle.calibration, wall_of(vehicle), vehicle.body()).end
    first, last = float(end[0]), float(end[-1])
    entry = vehicle.calibration.model_copy(
        update={
            "wall_region_ends_m": np.linspace(first, last, PIECES + 1)[1:-1].tolist(),
            "region_modulus_percent": max(vehicle.calibration.region_modulus_percent, 3.0),
            "joint_stations_m": (first + JOINT * (last - first),),
        }
    )
    return vehicle.model_copy(update={"calibration": entry})


MAPS: dict[str, dict[str, Any]] = {
    "linear Case 1": {"case": 1, "estimator": "linear"},
    "linear Case 2": {"case": 2, "estimator": "linear"},
    "nonlinear": {"estimator": "nonlinear"},
}
"""Entries of [map] by estimator. The first one's are the map that a test is proposed for."""

EXACT, BEFORE = "known exactly", "before the test"
"""Ends of an estimator's name: what is known of the vehicle; without one what its test says."""


def flights_of(
    vehicle: Vehicle, table: FlowTable, grid: SurfaceGrid, count: int, draws: int = 1
) -> tuple[FloatArray, Readings]:
    """Return net pressure (k, n_p) [Pa] on the nodes of ``grid`` in ``count`` held-out flights, the same for all
    seeds; and what is read there in as many ``draws`` of noise each, but for the strain."""
    conditions = held_out_conditions(vehicle, table, count, np.random.default_rng(31))
    ambient, q = (quantities(conditions, name) for name in (STATIC_PRESSURE, DYNAMIC_PRESSURE))
    ratio = ratio_at(table, conditions, grid.roll_angle)
    net, reference = ambient[:, None] * (ratio - 1.0), vehicle.reference_quantities()
    coefficients = coefficients_of(net, load_operator(grid, reference.moment_station), conditions, reference)
    flight = np.repeat(np.arange(count), draws)
    return net, Readings(
        strain=np.empty((len(flight), 0)),
        known={**navigation_at(conditions, draws), DYNAMIC_PRESSURE: q[flight]},
        truth=coefficients[flight],
        vehicle=np.zeros_like(flight),
        flight=flight,
        conditions=tuple(conditions),
    )


def on_cells(case: PlannedCase, errors: LoadErrors, in_turn: Iterator[int]) -> tuple[KnownLoad, ...]:
    """Return the loads of a case, each that is read on the next load cell of ``in_turn``."""
    loads = known_loads(case, errors)
    return tuple(replace(load, load_cell=str(1 + next(in_turn))) if load.on_load_cell else load for load in loads)


@lru_cache(1)
def _strain_near(structure: AsBuiltStructure, as_built: AsBuilt) -> StrainOfLoads:
    return structure.strain_near(as_built)


@dataclass(eq=False, kw_only=True)
class GroundWorld(Shared):
    """What all tests share.

    Attributes
    ----------
    vehicle : its linear map holds no errors of the hardware but those that the test leaves.
    snapshots : on the nodes of ``structure``, the map's.
    true_structure : of the truth.
    pressure, flights : net pressure on the truth's own nodes (k, n_p) [Pa], and readings but for the strain.
    options : of the file.
    """

    vehicle: Vehicle
    snapshots: Snapshots
    structure: AsBuiltStructure
    true_structure: AsBuiltStructure
    pressure: FloatArray
    flights: Readings
    options: GroundTests

    @cached_property
    def true_on_map(self) -> AsBuiltStructure:
        """The structure of the truth with the pressure nodes and the mesh error of the map."""
        return with_surface_of(self.true_structure, self.structure)

    def drawn(self, random: np.random.Generator) -> AsBuilt:
        """Return one vehicle; a smooth wall has a joint that is as stiff as the wall."""
        structure = self.true_structure
        std = as_built_std(self.vehicle.calibration, structure.counts)
        as_built = draw_as_built(std, random)
        if self.options.walls != "smooth":
            return as_built
        edge = structure.regions.end
        at_ends = smooth(edge, random) * std.wall_thickness[0]
        middle = 0.5 * (edge[1:] + edge[:-1])
        cosine, sine = (smooth(middle, random) * std.wall_cosine[0] for _ in range(2))
        return as_built.changed(
            wall_thickness=0.5 * (at_ends[1:] + at_ends[:-1]),
            wall_taper=0.5 * (at_ends[1:] - at_ends[:-1]),
            wall_cosine=cosine,
            wall_sine=sine,
            region_modulus=np.zeros(len(middle)),
            joint_softness=np.zeros(structure.counts.joint),
        )

    def load_strain(self, as_built: AsBuilt, applied: Load, stated: Load) -> FloatArray:
        """Return what the gauges read (n_d,) under a load ``applied``, stated as ``stated``, without zeros [m/m].

        Each pad and attitude is solved once. Forces are sums of their three components, which is exact. Where a
        pad stands elsewhere than stated, or is of another shape, the change is found on a wall of
        the vehicle's mean thickness at each station, under the gauges as built.
        """
        structure = self.true_structure
        if not isinstance(applied, PadForce) or not isinstance(stated, PadForce):
            return structure.load_strain(as_built, [applied])
        if stated.force == NO_VECTOR or applied.force == NO_VECTOR:
            return np.zeros(structure.n_gauges)
        units = [replace(stated, force=unit) for unit in UNIT_VECTORS]
        response = self.once(replace(stated, force=NO_VECTOR), lambda: structure.responses(units))
        strain = np.asarray(applied.force) @ structure.response_strain(as_built, response)
        in_place = replace(stated, force=applied.force)
        if in_place == applied:
            return np.asarray(strain)
        moved, unmoved = _strain_near(structure, as_built)([applied, in_place])
        return np.asarray(strain + moved - unmoved)

    @cached_property
    def ensemble(self) -> Ensemble:
        """The map's flows."""
        return ensemble_of(self.vehicle, self.snapshots)

    @cached_property
    def mapped(self) -> MappedStructure:
        """The structure of the drawing's map."""
        structure = self.structure
        return calibrated_structure(structure, structure.exactly_built(), self.vehicle.gauges.layout, {})

    def model(self, entry: GroundTest) -> ReadingsModel:
        """Return the test of a case, without readings."""
        noise, structure, n_cells = MICRO * entry.reading_std_um_per_m, self.structure, entry.load_cells
        errors = LoadErrors(load=0.01 * entry.load_percent, common=0.01 * entry.load_cell_percent)
        on_average = replace(errors, common=errors.common / n_cells**0.5)  # cells differ independently

        def made() -> ReadingsModel:
            none, std = np.zeros(structure.n_gauges), np.full(structure.n_gauges, noise)
            in_turn = cycle(range(n_cells))
            cases = tuple(
                LoadCase(name=case.name, loads=on_cells(case, errors, in_turn), reading=none, reading_std=std)
                for case in self._cases(entry.pads, noise, on_average)
            )
            test = LoadTest(gauge_names=structure.gauges.names, cases=cases, errors=errors)
            return ReadingsModel(structure, test, prior_of_test(self.vehicle, structure))

        return self.once((entry.pads, noise, errors, n_cells), made)

    def _cases(self, pads: int, noise: float, errors: LoadErrors) -> list[PlannedCase]:
        """Return ``pads`` bonded pads that are proposed, in the order in which they are run, with zero readings
        between and at the end; or at even distances, and own weight in four attitudes."""
        vehicle, structure = self.vehicle, self.structure
        if not self.options.proposed:
            return standard_load_cases(pads, vehicle.body().length)
        parts = PlanParts(vehicle=vehicle, snapshots=self.snapshots, structure=self.mapped, as_built=structure)
        plan = load_plan(parts, pads, LoadLimits(directions=("out",)), errors, samples=1, noise=noise)
        return [step.case for step in run_order(plan)]

    def map_of(
        self, kind: str, structure: AsBuiltStructure, remaining: Remaining, remainder: LeftByTest | None = None
    ) -> InverseMap:
        """Return the map of :data:`MAPS` of what is known of a vehicle."""
        entry = self.vehicle.map.model_copy(update=MAPS[kind])
        vehicle = self.vehicle.model_copy(update={"map": entry})
        return calibrated_map(vehicle, self.snapshots, structure, remaining, remainder=remainder)

    def drawing(self, kind: str) -> InverseMap:
        """Return the map of the drawing with every tolerance but of zeros, which a tare takes off."""
        std = prior_of_test(self.vehicle, self.structure)
        std = std.changed(zero=np.zeros(std.n_gauges))
        nominal = Remaining(parameters=self.structure.exactly_built(), covariance=np.diag(std.vector**2))
        return self.once(kind, lambda: self.map_of(kind, self.structure, nominal))


def ground_world(
    vehicle: Vehicle, snapshots: Path, flows: Path, conditions: int, options: GroundTests
) -> GroundWorld:
    """Solve what all tests share; of the flows of the map, and of the independent model, in these files."""
    entry = vehicle.map.model_copy(update=next(iter(MAPS.values())))
    vehicle = vehicle.model_copy(update={"noise": vehicle.noise.without_hardware_errors(), "map": entry})
    structure = structure_of_test(vehicle, properties_of(vehicle), HARMONICS)
    true_structure = structure_of_truth(vehicle, options.walls == "smooth")
    table = load_flow_table(flows, vehicle)
    pressure, flights = flights_of(vehicle, table, true_structure.surface, conditions, options.draws)
    return GroundWorld(
        vehicle=vehicle,
        snapshots=snapshots_on(load_snapshots(snapshots), structure.surface),
        structure=structure,
        true_structure=true_structure,
        pressure=pressure,
        flights=flights,
        options=options,
    )
