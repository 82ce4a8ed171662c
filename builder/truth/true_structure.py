"""Strain and coefficients of the independent model at any flight condition, for any vehicle as built, and its
flight model for system simulations.

The structure is solved for the wall of the file on its own mesh; how strain changes with the errors of a vehicle
as built follows :mod:`builder.structure.as_built.revolved`.
"""

import math
from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass, replace
from math import factorial
from typing import Any

import numpy as np
from scipy.interpolate import CubicSpline

from builder.aero.load_operator import coefficient_scales_at, load_operator
from builder.reporting import Progress
from builder.structure.as_built.as_built_structure import AsBuiltStructure
from builder.structure.as_built.as_built_vehicle import AsBuilt
from builder.structure.as_built.gauge_strain_terms import FlightGauges, gain_of
from builder.structure.as_built.reading_slopes import CLAMP
from builder.structure.as_built.response_tables import ResponseTable
from builder.structure.as_built.revolved import (
    SOLVED,
    RevolvedStructure,
    changed_alike,
    revolved_structure,
    table_under,
)
from builder.structure.as_built.wall_changes import WAVES
from builder.structure.as_built_kinds import IN_NOISE
from builder.structure.fourier.fourier_model import place_layouts
from builder.structure.fourier.shell_mesh import meshed_wall
from builder.structure.fourier.strain_operator import harmonic_response
from builder.truth.flights import Flights, pressures_at
from builder.truth.flow_table import FlowTable, by_parity
from builder.vehicle.file import Vehicle
from builder.vehicle.shape.geometry import SurfaceGrid, surface_grid
from strainfmu.arrays import FloatArray
from strainfmu.cosim.models.flight_model import FlightModel
from strainfmu.estimator.map.sensors import STRAIN, SensorRows
from strainfmu.flight_condition import FlightCondition

WALL_STEP = 0.04
"""Step of the wall's thickness, relative to it."""


TrueStructure = RevolvedStructure
"""The structure of the independent model."""


def true_structure(
    vehicle: Vehicle, progress: Progress | None = None, kinds: Collection[str] | None = None
) -> TrueStructure:
    """Solve the structure of ``vehicle`` at the resolution of its independent model.

    ``kinds`` are the kinds of error that it is solved for; by default those that [noise] states and
    :data:`~builder.structure.as_built.revolved.SOLVED`.

    Raises
    ------
    InputError
        The wall does not fit the body, a gauge is not on the inner surface, or the Fourier model cannot do what
        the file requests.
    """
    settings, body, layout = vehicle.resolution.truth, vehicle.body(), vehicle.gauges.layout
    surface = surface_grid(body, *settings.surface_nodes)
    walled = meshed_wall(vehicle, settings)
    mesh = walled.mesh()
    layouts, all_placed = place_layouts(vehicle, mesh, [layout])
    placed = all_placed[layout]
    nominal = harmonic_response(mesh, walled.wall.material, placed.x, surface.x, settings.harmonics, progress)
    if kinds is None:
        # Other kinds are tried at fixed sizes as well, whatever [noise] states.
        stated = {kind.name for kind in IN_NOISE if kind.std(vehicle.noise) > 0.0}
        kinds = stated.union(SOLVED).difference(set(CLAMP) - stated)
    return revolved_structure(
        vehicle,
        layout,
        names=layouts[layout].names,
        placed=placed,
        nominal=nominal,
        surface=surface,
        kinds=kinds,
        wall_step=WALL_STEP,
    )


@dataclass(frozen=True, eq=False, kw_only=True)
class BuiltSensors(FlightGauges):
    """The n_s auxiliary sensors of one vehicle, all at roll angle 0, in units of their own.

    Attributes
    ----------
    kind, unit : of the readings.
    std, largest : (n_s,) standard deviation of the noise, and largest reading [unit].
    thrust_response : (n_s,) [unit/N].
    """

    kind: tuple[str, ...]
    unit: tuple[str, ...]
    std: FloatArray
    largest: FloatArray
    thrust_response: FloatArray

    @property
    def of_uniform(self) -> FloatArray:
        """(n_s,) reading per uniform pressure outside [unit/Pa]."""
        return np.asarray(self.response[:, 0, :, 0].sum(axis=1))

    def rows(self, n_gauges: int, noise_std: float) -> SensorRows:
        """Return what the rows of a plant read: ``n_gauges`` gauges of noise ``noise_std`` [m/m], then these."""
        unit = np.ones(n_gauges)
        return SensorRows(
            kind=(*(STRAIN,) * n_gauges, *self.kind),
            unit=(*("m/m",) * n_gauges, *self.unit),
            scale=np.concatenate([unit, self.std / noise_std]),
            largest=np.concatenate([unit, self.largest]),
            thrust_response=np.concatenate([0.0 * unit, self.thrust_response]),
        )


