"""Strain and coefficients of the independent model at any flight condition, for any vehicle as built.

The structure is solved for the wall of the file and for one 4 % thinner and thicker, and at stations 1 mm ahead
of and behind each gauge; what a vehicle as built reads follows by a parabola in the thickness and a line along
the meridian. Roll and orientation of the gauges are exact.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from types import EllipsisType

import numpy as np

from builder.aero.loads.operator import coefficient_scale, load_operator
from builder.reporting import Progress
from builder.structure.as_built.vehicle import AsBuilt
from builder.structure.fourier.gauges import PlacedGauges
from builder.structure.fourier.inner_surface import inner_surface_points
from builder.structure.fourier.meridian_mesh import MeridianMesh
from builder.structure.fourier.model import place_layouts
from builder.structure.fourier.shell_mesh import shell_mesh, yielding_clamp
from builder.structure.fourier.strain_operator import HarmonicResponse, harmonic_response
from builder.structure.wall import wall_of
from builder.truth.revolution.flow_table import FlowTable, harmonics_at
from builder.vehicle.file import Vehicle
from builder.vehicle.model_entries import Resolution
from builder.vehicle.shape.geometry import SurfaceGrid, surface_grid
from strainfmu.arrays import FloatArray
from strainfmu.errors import InputError
from strainfmu.flight_condition import FlightCondition

WALL_STEP = 0.04
"""Step of the wall's thickness, relative to it."""

SHIFT = 1e-3
"""Step along the meridian [m]."""

CLAMP_STEP, RIGID = 2e-3, 1e-7
"""Length of wall that yields as the clamp does, for its slope, and one that counts as none [m]."""


@dataclass(frozen=True, eq=False, kw_only=True)
class TrueStructure:
    """Strain of every gauge per harmonic of the pressure, meridional, hoop and shear: (3, n_d, n_m, n_x) [1/Pa].

    Attributes
    ----------
    nominal, thin, thick, fore, aft : of the wall of the file, of thinner and thicker ones, and 1 mm along the
        surface.
    soft : (2, 3, n_d, n_m, n_x) change by the clamp's compliance along and across the body [1/(Pa m)]; (0, ..)
        where [noise] states none.
    names : of the gauges.
    placed : gauges on the inner surface.
    radius : (n_d,) of the inner surface there [m].
    surface : the pressure nodes.
    """

    nominal: FloatArray
    thin: FloatArray
    thick: FloatArray
    fore: FloatArray
    aft: FloatArray
    soft: FloatArray
    names: tuple[str, ...]
    placed: PlacedGauges
    radius: FloatArray
    surface: SurfaceGrid


def true_structure(vehicle: Vehicle, progress: Progress | None = None) -> TrueStructure:
    """Solve the structure of ``vehicle`` at the resolution of its independent model.

    Raises
    ------
    InputError
        The wall does not fit the body, a gauge is not on the inner surface, or the Fourier model cannot do what
        the file requests.
    """
    settings, body, layout = vehicle.resolution.truth, vehicle.body(), vehicle.gauges.layout
    surface = surface_grid(body, settings.surface_stations, settings.surface_roll_angles)
    wall = wall_of(vehicle)

    def mesh_of(resolution: Resolution, factor: float) -> MeridianMesh:
        changed = replace(wall, thickness=factor * wall.thickness)
        return shell_mesh(body, changed, 1e-3 * resolution.element_length_mm, resolution.wall_layers)

    def solve(resolution: Resolution, factor: float, x: FloatArray) -> HarmonicResponse:
        return harmonic_response(mesh_of(resolution, factor), wall.material, x, surface.x, settings.harmonics)

    def clamped(axial: float, across: float) -> FloatArray:
        held = yielding_clamp(mesh_of(vehicle.resolution.map, 1.0), wall.material, axial, across)
        return _at(harmonic_response(held, wall.material, placed.x, surface.x, settings.harmonics), placed.x)

    mesh = mesh_of(settings, 1.0)
    layouts, all_placed = place_layouts(vehicle, mesh, [layout])
    placed = all_placed[layout]
    at_gauge = inner_surface_points(mesh, placed.x)
    step = SHIFT * at_gauge.tangent[:, 0]
    nominal = _at(
        harmonic_response(mesh, wall.material, placed.x, surface.x, settings.harmonics, progress), placed.x
    )
    # What changes is small: the mesh of the map shows it as well as the finer one.
    coarse = vehicle.resolution.map
    stations = np.concatenate([placed.x, placed.x - step, placed.x + step])
    response = solve(coarse, 1.0, stations)
    fore, aft = (_at(response, placed.x + sign * step) - _at(response, placed.x) for sign in (-1.0, 1.0))
    thin, thick = (
        _at(solve(coarse, factor, placed.x), placed.x) - _at(response, placed.x)
        for factor in (1.0 - WALL_STEP, 1.0 + WALL_STEP)
    )
    soft = np.zeros((0, *nominal.shape))
    if vehicle.noise.clamp_compliance_mm > 0.0:
        soft = np.array([clamped(CLAMP_STEP, RIGID), clamped(RIGID, CLAMP_STEP)]) - clamped(RIGID, RIGID)
    return TrueStructure(
        soft=soft / CLAMP_STEP,
        nominal=nominal,
        fore=nominal + fore,
        aft=nominal + aft,
        thin=nominal + thin,
        thick=nominal + thick,
        names=layouts[layout].names,
        placed=placed,
        radius=at_gauge.radius,
        surface=surface,
    )


