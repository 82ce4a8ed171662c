"""Strain and coefficients of the independent model at any flight condition, for any vehicle as built.

The structure is solved for the wall of the file and for one 4 % thinner and thicker, and at stations 1 mm ahead
of and behind each gauge; what a vehicle as built reads follows by a parabola in the thickness and a line along
the meridian. Roll and orientation of the gauges are exact.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from builder.aero.loads import coefficient_scale, load_operator
from builder.structure.fourier.gauges import PlacedGauges
from builder.structure.fourier.inner_surface import inner_surface_points
from builder.structure.fourier.model import place_layouts
from builder.structure.fourier.shell_mesh import shell_mesh
from builder.structure.fourier.strain_operator import HarmonicResponse, harmonic_response
from builder.structure.wall import wall_of
from builder.truth.as_built import AsBuilt
from builder.truth.flow_table import FlowTable, harmonics_at
from builder.vehicle.file import Vehicle
from builder.vehicle.geometry import SurfaceGrid, surface_grid
from strainfmu.arrays import FloatArray
from strainfmu.flight_condition import FlightCondition

WALL_STEP = 0.04
"""Step of the wall's thickness, relative to it."""

SHIFT = 1e-3
"""Step along the meridian [m]."""


@dataclass(frozen=True, eq=False, kw_only=True)
class TrueStructure:
    """Strain of every gauge per harmonic of the pressure, meridional, hoop and shear: (3, n_d, n_m, n_x) [1/Pa].

    Attributes
    ----------
    nominal, thin, thick, fore, aft : of the wall of the file, of thinner and thicker ones, and 1 mm along the
        surface.
    placed : gauges on the inner surface.
    radius : (n_d,) of the inner surface there [m].
    surface : the pressure nodes.
    """

    nominal: FloatArray
    thin: FloatArray
    thick: FloatArray
    fore: FloatArray
    aft: FloatArray
    placed: PlacedGauges
    radius: FloatArray
    surface: SurfaceGrid


def true_structure(vehicle: Vehicle) -> TrueStructure:
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

    def mesh_of(factor: float):  # type: ignore[no-untyped-def]  # the mesh is private to this function
        changed = replace(wall, thickness=factor * wall.thickness)
        return shell_mesh(body, changed, 1e-3 * settings.element_length_mm, settings.wall_layers)

    mesh = mesh_of(1.0)
    placed = place_layouts(vehicle, mesh, [layout])[1][layout]
    at_gauge = inner_surface_points(mesh, placed.x)
    step = SHIFT * at_gauge.tangent[:, 0]
    stations = np.concatenate([placed.x, placed.x - step, placed.x + step])
    response = harmonic_response(mesh, wall.material, stations, surface.x, settings.harmonics)
    thin, thick = (
        harmonic_response(mesh_of(factor), wall.material, placed.x, surface.x, settings.harmonics)
        for factor in (1.0 - WALL_STEP, 1.0 + WALL_STEP)
    )
    return TrueStructure(
        nominal=_at(response, placed.x),
        fore=_at(response, placed.x - step),
        aft=_at(response, placed.x + step),
        thin=_at(thin, placed.x),
        thick=_at(thick, placed.x),
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
    strain : (5, 3, k, n_d, n_m) strain of the five states of :class:`TrueStructure` per harmonic, of p / p_inf
        [1/Pa].
    coefficients : (k, 5) C_A, C_N, C_Y, M_P, M_Y [1].
    ambient_pressure, dynamic_pressure : (k,) p_inf and q_inf [Pa].
    internal_pressure : (k,) stated pressure inside [Pa].
    """

    conditions: tuple[FlightCondition, ...]
    strain: FloatArray
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
    harmonic = harmonics_at(table, mach, incidence)
    ambient = np.array([condition.ambient_pressure for condition in conditions])
    inside = np.array([vehicle.internal_pressure(condition) for condition in conditions])
    states = (structure.nominal, structure.thin, structure.thick, structure.fore, structure.aft)
    strain = np.array(
        [[np.einsum("gmx,kxm->kgm", part, harmonic, optimize=True) for part in state] for state in states]
    )
    return TrueFlights(
        conditions=tuple(conditions),
        strain=strain,
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


def true_strain(structure: TrueStructure, flights: TrueFlights, built: AsBuilt) -> FloatArray:
    """Return (k, n_d) strain of the gauges [m/m], without noise, that a vehicle as ``built`` reads."""
    # Pressure from both sides acts on the same wall: harmonic 0 of the pressure inside is a constant.
    states = (structure.nominal, structure.thin, structure.thick, structure.fore, structure.aft)
    of_unit = np.array([state[:, :, 0].sum(axis=2) for state in states])
    ratio = flights.internal_pressure / flights.ambient_pressure + built.internal_pressure
    net = flights.strain.copy()
    net[..., 0] -= ratio[:, None] * of_unit[:, :, None, :]
    t = built.wall_thickness / WALL_STEP
    along = built.axial_shift / SHIFT
    nominal, thin, thick, fore, aft = net
    parts = nominal + 0.5 * t * (thick - thin) + 0.5 * t * t * (thick - 2.0 * nominal + thin)
    parts = parts + (0.5 * along)[:, None] * (aft - fore)
    placed = structure.placed
    turn_c, turn_s = np.cos(built.orientation), np.sin(built.orientation)
    c = turn_c * placed.meridional - turn_s * placed.circumferential
    s = turn_s * placed.meridional + turn_c * placed.circumferential
    roll = placed.roll_angle + built.layout_roll + built.circumferential_shift / structure.radius
    wind = np.array([condition.leeward_roll_angle for condition in flights.conditions])
    even = (c * c)[:, None] * parts[0] + (s * s)[:, None] * parts[1]
    odd = (2.0 * c * s)[:, None] * parts[2]
    phase = (roll - wind[:, None])[:, :, None] * np.arange(even.shape[2])
    strain = flights.ambient_pressure[:, None] * np.sum(even * np.cos(phase) + odd * np.sin(phase), axis=2)
    gain = (1.0 + built.gauge_gain) * (1.0 + built.common_gain)
    return np.asarray(gain * strain + built.apparent_strain)