def sensor_response(operator: FloatArray, surface: SurfaceGrid, max_harmonic: int) -> FloatArray:
    """Return the response of :class:`BuiltSensors` from readings per nodal pressure, (n_s, n_p) [unit/Pa]."""
    m = np.arange(max_harmonic + 1)
    by_node = operator.reshape(len(operator), len(surface.x), surface.n_roll)
    phase = np.outer(surface.roll_angle, m)
    # A pressure cos m (phi - phi_T) is seen from roll angle 0, where the angle to the crest is -phi_T.
    even, odd = by_node @ np.cos(phase), -(by_node @ np.sin(phase))
    return np.stack([even, odd], axis=-1).transpose(0, 2, 1, 3)


def sensor_readings(
    sensors: BuiltSensors, harmonic: FloatArray, conditions: Sequence[FlightCondition]
) -> FloatArray:
    """Return (k, n_s) readings, without noise, where the inside is at p_inf.

    ``harmonic`` (k, n_x, n_m) are amplitudes of cos(m phi) in p / p_inf, as of the flights of the gauges.
    """
    roll = np.array([condition.leeward_roll_angle for condition in conditions])
    ambient = np.array([condition.ambient_pressure for condition in conditions])[:, None]
    dynamic = np.array([condition.dynamic_pressure for condition in conditions])[:, None]
    phase = -np.outer(roll, np.arange(harmonic.shape[2]))
    by_harmonic = np.einsum("smxp,kxm->ksmp", sensors.response[:, : harmonic.shape[2]], harmonic, optimize=True)
    of_flow = np.einsum("ksm,km->ks", by_harmonic[..., 0], np.cos(phase))
    of_flow += np.einsum("ksm,km->ks", by_harmonic[..., 1], np.sin(phase))
    net = of_flow - sensors.of_uniform + sensors.per_ambient
    return np.asarray(ambient * net + dynamic * sensors.per_dynamic + sensors.apparent)


FlyingSensors = Callable[[AsBuilt, np.random.Generator | None], BuiltSensors]
"""Returns the auxiliary sensors of a vehicle as built, with errors of theirs drawn, or without any for None."""


@dataclass(frozen=True, eq=False, kw_only=True)
class TrueFlights(Flights):
    """Flights of a body of revolution.

    Attributes
    ----------
    structure : of the vehicle.
    table, uniform : amplitudes of the k flows per p_inf, and of one uniform outer pressure; they lead [1/Pa].
    sensors, harmonic : auxiliary sensors, and (k, n_x, n_m) of p / p_inf that they see; None without any.
    """

    structure: TrueStructure
    table: ResponseTable
    uniform: ResponseTable
    sensors: FlyingSensors | None = None
    harmonic: FloatArray | None = None

    def read(
        self, as_built: AsBuilt, rows: slice = slice(None), random: np.random.Generator | None = None
    ) -> FloatArray:
        """Return (k, n_d + n_s) readings of one vehicle, or (v, n_d) of v vehicles in one flight; ``random`` draws
        errors of its sensors, None has none."""
        flights = replace(
            self,
            table=changed_alike(self.table, lambda table: table[..., rows, :, :, :]),
            conditions=self.conditions[rows],
        )
        ambient, inside = self.ambient_pressure[rows, None], self.internal_pressure[rows, None]
        strain = reading_of(as_built, ambient, inside, *strain_per_pressure(flights, as_built))
        if self.sensors is None or self.harmonic is None:
            return strain
        sensors = self.sensors(as_built, random)
        return np.hstack([strain, sensor_readings(sensors, self.harmonic[rows], flights.conditions)])


