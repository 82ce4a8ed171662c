"""Strain of candidate gauges under pressure fields, and what errors of their place and of the wall do to it."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.sparse import csr_array, vstack

from builder.campaign.snapshots import Snapshots
from builder.inverse.noise.hardware_errors import WALL_STEP
from builder.inverse.noise.thermal import HARMONICS, thermal_map
from builder.placement.pressure_basis import PressureBasis
from builder.reporting import Progress
from builder.structure.as_built.as_built_structure import SHIFT
from builder.structure.fourier.inner_surface import PlacedGauges, inner_surface_points, place_gauges
from builder.structure.fourier.meridian_mesh import NO_NODES, MeridianMesh
from builder.structure.fourier.shell_mesh import meshed_wall
from builder.structure.fourier.strain_operator import distinct_stations, response_to_fields, station_index
from builder.structure.loads.fourier import fourier_structure
from builder.structure.loads.of_vehicle import load_properties
from builder.structure.mapped_structure import mapped_fields
from builder.structure.solid.case import SolidCase
from builder.structure.solid.gauge_layouts import (
    AFT,
    AROUND,
    BACK,
    FORE,
    TURNED_AROUND,
    TURNED_BACK,
    displaced_name,
    displaced_on_surface,
    surface_axes,
)
from builder.structure.solid.gauge_layouts import STEP as SOLID_STEP
from builder.structure.solid.gauge_rows import Gauges, gauge_rows, joined_gauges
from builder.structure.solid.nodal_loads import split_surface
from builder.structure.solid.solid_mesh import EXTERNAL
from builder.structure.solid.strain_solution import solve_fields
from builder.structure.wall import Wall
from builder.vehicle.file import Vehicle
from builder.vehicle.gauges.layout import GaugeLayout
from builder.vehicle.shape.geometry import SurfaceGrid
from strainfmu.arrays import FloatArray


@dataclass(frozen=True, eq=False, kw_only=True)
class CandidateStrain:
    """Strain of n gauges per field of a basis of K.

    Attributes
    ----------
    strain : (n, K) [1/Pa].
    axial, circumferential : (n, K) derivatives by the gauge's position along the surface [1/(Pa m)].
    orientation : (n, K) by the angle of its direction in the surface [1/(Pa rad)].
    layout_roll : (n, K) by the roll angle of all gauges together [1/(Pa rad)].
    wall_thickness : (n, K) by the relative thickness of the wall [1/Pa].
    thermal : (n, k) strain of modes of the wall's temperature at one standard deviation; k = 0 without.
    """

    strain: FloatArray
    axial: FloatArray
    circumferential: FloatArray
    orientation: FloatArray
    layout_roll: FloatArray
    wall_thickness: FloatArray
    thermal: FloatArray


def fourier_strain(
    vehicle: Vehicle,
    grid: SurfaceGrid,
    basis: PressureBasis,
    layout: GaugeLayout,
    progress: Progress | None = None,
) -> CandidateStrain:
    """Return the strain of gauges on the inner surface of a body of revolution, by the semi-analytic model.

    Raises
    ------
    InputError
        A gauge is not on the inner surface, or lies within a millimetre of its end.
    """
    walled = meshed_wall(vehicle)
    wall, mesh = walled.wall, walled.mesh()
    placed = place_gauges(mesh, layout.position, layout.direction, layout.names)
    stations = distinct_stations(placed.x)
    points = inner_surface_points(mesh, stations)
    step = SHIFT * points.tangent[:, 0]
    last = min(len(basis.along) - 1, vehicle.resolution.map.harmonics, (grid.n_roll - 1) // 2)
    shapes = [
        shape / np.linalg.norm(np.cos(m * grid.roll_angle)) if m <= last else np.zeros_like(shape)
        for m, shape in enumerate(basis.along)
    ]

    def response(on: MeridianMesh, x: FloatArray) -> list[FloatArray]:
        return response_to_fields(on, wall.material, x, grid.x, shapes)

    harmonics = _Harmonics(basis, placed, station_index(stations, placed.x))
    done = 0

    def count(responses: list[FloatArray]) -> list[FloatArray]:
        nonlocal done
        done += 1
        if progress is not None:
            progress(done, 3)
        return responses

    three = count(response(mesh, np.concatenate([stations, stations + step, stations - step])))
    at_gauge, aft, fore = (
        [of_harmonic[part * len(stations) : (part + 1) * len(stations)] for of_harmonic in three]
        for part in range(3)
    )
    thin, thick = (
        count(response(walled.mesh(wall.thicker(factor)), stations))
        for factor in (1.0 - WALL_STEP, 1.0 + WALL_STEP)
    )
    by_roll = harmonics.reading(at_gauge, by_roll=True)
    return CandidateStrain(
        strain=harmonics.reading(at_gauge),
        axial=harmonics.reading([(a - b) / (2.0 * SHIFT) for a, b in zip(aft, fore, strict=True)]),
        circumferential=by_roll / points.radius[harmonics.station][:, None],
        orientation=harmonics.reading(at_gauge, turned=True),
        layout_roll=by_roll,
        wall_thickness=harmonics.reading([(a - b) / (2.0 * WALL_STEP) for a, b in zip(thick, thin, strict=True)]),
        thermal=_thermal(vehicle, wall, mesh, placed),
    )


def solid_strain(
    case: SolidCase,
    snapshots: Snapshots,
    basis: PressureBasis,
    gauges: Gauges,
    progress: Progress | None = None,
) -> CandidateStrain:
    """Return the strain of gauges on a surface of any shape, by the solid model.

    As in a map, strain goes with 1 / t of the wall's thickness; modes of temperature are not counted.

    Raises
    ------
    InputError
        A gauge is not on its surface.
    """
    moved = displaced_on_surface("", gauges, *surface_axes(case.mesh.full, gauges))
    own_part, moved_part, solved_part = _parts_of(progress, (0.1, 0.6, 1.0))
    rows = [gauge_rows(case.mesh.full, gauges, progress=own_part)]
    # All in one call: directions at one point share the search for it.
    together = joined_gauges([*moved.values()])
    rows.append(gauge_rows(case.mesh.full, together, near_surface=True, progress=moved_part))
    fields = mapped_fields(basis.fields, split_surface(case.mesh.full, EXTERNAL)[0], snapshots)
    of_all = csr_array(vstack(rows))
    strain = solve_fields(
        case.mesh.full, case.matter, case.support, of_all, fields, solver_name=case.solver, progress=solved_part
    )
    at_gauge, *displaced = np.split(strain, 1 + len(moved))
    strain_of = dict(zip(moved, displaced, strict=True))

    def difference(plus: str, minus: str, step: float) -> FloatArray:
        return (strain_of[displaced_name("", plus)] - strain_of[displaced_name("", minus)]) / step

    around = difference(AROUND, BACK, 2.0 * SOLID_STEP)
    return CandidateStrain(
        strain=at_gauge,
        axial=difference(AFT, FORE, 2.0 * SOLID_STEP),
        circumferential=around,
        orientation=difference(TURNED_AROUND, TURNED_BACK, 1.0),
        layout_roll=np.hypot(gauges.position[:, 1], gauges.position[:, 2])[:, None] * around,
        wall_thickness=-at_gauge,
        thermal=np.zeros((len(at_gauge), 0)),
    )


def _parts_of(progress: Progress | None, ends: Sequence[float]) -> list[Progress | None]:
    """Return the progress of parts of a stage that end at shares ``ends`` of its time."""
    if progress is None:
        return [None] * len(ends)

    def part(begin: float, end: float) -> Progress:
        return lambda done, total: progress(round(1000 * (begin + (end - begin) * done / total)), 1000)

    return [part(begin, end) for begin, end in zip((0.0, *ends[:-1]), ends, strict=True)]


def _thermal(vehicle: Vehicle, wall: Wall, mesh: MeridianMesh, gauges: PlacedGauges) -> FloatArray:
    """Return (n, k) strain of modes of the wall's temperature as far as its sensors leave them unknown [m/m]."""
    entry = vehicle.temperature
    if entry is None:
        return np.zeros((len(gauges.x), 0))
    if vehicle.structure.support == "free_flight":
        mesh = replace(mesh, clamped_node=NO_NODES)
    solved = fourier_structure(
        mesh, wall.material, gauges, load_properties(vehicle.material, entry, wall), max_harmonic=HARMONICS
    )
    modes = thermal_map(vehicle, solved)
    assert modes is not None
    reading = modes.sensor_operator / modes.sensor_std[:, None]
    precision = np.diag(modes.prior_std**-2) + reading.T @ reading
    return np.asarray(modes.linear_strain @ np.linalg.inv(np.linalg.cholesky(precision)).T)


