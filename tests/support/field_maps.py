"""A small map with a pressure field: four stations of a cylinder, eight roll angles, tables of a closed form."""

from dataclasses import replace

import numpy as np
from flight_maps import INCIDENCE, MACH, ROWS, STATIONS, amplitudes, flight_map
from scaled_maps import scaled_map

from builder.manifold.tables import spline_coefficients
from strainfmu.arrays import FloatArray
from strainfmu.estimator.map.inverse_map import InverseMap
from strainfmu.estimator.map.nonlinear_map import FlightField

N_ROLL = 8
ROLL = 2.0 * np.pi * np.arange(N_ROLL) / N_ROLL
X = np.array([0.0, 1.0, 2.0, 3.0])
N_D = STATIONS * ROWS


def exact_pressure(mach: float, u: float, w: float, pressure: float) -> FloatArray:
    """Return (n_p,) of the vehicle itself [Pa]."""
    around = np.cos(np.outer(np.arange(3), ROLL - np.arctan2(w, u)))
    ring = 2.0 + amplitudes(mach, float(np.hypot(u, w))) @ around
    return np.asarray(pressure * np.outer(1.0 + 0.1 * X, ring).ravel())


def field_map(linear: bool = False) -> InverseMap:
    """Return a map that holds the field; ``linear`` one without tables."""
    along, mean = 1.0 + 0.1 * X[:, None, None], 2.0 * np.eye(3)[0]
    values = np.array([[along * (mean + amplitudes(m, a))[:, None] for a in INCIDENCE] for m in MACH])
    zero = np.array([along * (mean + amplitudes(m, 0.0))[:, None] for m in MACH])
    _, coefficients = spline_coefficients(MACH, INCIDENCE, values, np.arange(len(INCIDENCE)), zero)
    field = FlightField(
        station=X,
        radius=np.ones(4),
        roll_angle=ROLL,
        amplitude=coefficients[..., 0].astype(np.float32),
        strain_covariance=np.zeros((4, 3, 2, N_D), dtype=np.float32),
        error_std=np.full(4, 1e-3),
        table_error_std=np.full((4, N_ROLL), 1e-3, dtype=np.float32),
    )
    inverse_map = scaled_map(2, 1, N_D)
    n_p, random = 4 * N_ROLL, np.random.default_rng(2)
    node = np.arange(n_p).reshape(4, N_ROLL)
    fore, aft = node[:-1], node[1:]
    corners = [fore, aft, np.roll(fore, -1, axis=1)], [aft, np.roll(aft, -1, axis=1), np.roll(fore, -1, axis=1)]
    point = np.stack([np.repeat(X, N_ROLL), np.tile(np.sin(ROLL), 4), np.tile(np.cos(ROLL), 4)], axis=1)
    return replace(
        inverse_map,
        manifold=None if linear else replace(flight_map(discrepancy=1e-3), pressure_field=field),
        field_mean=random.normal(1e4, 1e3, size=n_p).astype(np.float32),
        field_modes=random.normal(size=(n_p, inverse_map.n_states)).astype(np.float32),
        field_std=np.full(n_p, 10.0, dtype=np.float32),
        field_is_net=True,
        point=point.astype(np.float32),
        triangle=np.concatenate([np.stack(three, axis=2).reshape(-1, 3) for three in corners]).astype(np.int32),
    )