def flights_of_flows(
    vehicle: Vehicle,
    structure: TrueStructure,
    flows: FloatArray,
    weights: Sequence[FloatArray],
    conditions: Sequence[FlightCondition],
) -> TrueFlights:
    """Return the flights of ``vehicle`` at ``conditions`` under sums of known flows.

    Strain and loads are linear in the pressure: they are solved for the flows.

    Parameters
    ----------
    flows : (n_f, n_x, n_m) amplitudes of cos(m phi) in p / p_inf, phi from the leeward meridian, at the stations
        of the structure.
    weights : (k, n_f) of the even harmonics of each flow, and of the odd ones.
    """
    parts = tuple(zip(by_parity(flows.shape[-1]), weights, strict=True))

    def summed(of_flows: FloatArray) -> FloatArray:
        """Return (.., k, n_m, n_s, 3) at the conditions of (.., n_f, n_m, n_s, 3)."""
        at_conditions = np.empty((*of_flows.shape[:-4], len(conditions), *of_flows.shape[-3:]))
        for of_parity, weight in parts:
            part = of_flows[..., of_parity, :, :]
            values = weight @ part.reshape(*part.shape[:-3], math.prod(part.shape[-3:]))
            at_conditions[..., of_parity, :, :] = values.reshape(*values.shape[:-1], *part.shape[-3:])
        return at_conditions

    pressures, surface = pressures_at(vehicle.structure, conditions), structure.surface
    # An uneven wall turns the uniform pressure into strain of higher harmonics.
    uniform = np.eye(min(max(WAVES) + 1, structure.n_harmonics))[0]
    everywhere = np.broadcast_to(uniform, (1, len(surface.x), len(uniform)))
    loads, (even, odd) = loads_per_pressure(vehicle, surface, flows), weights
    loads = np.column_stack([even @ loads[:, 0], odd @ loads[:, 1:]])
    axial, across, turning = (pressures["ambient_pressure"][:, None] * loads).T
    of_uniform = loads_per_pressure(vehicle, surface, everywhere)[0, 0]
    axial = axial - pressures["internal_pressure"] * of_uniform
    roll = np.array([condition.leeward_roll_angle for condition in conditions])
    cosine, sine = np.cos(roll), np.sin(roll)
    five = np.column_stack([axial, across * cosine, across * sine, turning * cosine, turning * sine])
    reference = vehicle.reference_quantities()
    return TrueFlights(
        structure=structure,
        counts=structure.counts,
        table=changed_alike(table_under(structure.table, flows), summed),
        uniform=table_under(structure.table, everywhere),
        coefficients=five * coefficient_scales_at(conditions, reference),
        **pressures,
    )


def loads_per_pressure(vehicle: Vehicle, surface: SurfaceGrid, harmonic: FloatArray) -> FloatArray:
    """Return (k, 3) loads of pressures (k, n_x, n_m): the axial force [m2] of harmonic 0, and the cross force [m2]
    and its moment [m3] towards leeward of harmonic 1."""
    station = vehicle.reference_quantities().moment_station
    loads = load_operator(surface, station).reshape(5, len(surface.x), surface.n_roll)
    cosine = np.cos(surface.roll_angle)
    force, moment = loads[1] @ cosine, loads[3] @ cosine
    axial, first = harmonic[:, :, 0], harmonic[:, :, 1]
    return np.column_stack([axial @ loads[0].sum(axis=1), first @ force, first @ moment])


def strain_per_pressure(flights: TrueFlights, as_built: AsBuilt) -> tuple[FloatArray, FloatArray]:
    """Return strain of the gauges (k, n_d) by the flow per p_inf, and (n_d,) by a uniform outer pressure [1/Pa].

    For v vehicles (:func:`builder.truth.flights.drawn`) there must be one flight, and the strain is (v, n_d).
    """
    gauges = flights.structure.parts(as_built, flights.table)
    wind = np.array([condition.leeward_roll_angle for condition in flights.conditions])
    phase = gauges.roll_angle - wind[:, None]
    # Of many vehicles the one flight is left out. Multiples of the phase by rotation: a cosine per harmonic and
    # gauge would cost ten times as much.
    even, odd = (
        amplitudes[:, 0] if amplitudes.ndim > 3 else amplitudes for amplitudes in (gauges.even, gauges.odd)
    )
    turn = np.exp(1j * phase)
    around, of_flow = np.ones_like(turn), np.zeros(phase.shape)
    for m in range(even.shape[-2]):
        of_flow += even[..., m, :] * around.real + odd[..., m, :] * around.imag
        around = around * turn
    return of_flow, flights.structure.parts(as_built, flights.uniform).even[..., 0, 0, :]


def reading_of(
    as_built: AsBuilt, ambient: FloatArray, inside: FloatArray, of_flow: FloatArray, of_unit: FloatArray
) -> FloatArray:
    """Return (k, n_d) readings [m/m] of the strains of :func:`strain_per_pressure`, at p_inf ``ambient`` and the
    stated pressure ``inside`` (k, 1) [Pa]."""
    inside = inside + as_built.internal_pressure * ambient
    return np.asarray(gain_of(as_built) * (ambient * of_flow - inside * of_unit) + as_built.apparent_strain)


def without_faint_harmonics(flights: TrueFlights, faint: float = 2e-4) -> TrueFlights:
    """Return ``flights`` without the highest harmonics, whose strain is below ``faint`` of the largest."""
    size = np.abs(flights.table.nominal).max(axis=(0, 2, 3))
    count = int(np.flatnonzero(size > faint * size.max())[-1]) + 1
    return replace(flights, table=changed_alike(flights.table, lambda table: table[..., :count, :, :]))