@dataclass(frozen=True, eq=False)
class _Harmonics:
    """Gauges that read strain amplitudes of the fields; ``station`` (n,) is the number of each gauge's station."""

    basis: PressureBasis
    gauges: PlacedGauges
    station: np.ndarray

    def reading(self, response: Sequence[FloatArray], by_roll: bool = False, turned: bool = False) -> FloatArray:
        """Return (n, K) readings of ``response``, per harmonic (n_stations, 3, k_m); or a derivative of them.

        Meridional and hoop strain of a pressure ~ cos m phi go as cos m phi, shear as sin m phi; of ~ sin m phi
        they go as sin m phi and -cos m phi. ``by_roll`` is by the gauge's roll angle, ``turned`` by its direction.
        """
        c, s = self.gauges.meridional[:, None], self.gauges.circumferential[:, None]
        weight = (-2.0 * c * s, 2.0 * c * s, 2.0 * (c * c - s * s)) if turned else (c * c, s * s, 2.0 * c * s)
        parts = []
        for m, amplitudes in enumerate(response):
            of_gauge = amplitudes[self.station]
            even = weight[0] * of_gauge[:, 0] + weight[1] * of_gauge[:, 1]
            odd = weight[2] * of_gauge[:, 2]
            angle = m * self.gauges.roll_angle[:, None]
            cosine, sine = (-m * np.sin(angle), m * np.cos(angle)) if by_roll else (np.cos(angle), np.sin(angle))
            parts.append(even * cosine + odd * sine)
            if m:
                parts.append(even * sine - odd * cosine)
        return np.hstack(parts)
