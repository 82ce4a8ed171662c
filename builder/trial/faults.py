"""What becomes of readings: gauges, or auxiliary sensors, that fail, by seven verbs; sets of gauges that are lost;
and strain that no pressure makes, on the mesh of the independent model: a wall that warms, inertia of masses,
vibration, friction."""

from functools import cached_property
from itertools import combinations
from math import radians
from typing import Any, Literal, NamedTuple

import numpy as np
from pydantic import Field

from builder.aero.surface.mesh import mesh_of_grid
from builder.inverse.noise.inertia import UNLISTED, strain_by_inertia
from builder.inverse.noise.thermal import HARMONICS
from builder.structure.fourier.fourier_model import place_layouts
from builder.structure.fourier.inertia_strain import inertia_strain
from builder.structure.fourier.meridian_mesh import MeridianMasses
from builder.structure.fourier.shell_mesh import meshed_wall
from builder.structure.loads.applied import STANDARD_GRAVITY
from builder.structure.loads.gauge_strain import gauge_strain, gauge_temperature
from builder.structure.loads.of_vehicle import fourier_structure_of
from builder.structure.loads.temperature import temperature_mode
from builder.truth.flow_table import truth_surface
from builder.vehicle.file import Vehicle
from builder.vehicle.model_entries import Resolutions
from builder.vehicle.structure_section import Mass, Temperature, TemperatureSensor
from builder.vehicle.toml.toml_sections import Section
from strainfmu.arrays import BoolArray, FloatArray, IntArray
from strainfmu.errors import InputError
from strainfmu.estimator.signal_names import TEMPERATURE

MICRO = 1e-6


class Gauges(NamedTuple):
    """Gauges, or auxiliary sensors: station [m], roll angle [rad] and noise [m/m, or their unit], each (n_d,)."""

    station: FloatArray
    roll_angle: FloatArray
    noise_std: FloatArray

    @property
    def row(self) -> FloatArray:
        """(n_d,) the row of each: its roll angle, 0 to 360, rounded [deg]."""
        return np.asarray(np.mod(np.round(np.degrees(self.roll_angle), 3), 360.0))


class Fault(Section):
    """What becomes of the readings of ``of`` gauges, drawn, or of all: first another source, then times and added.

    Attributes
    ----------
    of : number of gauges, drawn; None for all.
    sensors : whether auxiliary sensors fail instead of gauges.
    frozen : they keep what they read in one of the flights.
    swapped : they read in reverse order.
    exchanged : opposite rows of equal stations, as by two connectors: all, or in each flight the pair that is
        nearest to the plane of the flow direction. A row is the gauges of one roll angle.
    lost : no reading.
    times : factor.
    add_um_per_m, add_sigmas : what is added, the latter over the noise of each gauge.
    shape : of what is added: even, as the cosine from leeward, or linear from 0 at the first station to the last.
    noise_times : noise over the stated one.
    """

    of: int | None = Field(default=None, ge=1)
    sensors: bool = False
    frozen: bool = False
    swapped: bool = False
    exchanged: Literal["nearest", "all"] | None = None
    lost: bool = False
    times: float = 1.0
    add_um_per_m: float = 0.0
    add_sigmas: float = 0.0
    shape: Literal["even", "cosine", "linear"] = "even"
    noise_times: float = Field(default=1.0, ge=1.0)

    def readings(
        self, strain: FloatArray, gauges: Gauges, leeward: FloatArray, random: np.random.Generator
    ) -> FloatArray:
        """Return what is read instead of ``strain`` (n, n_d); ``leeward`` (n,) is the leeward meridian [rad]."""
        out, n_d = strain.copy(), strain.shape[1]
        which: Any = slice(None) if self.of is None else random.choice(n_d, size=min(self.of, n_d), replace=False)
        if self.frozen:
            out[:, which] = strain[int(random.integers(len(strain))), which]
        if self.swapped:
            out[:, which] = strain[:, which[::-1]]
        if self.exchanged is not None:
            _exchange(opposite_rows(gauges), self.exchanged == "all", strain, out, leeward)
        if self.lost:
            out[:, which] = np.nan
        added = MICRO * self.add_um_per_m * self._shape(gauges, leeward) + self.add_sigmas * gauges.noise_std
        out[:, which] = self.times * out[:, which] + np.broadcast_to(added, strain.shape)[:, which]
        if self.noise_times > 1.0:
            out += np.sqrt(self.noise_times**2 - 1.0) * gauges.noise_std * random.standard_normal(strain.shape)
        return out

    def _shape(self, gauges: Gauges, leeward: FloatArray) -> FloatArray:
        if self.shape == "cosine":
            return np.cos(gauges.roll_angle - leeward[:, None])
        x = gauges.station
        return (x - x.min()) / (np.ptp(x) or 1.0) if self.shape == "linear" else np.ones(len(x))


