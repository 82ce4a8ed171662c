"""The vehicle file as a whole: read, checked, and what follows from its entries (TOML, checked by pydantic).

Every number's unit is part of its key. A wrong key, unit or value is refused in one line that names the
file, the entry, what was found and what is allowed. ``vehicles/ic3x.toml`` is the commented example.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import partial
from math import pi, prod
from pathlib import Path
from typing import Annotated, Any

from pydantic import AfterValidator, Field, PrivateAttr, model_validator

from builder.vehicle.flight_conditions import Conditions, FlowParameter, condition_grid
from builder.vehicle.gauges.gauge_entries import Gauges, Recorder
from builder.vehicle.gauges.sensor_entries import Sensors
from builder.vehicle.map_options import Calibration, MapEntry, Noise
from builder.vehicle.model_entries import (
    ELEMENTS,
    EULER,
    FOURIER,
    KNOTS,
    NODES,
    Aerodynamics,
    NeededBy,
    Resolution,
    Resolutions,
    Truth,
)
from builder.vehicle.notebook_view import (
    map_in_words,
    noise_in_words,
    range_in_words,
    stations_in_use,
    vehicle_html,
)
from builder.vehicle.shape.geometry import BodyOfRevolution, chain_pieces, is_blunt
from builder.vehicle.shape.profile_entries import Piece
from builder.vehicle.shape.sectioned_body import SectionedBody
from builder.vehicle.shape.sectioned_body import read_sections as read_sections_of_body
from builder.vehicle.shape.shape_entries import Reference, ReferenceQuantities, Shape
from builder.vehicle.structure_section import Mass, MaterialEntry, Structure, Temperature
from builder.vehicle.toml.entry_faults import Faults
from builder.vehicle.toml.reading import read_sections
from builder.vehicle.toml.toml_sections import (
    MAX_CONDITIONS,
    MAX_ELEMENTS,
    MAX_GAUGES,
    MAX_PRESSURES,
    MIN_ELEMENTS,
    Section,
    one_line,
)
from strainfmu.errors import InputError
from strainfmu.flight_condition import FlightCondition

VEHICLES = Path(__file__).parents[1] / "vehicles"
IC3X = VEHICLES / "ic3x.toml"


@dataclass(frozen=True, eq=False, kw_only=True)
class FlowEntries:
    """What a flow is solved from.

    Attributes
    ----------
    engine : section [aerodynamics].
    body : outer surface of a body of revolution; None of any other shape.
    shape : section [shape]; None for a profile.
    parameters : of the flow, by name.
    folder : where the files lie that these name.
    """

    engine: Aerodynamics
    body: BodyOfRevolution | None
    shape: Shape | None
    parameters: Mapping[str, FlowParameter]
    folder: Path


class Vehicle(Section):
    """A vehicle: the contents of a vehicle file."""

    name: Annotated[str, Field(min_length=1, max_length=200), AfterValidator(one_line)]
    description: str = ""
    profile: list[Annotated[Piece, Field(discriminator="kind")]] | None = Field(default=None, min_length=1)
    shape: Shape | None = None
    structure: Structure
    material: MaterialEntry
    materials: dict[str, MaterialEntry] = Field(default_factory=dict)
    reference: Reference
    gauges: Gauges
    conditions: Conditions
    aerodynamics: Aerodynamics = Aerodynamics()
    noise: Noise
    map: MapEntry
    sensors: Sensors | None = None
    recorder: Recorder = Recorder()
    calibration: Calibration = Calibration()
    temperature: Temperature | None = None
    mass: Mass | None = None
    truth: Truth = Truth()
    resolution: Resolutions = Resolutions()
    _folder: Path = PrivateAttr(default=Path())

    @model_validator(mode="after")
    def _sections_fit_each_other(self) -> Vehicle:
        faults = self._shape_faults()
        if self.structure.support == "free_flight" and self.material.density_kg_per_m3 is None:
            faults.append("structure.support 'free_flight' needs material.density_kg_per_m3")
        faults += [*self._material_faults(), *self._mass_faults()]
        if self.noise.of_layout is not None and self.noise.of_layout not in self.gauges.layouts:
            faults.append(
                f"noise.of_layout '{self.noise.of_layout}' is not among the layouts {sorted(self.gauges.layouts)}"
            )
        inside = self.structure.internal_pressure_Pa
        if self.sensors is not None and inside != "ambient":
            faults.append(f"sensors: expected structure.internal_pressure_Pa 'ambient', got {inside:g}")
        if faults:
            raise Faults(faults)
        return self

    def _material_faults(self) -> list[str]:
        """Return materials that are named and not there, or have no density where masses count."""
        faults = []
        needs = [
            *(["structure.support 'free_flight'"] if self.structure.support == "free_flight" else []),
            *(["[mass]"] if self.mass is not None else []),
        ]
        known = ", ".join(sorted(self.materials)) or "none"
        named = [(f"regions.{n}", region.material) for n, region in enumerate(self.structure.regions, start=1)]
        named += [
            (f"frames.{n}", frame.material)
            for n, frame in enumerate(self.structure.frames, start=1)
            if frame.material
        ]
        named = [(f"{where}.material", name) for where, name in named]
        named += [(f"mesh_materials.{region}", name) for region, name in self.structure.mesh_materials.items()]
        for where, name in named:
            if name not in self.materials:
                faults.append(f"structure.{where}: expected one of [materials], {known}, got '{name}'")
            elif needs and self.materials[name].density_kg_per_m3 is None:
                faults.append(f"{needs[0]} needs materials.{name}.density_kg_per_m3")
        return list(dict.fromkeys(faults))

    def _mass_faults(self) -> list[str]:
        """Return what of the vehicle does not go with masses."""
        entry = self.structure
        if self.mass is None:
            listed = [f"structure.{name}" for name in ("covers", "point_masses") if getattr(entry, name)]
            if not listed or entry.support == "free_flight":
                return []
            return [
                f"{' and '.join(listed)}: expected none with support '{entry.support}', which carries all mass, "
                "and without a section [mass]"
            ]
        faults = []
        if self.material.density_kg_per_m3 is None:
            faults.append("[mass] needs material.density_kg_per_m3")
        if not self.has_meridian or self.structure.model != "fourier" or self.structure.external is not None:
            faults.append("mass: expected a profile and structure.model 'fourier', got another structure")
        if self.sensors is not None:
            faults.append("mass: expected none with [sensors], whose readings inertia moves too")
        return faults

    def _shape_faults(self) -> list[str]:
        """Return what of the shape does not fit the rest of the file."""
        if (self.profile is None) == (self.shape is None):
            got = "neither" if self.profile is None else "both"
            return [f"profile: expected the outer shape either as [[profile]] or in [shape], got {got}"]
        kind, faults, entry = self.shape_kind, [], self.structure
        if kind != "profile":
            missing = [name for name in ("area_m2", "length_m") if getattr(self.reference, name) is None]
            faults += [f"reference.{name}: entry is missing, it is required with shape.{kind}" for name in missing]
            if self.aerodynamics.surface is not None:
                faults.append(f"aerodynamics.surface: expected none with shape.{kind}, which is the surface")
        faults += self._wall_faults() + self._estimator_faults()
        if kind != "profile" and entry.model != "solid":
            faults.append(f"structure.model: expected 'solid' with shape.{kind}, got '{entry.model}'")
        if kind == "surface":
            if self.aerodynamics.engine == "euler":
                faults.append(
                    "aerodynamics.engine: expected 'newtonian' or 'table' with shape.surface, got 'euler'"
                )
            if entry.mesh is None:
                faults.append("structure.mesh: entry is missing, shape.surface needs a mesh of the structure")
        if entry.checked_by is not None and entry.checked_by == entry.mesh:
            faults.append(
                f"structure.checked_by: expected another mesh than structure.mesh, got '{entry.mesh}' again"
            )
        faults += self._parameter_faults()
        if kind != "surface" and entry.mesh is not None:
            faults.append(f"structure.mesh: expected with shape.surface alone, got it with {kind}")
        if kind != "surface" and entry.solid_tip_length_m is None:
            faults.append("structure.solid_tip_length_m: entry is missing")
        if kind == "surface" and entry.solid_tip_length_m is not None:
            faults.append(
                "structure.solid_tip_length_m: expected none with shape.surface, whose mesh holds the tip"
            )
        return faults

    def _estimator_faults(self) -> list[str]:
        """Return what the nonlinear estimator does not take."""
        if self.map.estimator != "nonlinear":
            return []
        faults = []
        if self.shape_kind == "profile" and self.map.symmetry != "full":
            faults.append(
                f"map.estimator: 'nonlinear' needs map.symmetry 'full' with a profile, got '{self.map.symmetry}'"
            )
        if self.structure.strain_per_snapshot is not None:
            faults.append("map.estimator: expected 'linear' with structure.strain_per_snapshot, got 'nonlinear'")
        return faults

    def _wall_faults(self) -> list[str]:
        """Return entries of the wall and of masses that the kind of shape does not take."""
        kind, entry = self.shape_kind, self.structure
        if kind == "profile":
            faults = [] if not entry.mesh_materials else ["structure.mesh_materials: expected with a mesh alone"]
            return faults + [
                f"structure.point_masses.{number}: expected none of y_m, z_m and on with a profile, got some"
                for number, point_mass in enumerate(entry.point_masses, start=1)
                if point_mass.y_m or point_mass.z_m or point_mass.on is not None
            ]
        wall, masses = ("wall_thickness_at", "regions", "frames"), ("mesh_materials", "point_masses", "covers")
        if kind == "surface":
            faults = [
                f"structure.{name}: expected none with shape.surface, whose mesh is the wall"
                for name in wall
                if getattr(entry, name)
            ]
            return faults + [
                f"structure.point_masses.{number}.on: entry is missing, the surface of the mesh that carries it"
                for number, point_mass in enumerate(entry.point_masses, start=1)
                if point_mass.on is None
            ]
        return [
            f"structure.{name}: expected none with shape.{kind}, whose wall is of one thickness and material"
            for name in (*wall, *masses)
            if getattr(entry, name)
        ]

    def _parameter_faults(self) -> list[str]:
        """Return flow parameters that its engine does not know."""
        engine, kind, faults = self.aerodynamics.engine, self.shape_kind, []
        for name, parameter in self.conditions.parameters.items():
            where = f"conditions.parameters.{name}"
            if engine == "euler":
                faults.append(
                    f"{where}: expected engine 'newtonian' or 'table', got 'euler', which has no parameters"
                )
            elif kind == "profile":
                faults.append(f"{where}: expected [shape] with sections or surface, got a profile")
            elif engine == "newtonian" and not parameter.surfaces:
                faults.append(
                    f"{where}.surfaces: entry is missing, the newtonian engine needs a surface at each end"
                )
            elif parameter.surfaces and (engine, kind) != ("newtonian", "surface"):
                faults.append(f"{where}.surfaces: expected with shape.surface and engine 'newtonian' alone")
        return faults

    @property
    def shape_kind(self) -> str:
        """How the outer shape is given: ``"profile"``, ``"sections"`` or ``"surface"``."""
        return "profile" if self.shape is None else self.shape.kind

    @property
    def has_meridian(self) -> bool:
        """Whether :meth:`body` and its wall are lines of a meridian plane, turned round the axis."""
        return self.shape_kind == "profile"

    @property
    def is_axisymmetric(self) -> bool:
        """Whether a flow at one roll angle is that at any other, turned: by its total angle of attack alone."""
        return self.shape_kind == "profile"

    def sectioned_body(self) -> SectionedBody:
        """Return the outer surface of a vehicle given by sections.

        Raises
        ------
        InputError
            The file of sections is missing or wrong.
        """
        assert self.shape is not None
        assert self.shape.sections is not None
        return read_sections_of_body(self.beside(self.shape.sections), self.shape.interpolation)

    def beside(self, name: str) -> Path:
        """Return the path of a file named in the vehicle file, relative to it."""
        return self._folder / name

    def body(self) -> BodyOfRevolution:
        """Return the outer surface of a vehicle given by its profile.

        Raises
        ------
        InputError
            A piece is wrong, or the vehicle is given by sections or a surface.
        """
        folder, pieces = self._folder, self.profile if self.shape is None else self.shape.profile
        if pieces is None:
            raise InputError(f"shape: expected a profile, which this needs, got {self.shape_kind}")
        return chain_pieces([partial(entry.segment, folder=folder) for entry in pieces])

    def flow_entries(self) -> FlowEntries:
        """Return what a flow is solved from; errors as :meth:`body`."""
        return FlowEntries(
            engine=self.aerodynamics,
            body=self.body() if self.is_axisymmetric else None,
            shape=self.shape,
            parameters=self.conditions.parameters,
            folder=self._folder,
        )

    def reference_quantities(self) -> ReferenceQuantities:
        """Return S, L and the moment point."""
        entry = self.reference
        if entry.area_m2 is not None and entry.length_m is not None:
            return ReferenceQuantities(
                area=entry.area_m2, length=entry.length_m, moment_station=entry.moment_station_m
            )
        radius = self.body().base_radius
        return ReferenceQuantities(
            area=self.reference.area_m2 or pi * radius**2,
            length=self.reference.length_m or 2.0 * radius,
            moment_station=self.reference.moment_station_m,
        )

    def flight_conditions(self) -> list[FlightCondition]:
        """Return the snapshots' conditions in the order of the file."""
        entry = self.conditions
        return condition_grid(
            entry.mach_number,
            entry.angle_of_attack_deg,
            entry.sideslip_angle_deg,
            [1e3 * altitude for altitude in entry.altitudes_km],
            [parameter.values for parameter in entry.parameters.values()],
        )

    @property
    def has_flow_table(self) -> bool:
        """Whether flows of the vehicle that flies are solved at Mach numbers and incidences of [truth].

        Of a body of revolution, where the file has that section or the map's alarm levels are set on them.
        """
        gauges_of_our_wall = self.structure.external is None and self.sensors is None
        levels = self.aerodynamics.engine == "euler" and self.map.alarm_levels != "nominal" and gauges_of_our_wall
        return self.is_axisymmetric and (levels or bool(self.truth.model_fields_set))

    def truth_engine(self) -> str:
        """Return the name of the engine of the vehicle that flies, for a body of revolution.

        It is "euler", whatever engine the map is built on, but where the file says otherwise, or where the tip is
        blunt and the map's engine is another one.

        Raises
        ------
        InputError
            A piece of the profile is wrong.
        """
        if self.truth.engine is not None:
            return self.truth.engine
        return "newtonian" if self.aerodynamics.engine != "euler" and is_blunt(self.body()) else "euler"

    def manoeuvre(self) -> Path:
        """Return the path of the flight of the demonstration.

        Raises
        ------
        InputError
            The file names none.
        """
        if self.truth.manoeuvre is None:
            raise InputError("truth.manoeuvre: entry is missing, `strainfmu demo` flies it")
        return self.beside(self.truth.manoeuvre)

    def _repr_html_(self) -> str:
        body, wall, air = self.body(), self.structure, self.conditions
        stations = stations_in_use(self.gauges, self._folder)
        number = "gauges" if stations is None else f"{len(stations)} gauges"
        entries = (
            ("length", f"{body.length:.4g} m"),
            ("base diameter", f"{2.0 * body.base_radius:.4g} m"),
            ("wall", f"{wall.wall_thickness_mm:.4g} mm, E = {self.material.youngs_modulus_GPa:.4g} GPa"),
            ("structure", f"{wall.model} model, {wall.support}"),
            ("gauges", f"{number}, layout {self.gauges.layout} of {', '.join(self.gauges.layouts)}"),
            (
                "conditions",
                f"{len(self.flight_conditions())}: M {range_in_words(air.mach_number)}, "
                f"angle of attack {range_in_words(air.angle_of_attack_deg)} deg, "
                f"sideslip angle {range_in_words(air.sideslip_angle_deg)} deg, "
                f"altitude {range_in_words(air.altitudes_km)} km",
            ),
            ("engine", self.aerodynamics.engine),
            ("noise", noise_in_words(self.noise)),
            ("map", map_in_words(self.map)),
        )
        return vehicle_html(self.name, entries, body, stations)


