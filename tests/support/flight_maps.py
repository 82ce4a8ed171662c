"""A small vehicle with a flow in closed form: tables over the flight state whose truth is known."""

from dataclasses import replace

import numpy as np
from scaled_maps import scaled_map

from builder.manifold.discrepancy import tested_shapes
from builder.manifold.tables import spline_coefficients
from strainfmu.arrays import FloatArray
from strainfmu.estimator.map.inverse_map import InverseMap
from strainfmu.estimator.map.nonlinear_map import ManifoldMap

STATIONS, ROWS = 4, 12
N_D = STATIONS * ROWS
NOISE_STD = 2e-7
MACH = np.array([5.0, 5.5, 6.0, 6.5, 7.0])
INCIDENCE = np.radians([2.0, 4.0, 6.0, 8.0, 10.0])
AREA, LENGTH = 0.12, 0.4


def amplitudes(mach: float, incidence: float) -> FloatArray:
    """Return (3,) of cos m(phi - phi_T) in a response per p_inf: smooth in M and even or odd in the incidence."""
    dynamic = 0.7 * mach**2
    return np.array(
        [
            dynamic * (0.02 + 0.3 * incidence**2) - 0.1,
            dynamic * np.sin(incidence) * (1.0 + 0.3 / mach),
            dynamic * incidence**2 * (1.0 - 0.05 * mach),
        ]
    )


def gauge_roll_angles() -> FloatArray:
    """Return (n_d,) roll angles [rad]: ROWS even ones at each station."""
    return np.tile(2.0 * np.pi * np.arange(ROWS) / ROWS, STATIONS)


def channel_factors() -> FloatArray:
    """Return (n_d + 5, 3, 2) factors of cos m phi_T and sin m phi_T per harmonic; strains, then loads."""
    phi, station = gauge_roll_angles(), np.repeat(np.arange(STATIONS), ROWS)
    m = np.arange(3)
    size = 1e-10 * np.array([2.0, 3.0, 1.5]) * (1.0 + np.outer(station, [0.1, 0.4, -0.15]))
    gauges = np.stack([size * np.cos(np.outer(phi, m)), size * np.sin(np.outer(phi, m))], axis=-1)
    loads = np.zeros((5, 3, 2))
    loads[0, 0, 0], loads[1, 1, 0], loads[2, 1, 1] = AREA, 2.0 * AREA, 2.0 * AREA
    loads[3, 1, 0], loads[4, 1, 1] = -3.0 * AREA * LENGTH, -3.0 * AREA * LENGTH
    return np.concatenate([gauges, loads])


def exact_response(mach: float, u: float, w: float, pressure: float) -> FloatArray:
    """Return (n_d + 5,) strains [m/m] and loads [N, N m] of the vehicle itself."""
    incidence, phi = np.hypot(u, w), np.arctan2(w, u)
    m = np.arange(3)
    wind = np.stack([np.cos(m * phi), np.sin(m * phi)], axis=-1)
    return pressure * np.einsum("nms,m,ms->n", channel_factors(), amplitudes(mach, incidence), wind)


def table_coefficients(factors: FloatArray) -> FloatArray:
    """Return the spline coefficients (n_M + 2, n_a + 2, n, 3, 2) of responses with ``factors`` (n, 3, 2)."""
    return _knots_and_coefficients(factors)[1]


def _knots_and_coefficients(factors: FloatArray) -> tuple[FloatArray, FloatArray]:
    values = np.array([[amplitudes(m, a) for a in INCIDENCE] for m in MACH])
    zero = np.array([amplitudes(m, 0.0) for m in MACH])[:, None, :, None] * factors
    table = values[:, :, None, :, None] * factors
    return spline_coefficients(MACH, INCIDENCE, table, np.arange(len(INCIDENCE)), zero)


def flight_map(discrepancy: float = 0.0, hardware: bool = False) -> ManifoldMap:
    """Return its tables; ``discrepancy`` is a roll-symmetric error of strain and load per p_inf."""
    factors = channel_factors()
    knots, response = _knots_and_coefficients(factors)
    n_d = len(factors) - 5
    columns = discrepancy * np.concatenate([factors[:, m, s : s + 1] for m in range(3) for s in (0, 1)], axis=1)
    manifold = ManifoldMap(
        mach_knots=MACH,
        incidence_knots=knots,
        response=response,
        fixed_response=np.zeros(n_d + 5),
        gauge_covariance=NOISE_STD**2 * np.eye(n_d),
        error_strain=columns[:n_d],
        error_load=columns[n_d:],
        gauge_gain_std=0.01 if hardware else 0.0,
        common_gain_std=0.01 if hardware else 0.0,
        gauge_error_product=np.zeros((21, n_d)),
        common_error=np.zeros((0, 6, n_d)),
        reference_area=AREA,
        reference_length=LENGTH,
        mach_range=MACH[[0, -1]],
        pressure_range=np.array([300.0, 1e5]),
        incidence_limit=float(INCIDENCE[-1]),
        mach_number_error=0.05,
        static_pressure_error=0.02,
        dynamic_pressure_error=0.01,
    )
    return replace(manifold, discrepancy_shapes=tested_shapes(manifold))


def whole_map() -> InverseMap:
    """A map for both estimators, with errors of every kind about its tables."""
    random = np.random.default_rng(2)
    manifold = flight_map(discrepancy=1e-2, hardware=True)
    scale = float(np.median(np.abs(manifold.response[:, :, :N_D])))
    manifold = replace(
        manifold,
        gauge_error_product=1e-6 * scale**2 * random.random((21, N_D)),
        common_error=1e-3 * scale * random.standard_normal((2, 6, N_D)),
        discrepancy_shapes=1e-6 * random.standard_normal((N_D, 3)),
        shape_scale=0.8,
        gauge_covariance=manifold.gauge_covariance + 1e-14 * np.ones((N_D, N_D)),
    )
    return replace(scaled_map(2, 1, N_D), manifold=manifold)


def with_considered_error(inverse_map: InverseMap) -> InverseMap:
    """``inverse_map`` with a considered error: every row's table times a factor of its own."""
    manifold = inverse_map.manifold
    assert manifold is not None
    factor = 0.03 * np.random.default_rng(5).standard_normal(manifold.response.shape[2])
    error = manifold.response * factor[:, None, None]
    return replace(inverse_map, manifold=replace(manifold, considered_response=error))


def with_considered_columns(inverse_map: InverseMap) -> InverseMap:
    """``inverse_map`` with considered errors that do not follow the state: two of strain and loads, much as these
    change with the incidence, and one that all gauges have in common."""
    manifold = inverse_map.manifold
    assert manifold is not None
    random, pressure, n_f = np.random.default_rng(6), 5e3, manifold.n_loads
    responses = [
        exact_response(6.0, *crossflow, pressure) for crossflow in ((0.07, 0.03), (0.075, 0.03), (0.07, 0.035))
    ]
    change = np.stack([responses[1] - responses[0], responses[2] - responses[0]], axis=1) / pressure
    change *= 1.0 + 0.1 * random.standard_normal(change.shape)
    load = 1e-3 * random.standard_normal((n_f, 2))
    load[:5] = change[manifold.n_gauges :]
    common = 0.02 * np.median(np.abs(change)) * random.standard_normal((1, 6, manifold.n_gauges))
    columns = {"considered_strain": change[: manifold.n_gauges], "considered_load": load}
    return replace(inverse_map, manifold=replace(manifold, **columns, considered_common=common))
