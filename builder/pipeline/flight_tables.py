"""Flight model: the independent model of the vehicle in system simulations, as tables over (M, a_T).

Every table is a tensor-product cubic spline through flows solved at the knots. In total incidence the knots
are mirrored to negative values, where the flow is the same rolled by half a turn: harmonic m of the pressure
changes by (-1)^m. So the spline has the correct symmetry at a_T = 0 without a knot there.
"""

from __future__ import annotations

from collections.abc import Mapping
from math import factorial, radians

import numpy as np
from scipy.interpolate import CubicSpline

from builder.aero.engine import Flow, FlowKey
from builder.aero.euler.marching_grid import marching_grid_of
from builder.aero.euler_engine import EulerEngine, pieces
from builder.aero.loads import load_operator
from builder.aero.surface_pressure import pressure_at_stations, pressure_ratio_on_surface
from builder.structure.fourier.model import StructuralModel
from builder.vehicle.file import Vehicle
from builder.vehicle.geometry import SurfaceGrid, surface_grid
from strainfmu.arrays import FloatArray
from strainfmu.cosim.flight_model import FlightModel


def truth_knots(vehicle: Vehicle) -> tuple[FloatArray, FloatArray]:
    """Return the knots of the flight model: Mach numbers (n_M,) and total incidences (n_a,) [rad] from 0."""
    incidence = sorted(round(radians(angle), 9) for angle in vehicle.truth.total_incidence_deg)
    return np.array(sorted(vehicle.truth.mach_number)), np.array([0.0, *incidence])


def truth_keys(vehicle: Vehicle) -> list[FlowKey]:
    """Return the (M, a_T [rad]) at which the independent model's flows are solved."""
    mach, incidence = truth_knots(vehicle)
    return [(round(m, 9), a) for m in mach.tolist() for a in incidence[1:].tolist()]


def truth_engine(vehicle: Vehicle) -> EulerEngine:
    """Return the flow solver of the flight model: Euler, whatever engine the map is built on."""
    settings = vehicle.resolution.truth
    body = vehicle.body()
    surface = surface_grid(body, settings.surface_stations, settings.surface_roll_angles)
    return EulerEngine(body, marching_grid_of(settings), surface)


def pressure_harmonics(flow: Flow, surface: SurfaceGrid, max_harmonic: int) -> FloatArray:
    """Return the amplitudes (n_x, max_harmonic + 1) of cos(m phi) in p/p_inf, phi from the leeward meridian.

    The discrete cosine transform over the solver's cells; harmonics that they cannot resolve are zero.
    """
    ratio = pressure_at_stations(pieces(flow), surface)
    n_phi = ratio.shape[1]
    m = np.arange(max_harmonic + 1)
    weight = np.where(m == 0, 1.0, 2.0) * (m < n_phi)
    return ratio @ np.cos(np.outer(flow.arrays["roll_angle"], m)) * weight / n_phi


def flight_model(
    vehicle: Vehicle,
    flows: Mapping[FlowKey, Flow],
    structure: StructuralModel,
    noise_std: float,
) -> FlightModel:
    """Assemble the flight model from solved flows and the structure's response.

    Parameters
    ----------
    flows : one solution per key of :func:`truth_keys`.
    structure : the independent structural model, with the vehicle's layout in use.
    noise_std : gauge noise sigma [m/m].
    """
    mach, knots = truth_knots(vehicle)
    incidence = knots[1:]
    layout = vehicle.gauges.layout
    placed = structure.placed[layout]
    station = np.abs(placed.x[:, None] - structure.response.gauge_x).argmin(axis=1)
    kinds = np.column_stack([station, np.round(placed.meridional, 12), np.round(placed.circumferential, 12)])
    channels, channel = np.unique(kinds, axis=0, return_inverse=True)
    response = _channel_response(structure, channels)
    max_harmonic = response.shape[1] - 1
    reference = vehicle.reference_quantities()
    loads = load_operator(structure.surface, reference.moment_station)

    strain = np.empty((len(mach), len(incidence), len(channels), max_harmonic + 1, 2))
    coefficient = np.empty((len(mach), len(incidence), 3))
    area = reference.area * np.array([1.0, 1.0, reference.length])
    for i, mach_number in enumerate(mach):
        for j, angle in enumerate(incidence):
            flow = flows[round(float(mach_number), 9), float(angle)]
            harmonics = pressure_harmonics(flow, structure.surface, max_harmonic)
            strain[i, j] = np.einsum("cmxp,xm->cmp", response, harmonics)
            at_stations = pressure_at_stations(pieces(flow), structure.surface)
            ratio = pressure_ratio_on_surface(at_stations, flow.arrays["roll_angle"], structure.surface, 0.0)
            axial, normal, _, pitch, _ = loads @ ratio
            coefficient[i, j] = np.array([axial, normal, pitch]) / (0.7 * mach_number**2 * area)
    inside = vehicle.structure.internal_pressure_Pa
    parity = np.where(np.arange(max_harmonic + 1) % 2, -1.0, 1.0)[None, :, None]
    return FlightModel(
        vehicle=vehicle.name,
        gauge_names=structure.layouts[layout].names,
        gauge_roll_angle=placed.roll_angle,
        gauge_channel=channel.astype(np.int64).reshape(-1),
        mach_knots=mach,
        incidence_knots=knots,
        strain_table=_spline_table(mach, incidence, strain, parity),
        coefficient_table=_spline_table(mach, incidence, coefficient, np.array([1.0, -1.0, -1.0])),
        strain_of_internal_pressure=structure.strain_operator(layout).sum(axis=1),
        internal_pressure=None if inside == "ambient" else inside,
        base_area=float(loads[0].sum()),
        reference_area=reference.area,
        reference_length=reference.length,
        noise_std=noise_std,
        provenance={
            "resolution": vehicle.resolution.truth.model_dump(),
            "flows": len(flows),
        },
    )


def _channel_response(structure: StructuralModel, channels: FloatArray) -> FloatArray:
    """Return [even, odd] strain (n_channels, max_harmonic + 1, n_x, 2) [1/Pa] of each (station, direction).

    Even parts go as cos m(phi_g - phi_T), odd ones, the shear's, as sin m(phi_g - phi_T).
    """
    station = channels[:, 0].astype(int)
    c, s = channels[:, 1, None, None], channels[:, 2, None, None]
    response = structure.response
    even = c**2 * response.meridional[station] + s**2 * response.hoop[station]
    odd = 2.0 * c * s * response.shear[station]
    return np.stack([even, odd], axis=-1)


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