def load_vehicle(path: str | Path, changes: Mapping[str, Any] | None = None) -> Vehicle:
    """Read and check a vehicle file.

    ``changes`` are values of entries by their names, such as ``map.modes``, instead of the file's.

    Raises
    ------
    FaultsError
        Entries are unknown, missing or outside their limits, or sizes that follow from them are: one line each.
    InputError
        The file is missing or no TOML.

    Example
    -------
    >>> import builder
    >>> vehicle = builder.load_vehicle(builder.IC3X)
    >>> print(f"{vehicle.name}, {vehicle.body().length} m, {len(vehicle.flight_conditions())} conditions")
    IC3X surrogate, 3.6 m, 90 conditions
    """
    path = Path(path)

    def faults_beside_file(vehicle: Vehicle) -> list[str]:
        vehicle._folder = path.parent  # sizes follow from files that the vehicle file names, too
        return [*_missing_entries(vehicle), *_size_faults(vehicle)]

    return read_sections(path, Vehicle, "vehicle file", faults_beside_file, changes)


def _missing_entries(vehicle: Vehicle) -> Iterator[str]:
    """Yield a line for each entry of [truth] and [resolution] that the file lacks and its models need."""
    if vehicle.has_flow_table:
        for name in KNOTS:
            if getattr(vehicle.truth, name) is None:
                yield (
                    f"truth.{name}: entry is missing, the flows of the vehicle that flies; alarm levels by "
                    "engine 'euler' need them, unless map.alarm_levels is 'nominal'"
                )
    for level in ("map", "truth"):
        needed, resolution = _needed_by(vehicle, level), getattr(vehicle.resolution, level)
        for name, field in Resolution.model_fields.items():
            by = [need for need in field.metadata if isinstance(need, NeededBy)]
            if name not in resolution.model_fields_set and needed.intersection(by):
                yield f"resolution.{level}.{name}: entry is missing, it is required with {by[0].what}"