def _at(response: HarmonicResponse, stations: FloatArray) -> FloatArray:
    """Return (3, n_d, n_m, n_x) at ``stations`` (n_d,) [m]."""
    index = np.abs(stations[:, None] - response.gauge_x).argmin(axis=1)
    return np.stack([response.meridional[index], response.hoop[index], response.shear[index]])


@dataclass(frozen=True, eq=False, kw_only=True)
class TrueFlights:
    """Flights at k conditions, ready for any vehicle as built.

    Attributes
    ----------
    conditions : k flight conditions.
    strain : (n, 3, k, n_d, n_m) strain of the n states of :class:`TrueStructure` per harmonic, of p / p_inf
        [1/Pa].
    unit_strain : (n, 3, n_d, 1) of the same states, per uniform outer pressure [1/Pa].
    coefficients : (k, 5) C_A, C_N, C_Y, M_P, M_Y [1].
    ambient_pressure, dynamic_pressure : (k,) p_inf and q_inf [Pa].
    internal_pressure : (k,) stated pressure inside [Pa].
    """

    conditions: tuple[FlightCondition, ...]
    strain: FloatArray
    unit_strain: FloatArray
    coefficients: FloatArray
    ambient_pressure: FloatArray
    dynamic_pressure: FloatArray
    internal_pressure: FloatArray


def true_flights(
    vehicle: Vehicle, structure: TrueStructure, table: FlowTable, conditions: list[FlightCondition]
) -> TrueFlights:
    """Return the flights of ``vehicle`` at ``conditions``.

    Raises
    ------
    InputError
        A condition is outside the table.
    """
    mach = np.array([condition.mach_number for condition in conditions])
    incidence = np.array([condition.total_incidence for condition in conditions])
    return flights_of_harmonics(vehicle, structure, harmonics_at(table, mach, incidence), conditions)


def flights_of_harmonics(
    vehicle: Vehicle, structure: TrueStructure, harmonic: FloatArray, conditions: list[FlightCondition]
) -> TrueFlights:
    """Return the flights of ``vehicle`` at ``conditions`` under known pressure.

    ``harmonic`` (k, n_x, n_m) are amplitudes of cos(m phi) in p / p_inf, phi from the leeward meridian, at the
    stations of the structure.
    """
    ambient = np.array([condition.ambient_pressure for condition in conditions])
    inside = np.array([vehicle.internal_pressure(condition) for condition in conditions])
    states = (structure.nominal, structure.thin, structure.thick, structure.fore, structure.aft, *structure.soft)
    strain = np.array(
        [[np.einsum("gmx,kxm->kgm", part, harmonic, optimize=True) for part in state] for state in states]
    )
    return TrueFlights(
        conditions=tuple(conditions),
        strain=strain,
        unit_strain=np.array([state[:, :, :1].sum(axis=3) for state in states]),
        coefficients=_coefficients(vehicle, structure.surface, harmonic, conditions, ambient, inside),
        ambient_pressure=ambient,
        dynamic_pressure=np.array([condition.dynamic_pressure for condition in conditions]),
        internal_pressure=inside,
    )


def _coefficients(
    vehicle: Vehicle,
    surface: SurfaceGrid,
    harmonic: FloatArray,
    conditions: list[FlightCondition],
    ambient: FloatArray,
    inside: FloatArray,
) -> FloatArray:
    """Return (k, 5): C_A of harmonic 0, cross force and moment of harmonic 1, turned to the wind's roll angle."""
    reference = vehicle.reference_quantities()
    loads = load_operator(surface, reference.moment_station).reshape(5, len(surface.x), surface.n_roll)
    axial, cosine = loads[0].sum(axis=1), np.cos(surface.roll_angle)
    force, moment = loads[1] @ cosine, loads[3] @ cosine
    roll = np.array([condition.leeward_roll_angle for condition in conditions])
    out = np.empty((len(conditions), 5))
    out[:, 0] = ambient * (harmonic[:, :, 0] @ axial) - inside * axial.sum()
    across, turning = ambient * (harmonic[:, :, 1] @ force), ambient * (harmonic[:, :, 1] @ moment)
    out[:, 1], out[:, 2] = across * np.cos(roll), across * np.sin(roll)
    out[:, 3], out[:, 4] = turning * np.cos(roll), turning * np.sin(roll)
    scale = np.array([coefficient_scale(condition.dynamic_pressure, reference) for condition in conditions])
    return out * scale


