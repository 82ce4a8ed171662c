"""Flight model: the independent model of the vehicle in system simulations, as tables over (M, a_T).

Every table is a tensor-product cubic spline through flows solved at the knots. In total incidence the knots
are mirrored to negative values, where the flow is the same rolled by half a turn: harmonic m of the pressure
changes by (-1)^m. So the spline has the correct symmetry at a_T = 0 without a knot there.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import factorial
from typing import Any

import numpy as np
from scipy.interpolate import CubicSpline

from builder.structure.as_built.as_built_structure import AsBuiltStructure
from builder.structure.as_built.as_built_vehicle import AsBuilt
from builder.structure.as_built.gauge_strain_terms import gain_of
from builder.structure.as_built_kinds import AS_BUILT, IN_NOISE
from builder.truth.revolution.flow_table import FlowTable
from builder.truth.revolution.strain import BuiltSensors, TrueStructure, loads_per_pressure
from builder.vehicle.file import Vehicle
from builder.vehicle.shape.geometry import SurfaceGrid
from strainfmu.arrays import FloatArray
from strainfmu.cosim.models.flight_model import FlightModel


@dataclass(frozen=True, eq=False, kw_only=True)
class PlantGauges:
    """The gauges of the vehicle that flies.

    Attributes
    ----------
    names : n_d names.
    roll_angle : (n_d,) [rad].
    response : (n_d, n_m, n_x, 2) reading per harmonic m of the pressure at a station, as cos and sin of m times
        the roll angle from the pressure's crest to the gauge [1/Pa].
    internal_pressure : error of the internal pressure over p_inf [1].
    apparent_strain : (n_d,) reading without strain [m/m].
    record : of the errors, for the provenance.
    sensors : auxiliary sensors; None of a vehicle without.
    """

    names: tuple[str, ...]
    roll_angle: FloatArray
    response: FloatArray
    internal_pressure: float
    apparent_strain: FloatArray
    record: dict[str, Any]
    sensors: BuiltSensors | None = None


def plant_gauges(structure: AsBuiltStructure, parameters: AsBuilt, n_harmonics: int) -> PlantGauges:
    """Return the gauges of a vehicle as built, harmonics of the pressure 0 to ``n_harmonics``.

    Strain per cos(m phi) and sin(m phi) is taken to a crest of the pressure at the gauge's own roll angle. That
    holds for an uneven wall as well, whose strain goes round the body otherwise than the pressure does.
    """
    grid, n_d = structure.surface, structure.n_gauges
    operator = structure.strain_operator(parameters).reshape(n_d, len(grid.x), grid.n_roll)
    m = np.arange(n_harmonics + 1)
    angle = np.outer(grid.roll_angle, m)
    cosine, sine = (np.moveaxis(operator @ wave(angle), 1, 2) for wave in (np.cos, np.sin))
    roll = structure.placed.roll_angle
    c, s = (wave(np.outer(roll, m))[:, :, None] for wave in (np.cos, np.sin))
    response: FloatArray = np.stack([cosine * c + sine * s, cosine * s - sine * c], axis=-1)
    return PlantGauges(
        names=structure.gauges.names,
        roll_angle=roll,
        response=response,
        internal_pressure=0.0,
        apparent_strain=parameters.zero,
        record={kind.name: getattr(parameters, kind.name).tolist() for kind in AS_BUILT},
    )


def flight_model(
    vehicle: Vehicle,
    table: FlowTable,
    structure: TrueStructure,
    built: AsBuilt,
    noise_std: float,
    sensors: BuiltSensors | None = None,
) -> FlightModel:
    """Assemble the flight model of a vehicle as ``built``, with its auxiliary ``sensors``.

    Parameters
    ----------
    table : the flows at the knots.
    structure : the independent structural model, with the layout in use.
    noise_std : gauge noise sigma [m/m].
    """
    gauges = structure.parts(built)
    response = np.stack([gauges.even, gauges.odd], axis=-1).transpose(2, 1, 0, 3)  # n_d, n_m, n_x, 2
    plant = PlantGauges(
        names=structure.names,
        roll_angle=gauges.roll_angle,
        response=response * gain_of(built)[:, None, None, None],
        internal_pressure=built.internal_pressure.item(),
        apparent_strain=np.broadcast_to(built.apparent_strain, len(structure.names)),
        record=built.record(IN_NOISE),
        sensors=sensors,
    )
    return plant_flight_model(vehicle, table, structure.surface, plant, noise_std)


def plant_flight_model(
    vehicle: Vehicle, table: FlowTable, surface: SurfaceGrid, gauges: PlantGauges, noise_std: float
) -> FlightModel:
    """Assemble the flight model of a vehicle whose gauges are known; ``surface`` holds the stations of both."""
    mach, incidence = table.mach_knots, table.incidence_knots
    # Gauges with equal response share a channel; as built, every gauge has its own, as every sensor has.
    response, sensors, n = gauges.response, gauges.sensors, len(gauges.names)
    flat = np.round(response.reshape(n, -1) / np.abs(response).max(), 13)
    _, first, channel = np.unique(flat, axis=0, return_index=True, return_inverse=True)
    channel = channel.astype(np.int64).reshape(-1)
    names, roll_angle, apparent = gauges.names, gauges.roll_angle, gauges.apparent_strain
    per_ambient = -gauges.internal_pressure * response[:, 0, :, 0].sum(axis=1)
    per_dynamic = np.zeros(n)
    if sensors is not None:
        k = len(sensors.names)
        channel = np.append(channel, len(first) + np.arange(k))
        first = np.append(first, n + np.arange(k))
        response = np.concatenate([response, sensors.response])
        names, roll_angle = (*names, *sensors.names), np.append(roll_angle, np.zeros(k))
        apparent = np.append(apparent, sensors.offset)
        per_ambient = np.append(per_ambient, sensors.per_ambient)
        per_dynamic = np.append(per_dynamic, sensors.per_dynamic)
    unit = response[:, 0, :, 0].sum(axis=1)
    response = response[first]
    max_harmonic = response.shape[1] - 1
    reference = vehicle.reference_quantities()
    harmonic = table.harmonic
    strain = np.einsum("cmxp,ijxm->ijcmp", response, harmonic, optimize=True)
    # An error of the internal pressure is in proportion to p_inf, as the outer pressure is; friction to q_inf.
    strain[:, :, :, 0, 0] += per_ambient[first] + 0.7 * mach[:, None, None] ** 2 * per_dynamic[first]
    area = reference.area * np.array([1.0, 1.0, reference.length])
    of_load = loads_per_pressure(vehicle, surface, harmonic.reshape(-1, *harmonic.shape[2:]))
    of_uniform = loads_per_pressure(vehicle, surface, np.broadcast_to([1.0, 0.0], (1, len(surface.x), 2)))
    coefficient = of_load.reshape(*harmonic.shape[:2], 3) / (0.7 * mach[:, None, None] ** 2 * area)
    inside = vehicle.structure.internal_pressure_Pa
    parity = np.where(np.arange(max_harmonic + 1) % 2, -1.0, 1.0)[None, :, None]
    return FlightModel(
        vehicle=vehicle.name,
        gauge_names=names,
        gauge_roll_angle=roll_angle,
        gauge_channel=channel,
        mach_knots=mach,
        incidence_knots=np.array([0.0, *incidence]),
        strain_table=_spline_table(mach, incidence, strain, parity),
        coefficient_table=_spline_table(mach, incidence, coefficient, np.array([1.0, -1.0, -1.0])),
        strain_of_internal_pressure=unit,
        internal_pressure=None if inside == "ambient" else inside,
        base_area=float(of_uniform[0, 0]),
        reference_area=reference.area,
        reference_length=reference.length,
        noise_std=noise_std,
        apparent_strain=apparent,
        sensors=None if sensors is None else sensors.rows(n, noise_std),
        provenance={**table.provenance, "as_built": gauges.record},
    )


def _spline_table(mach: FloatArray, incidence: FloatArray, values: FloatArray, parity: FloatArray) -> FloatArray:
    """Return the polynomial coefficients of a tensor-product spline.

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
    left = np.concatenate([[0.0], incidence[:-1]])
    by_incidence = np.stack([along_incidence(left, q) / factorial(q) for q in range(4)], axis=2)
    along_mach = CubicSpline(mach, by_incidence, axis=0)
    by_mach = np.stack([along_mach(mach[:-1], p) / factorial(p) for p in range(4)], axis=2)
    return by_mach