def _needed_by(vehicle: Vehicle, level: str) -> set[NeededBy]:
    """Return what the model of a level consists of."""
    kind, flies = vehicle.shape_kind, level == "truth"
    needs = set() if kind == "surface" else {NODES}
    if kind == "profile":
        needs |= {FOURIER, ELEMENTS}
    if kind == "sections" and flies:
        needs.add(ELEMENTS)
    engine: str | None = vehicle.aerodynamics.engine
    if flies and kind == "profile":
        try:
            engine = vehicle.truth_engine() if vehicle.has_flow_table else None
        except InputError:  # the body itself is wrong, which is said elsewhere
            engine = None
    if engine == "euler":
        needs.add(EULER)
    return needs


def _size_faults(vehicle: Vehicle) -> list[str]:
    """Return what is wrong with the body and with sizes that follow from several entries, a line each."""
    own_nodes = vehicle.shape_kind != "surface"
    faults = [*_flow_faults(vehicle.conditions, vehicle.truth, vehicle.resolution, own_nodes)]
    faults += _gauge_faults(vehicle.gauges, vehicle.resolution, own_nodes)
    if not vehicle.has_meridian:
        return faults
    try:
        body = vehicle.body()
    except InputError as error:
        return [str(error), *faults]
    return [*faults, *_element_faults(vehicle.resolution, body.length)]