def opposite_rows(gauges: Gauges) -> list[tuple[float, IntArray, IntArray]]:
    """Return angle [rad] and gauges of each pair of opposite rows of equal stations."""
    roll, pairs = gauges.row, []
    for angle in np.unique(roll[roll < 180.0]):
        near, far = np.flatnonzero(roll == angle), np.flatnonzero(roll == angle + 180.0)
        if len(near) == len(far) and np.allclose(gauges.station[near], gauges.station[far]):
            pairs.append((radians(angle), near, far))
    return pairs


def _exchange(
    pairs: list[tuple[float, IntArray, IntArray]],
    every: bool,
    strain: FloatArray,
    out: FloatArray,
    leeward: FloatArray,
) -> None:
    """Exchange opposite rows in ``out``."""
    in_plane = np.abs([np.cos(leeward - angle) for angle, _, _ in pairs])
    for number, (_, near, far) in enumerate(pairs):
        rows = np.arange(len(strain)) if every else np.flatnonzero(in_plane.argmax(axis=0) == number)
        out[np.ix_(rows, near)], out[np.ix_(rows, far)] = strain[np.ix_(rows, far)], strain[np.ix_(rows, near)]


class NoSuchGaugesError(InputError):
    """A layout has no such gauges to lose."""


class Lost(Section):
    """Sets of gauges that are lost, one set after another, in the same flights.

    Attributes
    ----------
    gauges : ``count`` rows, every combination; each direction, axial or hoop; each direction of each row; each
        direction and each row; or all but ``count``, drawn.
    count : number of them; 0 for half of the gauges.
    sets : number of sets that are drawn.
    samples : of each set, the next ones of the trial; 0 for all.
    """

    gauges: Literal["rows", "direction", "direction of a row", "direction and row", "all but"]
    count: int = Field(default=1, ge=0)
    sets: int = Field(default=20, ge=1)
    samples: int = Field(default=0, ge=0)

    def in_use(self, roll: FloatArray, axial: BoolArray, random: np.random.Generator) -> dict[str, BoolArray]:
        """Return the gauges that are in use (n_d,), by the name of what is lost; ``roll`` (n_d,) are their rows
        [deg], ``axial`` (n_d,) the gauges that read along the axis.

        Raises
        ------
        NoSuchGaugesError
            The layout has no such set.
        """
        rows, n_d, sets = np.unique(roll).tolist(), len(roll), dict[str, BoolArray]()
        if self.gauges == "rows":
            for lost in combinations(rows, self.count):
                sets[" and ".join(f"{row:g}" for row in lost) + " deg"] = ~np.isin(roll, lost)
        elif self.gauges == "all but":
            for _ in range(self.sets if self.count < n_d else 0):
                gauges = np.sort(random.choice(n_d, size=self.count or n_d // 2, replace=False))
                sets["all but " + " ".join(f"{gauge + 1}" for gauge in gauges)] = np.isin(np.arange(n_d), gauges)
        else:
            for direction, remaining in (("hoop", axial), ("axial", ~axial)):
                if self.gauges == "direction":
                    sets[direction] = remaining
                for row in rows if self.gauges != "direction" else ():
                    if self.gauges == "direction of a row":
                        sets[f"{direction} at {row:g} deg"] = remaining | (roll != row)
                    else:
                        sets[f"{direction} and {row:g} deg"] = remaining & (roll != row)
        if not (sensible := {name: gauges for name, gauges in sets.items() if 0 < gauges.sum() < n_d}):
            raise NoSuchGaugesError(f"no such gauges to lose among {n_d} in {len(rows)} rows")
        return sensible


PER_100K, CELSIUS = 1e-4, 273.15

SENSOR_STATIONS = (0.11, 0.36, 0.61, 0.86)
"""Of the standard sensors, over the length of the body; one on each surface of the wall."""


AtEnd = tuple[FloatArray, FloatArray, FloatArray]
"""The end of a heating: strain [m/m] and rise [K] of the gauges (n_d,), and rise at the sensors (n_t,) [K]."""


class Heating(Section):
    """Rise of the wall at the end of the heating, at nose and base [K]."""

    nose_K: float = Field(default=0.0, ge=0.0)
    aft_K: float = Field(default=0.0, ge=0.0)

    def at_end(self, vehicle: Vehicle) -> AtEnd:
        """Return what gauges and sensors get at the end of it."""
        entry = temperature_of(vehicle)
        resolution = Resolutions(map=vehicle.resolution.truth, truth=vehicle.resolution.truth)
        structure = fourier_structure_of(
            vehicle.model_copy(update={"resolution": resolution, TEMPERATURE: entry}),
            vehicle.gauges.layout,
            max_harmonic=HARMONICS,
        )
        ends, rise = np.array([0.0, vehicle.body().length]), np.array([self.nose_K, self.aft_K])
        field = temperature_mode(ends, rise)
        x = np.array([sensor.x_m for sensor in entry.sensor])
        roll = np.radians([sensor.roll_angle_deg for sensor in entry.sensor])
        depth = np.array([float(sensor.surface == "outer") for sensor in entry.sensor])
        return gauge_strain(structure, [field]), gauge_temperature(structure, field), field.at(x, roll, depth)


def standard_temperature(length: float) -> Temperature:
    """Return a section [temperature] with eight sensors for a body of ``length`` [m]."""
    sensors = [
        TemperatureSensor(name=f"{surface} {part:g}", x_m=part * length, surface=surface)
        for part in SENSOR_STATIONS
        for surface in ("inner", "outer")
    ]
    return Temperature(
        expansion_um_per_m_per_K=9.0,
        modulus_percent_per_100K=-4.5,
        gauge_factor_percent_per_100K=-1.0,
        apparent_strain_um_per_m=(0.05, -0.002),
        apparent_strain_scatter_um_per_m_per_K=0.01,
        sensor=sensors,
    )


def temperature_of(vehicle: Vehicle) -> Temperature:
    """Return the section [temperature] of a vehicle; the standard one where it has none."""
    return vehicle.temperature or standard_temperature(vehicle.body().length)


def heated(
    entry: Temperature, end: AtEnd, strain: FloatArray, scatter: FloatArray, random: np.random.Generator
) -> tuple[FloatArray, FloatArray]:
    """Return readings (n, n_d) [m/m] of a wall that warms instead of isothermal ``strain``, and the temperature
    (n, n_t) that sensors measure [K]; ``scatter`` (n or 1, n_d) are standard normal numbers of the gauges."""
    time, (thermal, rise, at_sensors) = random.uniform(0.0, 1.0, (len(strain), 1)), end
    warm = time * rise
    per_kelvin = MICRO * entry.apparent_strain_scatter_um_per_m_per_K * scatter
    powers = [MICRO * c * warm**k for k, c in enumerate(entry.apparent_strain_um_per_m, start=1)]
    sheet = sum(powers, start=per_kelvin * warm)
    softer = 1.0 + PER_100K * entry.modulus_percent_per_100K * warm
    factor = 1.0 + PER_100K * entry.gauge_factor_percent_per_100K * warm
    noise = [sensor.std_K for sensor in entry.sensor] * random.standard_normal((len(strain), len(entry.sensor)))
    measured = entry.reference_degC + CELSIUS + time * at_sensors + noise
    return np.asarray(factor * (strain / softer + time * thermal + sheet)), measured


class Inertia(Section):
    """Acceleration across the axis.

    Attributes
    ----------
    load_factor : specific force [g], to leeward, as the normal force accelerates the vehicle.
    drawn : whether it is the standard deviation along both axes instead, drawn in every sample.
    listed : whether the masses of the vehicle file strain the gauges.
    extra_kg : mass at mid-body that the file does not list.
    bending_um_per_m : amplitude of the first bending mode at the gauge that it strains most, at any phase and
        axis.
    """

    load_factor: float = 0.0
    drawn: bool = False
    listed: bool = True
    extra_kg: float = 0.0
    bending_um_per_m: float = 0.0

    def force(self, leeward: FloatArray, random: np.random.Generator) -> FloatArray:
        """Return (n, 2) the specific force along y and z [m/s2]; ``leeward`` (n,) is the meridian's roll angle."""
        axes = random.standard_normal((len(leeward), 2)) if self.drawn else _across(leeward)
        return STANDARD_GRAVITY * self.load_factor * axes


class AddedStrain:
    """Strain of the gauges of a vehicle on its independent mesh, solved where it is needed."""

    def __init__(self, vehicle: Vehicle) -> None:
        self.vehicle = vehicle

    def inertia(
        self, inertia: Inertia, force: FloatArray, leeward: FloatArray, random: np.random.Generator
    ) -> FloatArray:
        """Return (n, n_d) strain under a specific ``force`` (n, 2) [m/s2], and of the vibration [m/m]."""
        listed, extra, bending = self._by_inertia
        strain = force @ (inertia.listed * listed + inertia.extra_kg * extra).T
        if inertia.bending_um_per_m:
            phase, axis = 2.0 * np.pi * random.random((2, len(leeward), 1))
            size = MICRO * inertia.bending_um_per_m * np.sin(phase) * _across(axis[:, 0])
            strain = strain + size @ bending.T
        return np.asarray(strain)

    def friction(self, coefficient: float, dynamic_pressure: FloatArray) -> FloatArray:
        """Return (n, n_d) strain by an axial ``coefficient`` of friction that is even over the surface [m/m]."""
        force = coefficient * self.vehicle.reference_quantities().area * dynamic_pressure
        area = mesh_of_grid(truth_surface(self.vehicle)).node_area.sum()
        return np.outer(force / area, self._by_friction)

    @cached_property
    def _by_inertia(self) -> tuple[FloatArray, FloatArray, FloatArray]:
        """(n_d, 2) per specific force along y and z of the listed masses and of 1 kg at mid-body [s2/m], and of
        the first bending mode [1]."""
        entry, middle = self.vehicle.mass or Mass(), 0.5 * self.vehicle.body().length
        strain = strain_by_inertia(self.vehicle, entry, self.vehicle.resolution.truth, [middle])
        return strain.of_listed[:, 1:3], strain.by_part[f"{UNLISTED} 1"][:, 1:3], strain.by_bending

    @cached_property
    def _by_friction(self) -> FloatArray:
        """(n_d,) strain per pressure of friction along the axis [1/Pa]."""
        vehicle, walled = self.vehicle, meshed_wall(self.vehicle, self.vehicle.resolution.truth)
        mesh = walled.mesh()
        layout = vehicle.gauges.layout
        gauges = place_layouts(vehicle, mesh, [layout])[1][layout]
        # A cover of 1 kg/m2 under a specific force of 1 m/s2 pulls with 1 Pa, towards the nose.
        cover = MeridianMasses(
            density=(0.0,) * (1 + len(mesh.materials)), covers=((0.0, walled.body.length, 1.0),)
        )
        return -inertia_strain(mesh, walled.wall.material, gauges, {"": cover}, unit=0.0)[""][:, 0]


def _across(angle: FloatArray) -> FloatArray:
    """Return (n, 2) unit vectors along y and z at roll angles (n,) [rad]."""
    return np.column_stack([np.sin(angle), np.cos(angle)])