@dataclass(frozen=True, eq=False, kw_only=True)
class BuiltGauges:
    """Gauges of a vehicle as built, without gain.

    Attributes
    ----------
    even, odd : (.., n_d, n_m, ..) response in the gauge's direction: cosine and sine part round the body.
    roll_angle : (n_d,) where the gauge is [rad].
    """

    even: FloatArray
    odd: FloatArray
    roll_angle: FloatArray


def built_gauges(structure: TrueStructure, built: AsBuilt, states: FloatArray | None = None) -> BuiltGauges:
    """Return the gauges of a vehicle as ``built``, or of v vehicles at once.

    ``states`` (n, 3, .., n_d, n_m) holds quantities of the n states of the structure to combine, 5 or, with a
    clamp that yields, 7; None takes the responses themselves, (n, 3, n_d, n_m, n_x) [1/Pa].

    Raises
    ------
    InputError
        The clamp of ``built`` yields, but the structure's was not solved for that.
    """
    if states is None:
        five = structure.nominal, structure.thin, structure.thick, structure.fore, structure.aft
        states = np.stack([*five, *structure.soft])
        inner: tuple[EllipsisType | None, ...] = (..., None, None)
    else:
        inner = (..., None)
    t = built.of_all("wall_thickness")[inner] / WALL_STEP
    along = built.axial_shift[inner] / SHIFT
    nominal, thin, thick, fore, aft, *soft = states
    yields = [one[inner] for one in (built.clamp_axial, built.clamp_transverse)]
    if not soft and any(one.any() for one in yields):
        raise InputError("this structure was solved for a rigid clamp; noise.clamp_compliance_mm is 0")

    def part(which: int) -> FloatArray:
        slope, bend = thick[which] - thin[which], thick[which] - 2.0 * nominal[which] + thin[which]
        of_wall = nominal[which] + 0.5 * t * slope + 0.5 * t * t * bend
        of_clamp = sum((size * one[which] for size, one in zip(yields, soft, strict=False)), np.zeros(()))
        return np.asarray(of_wall + 0.5 * along * (aft[which] - fore[which]) + of_clamp)

    placed = structure.placed
    turn_c, turn_s = np.cos(built.orientation), np.sin(built.orientation)
    c = (turn_c * placed.meridional - turn_s * placed.circumferential)[inner]
    s = (turn_s * placed.meridional + turn_c * placed.circumferential)[inner]
    return BuiltGauges(
        even=c * c * part(0) + s * s * part(1),
        odd=2.0 * c * s * part(2),
        roll_angle=placed.roll_angle + built.layout_roll + built.circumferential_shift / structure.radius,
    )


def true_strain(structure: TrueStructure, flights: TrueFlights, built: AsBuilt) -> FloatArray:
    """Return (k, n_d) strain of the gauges [m/m], without noise, that a vehicle as ``built`` reads.

    For v vehicles (:func:`builder.truth.as_built.drawn_many`) there must be one flight, and the strain is (v,
    n_d).
    """
    gauges = built_gauges(structure, built, flights.strain)
    wind = np.array([condition.leeward_roll_angle for condition in flights.conditions])
    phase = gauges.roll_angle - wind[:, None]
    # Multiples of the phase by rotation: a cosine per harmonic and gauge would cost ten times as much.
    turn = np.exp(1j * phase)
    around, of_flow = np.ones_like(turn), np.zeros(phase.shape)
    for m in range(gauges.even.shape[-1]):
        of_flow += gauges.even[..., m] * around.real + gauges.odd[..., m] * around.imag
        around = around * turn
    ambient = flights.ambient_pressure[:, None]
    inside = flights.internal_pressure[:, None] + built.internal_pressure * ambient
    of_unit = built_gauges(structure, built, flights.unit_strain).even[..., 0]
    gain = (1.0 + built.gauge_gain) * (1.0 + built.common_gain)
    return np.asarray(gain * (ambient * of_flow - inside * of_unit) + built.apparent_strain)


def without_faint_harmonics(flights: TrueFlights, faint: float = 2e-4) -> TrueFlights:
    """Return ``flights`` without the highest harmonics, whose strain is below ``faint`` of the largest."""
    size = np.abs(flights.strain).max(axis=(0, 1, 2, 3))
    kept = int(np.flatnonzero(size > faint * size.max())[-1]) + 1
    return replace(flights, strain=flights.strain[..., :kept])


def one_flight(flights: TrueFlights, number: int) -> TrueFlights:
    """Return flight ``number`` alone."""
    return some_flights(flights, slice(number, number + 1))


def some_flights(flights: TrueFlights, rows: slice) -> TrueFlights:
    """Return the flights ``rows``."""
    return TrueFlights(
        conditions=flights.conditions[rows],
        strain=flights.strain[:, :, rows],
        unit_strain=flights.unit_strain,
        coefficients=flights.coefficients[rows],
        ambient_pressure=flights.ambient_pressure[rows],
        dynamic_pressure=flights.dynamic_pressure[rows],
        internal_pressure=flights.internal_pressure[rows],
    )
