"""Snapshots of any shape as a grid of Mach number, angle of attack, sideslip and flow parameters."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product

import numpy as np

from builder.campaign.snapshots import Snapshots
from strainfmu.arrays import FloatArray, IntArray
from strainfmu.errors import InputError

MIN_VALUES = (2, 3, 3)
"""Least number of Mach numbers, angles of attack and sideslip angles of a spline."""

_DIGITS = 9


@dataclass(frozen=True, eq=False, kw_only=True)
class SnapshotGrid:
    """Snapshots at every combination of their conditions, one altitude of each.

    Attributes
    ----------
    mach, angle_of_attack, sideslip : (n_M,), (n_a,), (n_b,) increasing [1, rad, rad].
    row : (n_M, n_a, n_b, n_k) of the snapshots, n_k combinations of the flow parameters, 1 without.
    """

    mach: FloatArray
    angle_of_attack: FloatArray
    sideslip: FloatArray
    row: IntArray


def snapshot_grid(snapshots: Snapshots) -> SnapshotGrid:
    """Return the grid of ``snapshots``.

    Raises
    ------
    InputError
        There are too few values of a condition for a spline, or a combination is missing.
    """
    conditions = snapshots.conditions()
    keys = [
        (
            *np.round(
                (condition.mach_number, condition.angle_of_attack, condition.sideslip_angle), _DIGITS
            ).tolist(),
            condition.parameters,
        )
        for condition in conditions
    ]
    first: dict[tuple[object, ...], int] = {}
    for number, key in enumerate(keys):
        first.setdefault(key, number)
    values = [sorted({key[axis] for key in keys}) for axis in range(3)]
    parameters = sorted({key[3] for key in keys})
    _check_numbers([len(axis) for axis in values])
    row = np.empty([*(len(axis) for axis in values), len(parameters)], dtype=np.int64)
    for place, key in zip(np.ndindex(row.shape), product(*values, parameters), strict=True):
        if key not in first:
            mach, alpha, beta = key[:3]
            raise InputError(
                f"map.estimator: 'nonlinear' needs every combination of the conditions, got none of Mach number "
                f"{mach:g}, angle of attack {np.degrees(alpha):.4g} deg, sideslip {np.degrees(beta):.4g} deg"
                + (f", parameters {', '.join(f'{value:g}' for value in key[3])}" if key[3] else "")
            )
        row[place] = first[key]
    mach, alpha, beta = map(np.array, values)
    return SnapshotGrid(mach=mach, angle_of_attack=alpha, sideslip=beta, row=row)


def _check_numbers(counts: list[int]) -> None:
    if any(count < least for count, least in zip(counts, MIN_VALUES, strict=True)):
        needed, got = (
            "{} Mach numbers, {} angles of attack and {} sideslip angles".format(*numbers)
            for numbers in (MIN_VALUES, counts)
        )
        raise InputError(
            f"map.estimator: 'nonlinear' needs {needed} at least, got {got}; estimator 'linear' takes them"
        )
