"""The pressure field of an estimate, and how far it is from the true one.

The field error is |p_estimate - p| / |p| over the pressure nodes of the map, p absolute, in the Euclidean norm:
the error of the reproduction of the source (:mod:`builder.reproduce.case_1`).
"""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from builder.truth.revolution.flow_table import FlowTable, harmonics_at
from builder.vehicle.shape.geometry import SurfaceGrid
from strainfmu.arrays import FloatArray
from strainfmu.estimator.estimate import Estimate
from strainfmu.flight_condition import FlightCondition


def true_field(
    table: FlowTable, of_table: SurfaceGrid, grid: SurfaceGrid, conditions: tuple[FlightCondition, ...]
) -> FloatArray:
    """Return (k, n_x, n_roll) [Pa] the pressure of the independent model at the nodes of ``grid``.

    ``of_table`` holds the stations of ``table``; both grids are on the same body.
    """
    mach = np.array([one.mach_number for one in conditions])
    incidence = np.array([one.total_incidence for one in conditions])
    harmonic = station_weights(of_table.x, grid.x) @ harmonics_at(table, mach, incidence)
    roll = np.array([one.leeward_roll_angle for one in conditions])
    ratio = harmonic @ _cosines(harmonic.shape[2], grid, roll)
    return np.asarray(np.array([one.ambient_pressure for one in conditions])[:, None, None] * ratio)


def station_weights(source: FloatArray, target: FloatArray) -> FloatArray:
    """Return (n_target, n_source) weights of linear interpolation along the body.

    Stations are doubled at slope breaks, where the pressure jumps: each piece is interpolated on its own.
    """
    out = np.zeros((len(target), len(source)))
    for rows, columns in zip(_pieces(target), _pieces(source), strict=True):
        unit = np.eye(columns.stop - columns.start)
        out[rows, columns] = np.stack([np.interp(target[rows], source[columns], one) for one in unit], axis=1)
    return out


def _pieces(x: FloatArray) -> list[slice]:
    ends = [0, *(np.flatnonzero(np.diff(x) <= 0.0) + 1).tolist(), len(x)]
    return [slice(first, last) for first, last in pairwise(ends)]


def _cosines(n_m: int, grid: SurfaceGrid, roll: FloatArray) -> FloatArray:
    """Return (k, n_m, n_roll) of cos m(phi - phi_T) at the nodes."""
    angle = grid.roll_angle - roll[:, None]
    return np.asarray(np.cos(np.arange(n_m)[:, None] * angle[:, None, :]))


def field_errors(estimate: FloatArray, true: FloatArray) -> FloatArray:
    """Return (k,) field errors [1] of ``estimate`` and ``true`` (k, ..) [Pa]."""
    k = len(true)
    difference = (estimate.reshape(k, -1) - true.reshape(k, -1), true.reshape(k, -1))
    off, size = (np.sqrt(np.sum(one * one, axis=1)) for one in difference)
    return np.asarray(off / size)


def estimated_fields(found: Estimate, static_pressure: FloatArray) -> FloatArray:
    """Return (k, n_p) [Pa] the absolute pressure at the nodes of a map by its estimates, NaN where it has none.

    Strain of a vented body says nothing of p_inf: to a field that is p - p_inf, ``static_pressure`` (k,) is added.
    """
    fields = [found[sample].pressure(with_std=False) for sample in range(len(found))]
    ambient = [p_inf if one.is_net else 0.0 for one, p_inf in zip(fields, static_pressure.tolist(), strict=True)]
    return np.stack([one.pressure for one in fields]) + np.array(ambient)[:, None]