def flight_model(
    vehicle: Vehicle,
    table: FlowTable,
    structure: TrueStructure | AsBuiltStructure,
    as_built: AsBuilt,
    noise_std: float,
    sensors: BuiltSensors | None = None,
) -> FlightModel:
    """Return the flight model of a vehicle ``as_built``, for system simulations: tables over (M, a_T).

    Parameters
    ----------
    table : the flows at the knots.
    structure : the independent structural model, with the layout in use, or one whose wall is the vehicle's.
    noise_std : gauge noise sigma [m/m].
    sensors : auxiliary ones.
    """
    mach, incidence, harmonic = table.mach_knots, table.incidence_knots, table.harmonic
    gauges = structure.flight_gauges(as_built, vehicle.resolution.truth.harmonics)
    n = len(gauges.names)
    # Gauges with equal response share a channel; as built, every gauge has its own, as every sensor has.
    flat = np.round(gauges.response.reshape(n, -1) / np.abs(gauges.response).max(), 13)
    _, first, channel = np.unique(flat, axis=0, return_index=True, return_inverse=True)
    channel = channel.astype(np.int64).reshape(-1)
    if sensors is not None:
        k = len(sensors.names)
        channel = np.append(channel, len(first) + np.arange(k))
        first = np.append(first, n + np.arange(k))
        gauges = _with_sensors(gauges, sensors)
    response = gauges.response[first]
    max_harmonic = response.shape[1] - 1
    reference = vehicle.reference_quantities()
    strain = np.einsum("cmxp,ijxm->ijcmp", response, harmonic, optimize=True)
    # An error of the internal pressure is in proportion to p_inf, as the outer pressure is; friction to q_inf.
    dynamic = 0.7 * mach[:, None, None] ** 2 * gauges.per_dynamic[first]
    strain[:, :, :, 0, 0] += gauges.per_ambient[first] + dynamic
    area = reference.area * np.array([1.0, 1.0, reference.length])
    of_load = loads_per_pressure(vehicle, structure.surface, table.flows)
    of_uniform = loads_per_pressure(
        vehicle, structure.surface, np.broadcast_to([1.0, 0.0], (1, harmonic.shape[2], 2))
    )
    coefficient = of_load.reshape(*harmonic.shape[:2], 3) / (0.7 * mach[:, None, None] ** 2 * area)
    inside = vehicle.structure.internal_pressure_Pa
    parity = np.where(np.arange(max_harmonic + 1) % 2, -1.0, 1.0)[None, :, None]
    return FlightModel(
        vehicle=vehicle.name,
        gauge_names=gauges.names,
        gauge_roll_angle=gauges.roll_angle,
        gauge_channel=channel,
        mach_knots=mach,
        incidence_knots=np.array([0.0, *incidence]),
        strain_table=_spline_table(mach, incidence, strain, parity),
        coefficient_table=_spline_table(mach, incidence, coefficient, np.array([1.0, -1.0, -1.0])),
        strain_of_internal_pressure=gauges.response[:, 0, :, 0].sum(axis=1),
        internal_pressure=None if inside == "ambient" else inside,
        base_area=float(of_uniform[0, 0]),
        reference_area=reference.area,
        reference_length=reference.length,
        noise_std=noise_std,
        apparent_strain=gauges.apparent,
        sensors=None if sensors is None else sensors.rows(n, noise_std),
        provenance={**table.provenance, "as_built": gauges.record},
    )


def _with_sensors(gauges: FlightGauges, sensors: BuiltSensors) -> FlightGauges:
    """Return ``gauges`` with the auxiliary sensors behind them."""
    arrays = ("roll_angle", "response", "apparent", "per_ambient", "per_dynamic")
    both: dict[str, Any] = {
        name: np.concatenate([getattr(part, name) for part in (gauges, sensors)]) for name in arrays
    }
    return replace(gauges, names=(*gauges.names, *sensors.names), **both)


def _spline_table(mach: FloatArray, incidence: FloatArray, values: FloatArray, parity: FloatArray) -> FloatArray:
    """Return the polynomial coefficients of a tensor-product cubic spline through flows at the knots, mirrored as
    the knots of :mod:`~builder.truth.flow_table`.

    Parameters
    ----------
    mach, incidence : (n_M,), (n_a,) knots, incidence > 0 [rad].
    values : (n_M, n_a, ...) at the knots.
    parity : +1 or -1, broadcast against ``...``: behaviour under a_T -> -a_T.

    Returns
    -------
    (n_M - 1, n_a, 4, 4, ...): cell, power of (M - M_i), power of (a_T - a_j), with a_0 = 0 added.
    """
    mirrored = np.concatenate([parity * values[:, ::-1], values], axis=1)
    along_incidence = CubicSpline(np.concatenate([-incidence[::-1], incidence]), mirrored, axis=1)
    edge = np.concatenate([[0.0], incidence[:-1]])
    by_incidence = np.stack([along_incidence(edge, q) / factorial(q) for q in range(4)], axis=2)
    along_mach = CubicSpline(mach, by_incidence, axis=0)
    by_mach = np.stack([along_mach(mach[:-1], p) / factorial(p) for p in range(4)], axis=2)
    return by_mach