def _flow_faults(entry: Conditions, truth: Truth, resolutions: Resolutions, own_nodes: bool) -> Iterator[str]:
    """Yield faults of the numbers of conditions, and of their pressures on the nodes where these are our own."""
    lists = [entry.mach_number, entry.angle_of_attack_deg, entry.sideslip_angle_deg, entry.altitudes_km]
    lists += [parameter.values for parameter in entry.parameters.values()]
    knots = [truth.mach_number or (), truth.total_incidence_deg or ()]
    for where, sizes, name, resolution in (
        ("conditions", [len(values) for values in lists], "map", resolutions.map),
        ("truth", [len(values) for values in knots], "truth", resolutions.truth),
    ):
        count, shown = prod(sizes), " x ".join(map(str, sizes))
        if count > MAX_CONDITIONS:
            yield f"{where}: expected at most {MAX_CONDITIONS} conditions, got {shown} = {count}"
        elif own_nodes and count * _nodes(resolution) > MAX_PRESSURES:
            yield (
                f"{where}: expected at most {MAX_PRESSURES} values of pressure, got {count} conditions x "
                f"{_shown_nodes(name, resolution)} = {count * _nodes(resolution)}"
            )


def _gauge_faults(gauges: Gauges, resolutions: Resolutions, own_nodes: bool) -> Iterator[str]:
    """Yield faults of the numbers of gauges in rows, and of their strains per pressure."""
    finest = max(("map", "truth"), key=lambda name: _nodes(getattr(resolutions, name)))
    resolution = getattr(resolutions, finest)
    for layout, entry in gauges.layouts.items():
        count = sum(
            len(row.directions) * (len(row.x_m) if row.x_m is not None else row.count or 0)
            for row in entry.rows or ()
        )
        if count > MAX_GAUGES:
            yield f"gauges.layouts.{layout}: expected at most {MAX_GAUGES} gauges, got {count}"
        elif own_nodes and count * _nodes(resolution) > MAX_PRESSURES:
            yield (
                f"gauges.layouts.{layout}: expected at most {MAX_PRESSURES} strains per pressure, got {count} "
                f"gauges x {_shown_nodes(finest, resolution)} = {count * _nodes(resolution)}"
            )


def _element_faults(resolutions: Resolutions, length: float) -> Iterator[str]:
    """Yield faults of the elements along the meridian; ``length`` of the body [m]."""
    for name in ("map", "truth"):
        resolution: Resolution = getattr(resolutions, name)
        element = 1e-3 * resolution.element_length_mm
        if element > length / MIN_ELEMENTS:
            yield (
                f"resolution.{name}.element_length_mm: expected at most {1e3 * length / MIN_ELEMENTS:g}, 1/"
                f"{MIN_ELEMENTS} of the body's length, got {resolution.element_length_mm:g}"
            )
        count = round(length / element) * resolution.wall_layers
        if count > MAX_ELEMENTS:
            yield (
                f"resolution.{name}: expected at most {MAX_ELEMENTS} elements, got {length:g} m / "
                f"{resolution.element_length_mm:g} mm x {resolution.wall_layers} wall_layers = {count}"
            )


def _nodes(resolution: Resolution) -> int:
    return resolution.surface_stations * resolution.surface_roll_angles


def _shown_nodes(name: str, resolution: Resolution) -> str:
    return f"{resolution.surface_stations} x {resolution.surface_roll_angles} nodes of resolution.{name}"
