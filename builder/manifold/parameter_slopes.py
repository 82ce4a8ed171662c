"""What flow parameters change at every condition of the snapshots, by polynomials of each."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from strainfmu.arrays import FloatArray
from strainfmu.estimator.map.nonlinear_map import Powers

FLOW_PARAMETERS = "flow parameters"
"""Error of tables of the mean over flow parameters: what follows from these once they are known."""

MAX_POWER = 3
"""Highest power of a parameter; less where the snapshots hold fewer values of it."""


@dataclass(frozen=True, eq=False, kw_only=True)
class ConditionSlopes:
    """Least squares over the parameters' values, at every condition.

    Attributes
    ----------
    powers : of the parameters, J in number.
    value : (n_M, n_a, n_b, J, n) of n rows per p_inf and unit of each power.
    rest : (n_M, n_a, n_b, n_k, n) what is left, per p_inf.
    values : (n_k, n_p) of the parameters.
    """

    powers: Powers
    value: FloatArray
    rest: FloatArray
    values: FloatArray

    def unit_error(self) -> FloatArray:
        """Return columns (J, n, k) of one unit of each power, the same states in each."""
        n_j, n = self.value.shape[3:]
        of_grid = self.value.reshape(-1, n_j, n)
        return np.ascontiguousarray(np.moveaxis(of_grid, 0, 2)) / np.sqrt(len(of_grid))

    def spread_error(self) -> list[FloatArray]:
        """Return columns (n, k) of each parameter that is not known, whose squares add up to the mean one."""
        unit, change = self.unit_error(), self.powers.change(self.values) / np.sqrt(len(self.values))
        errors = []
        for parameter in range(len(self.powers.mean)):
            of_parameter = self.powers.parameter == parameter
            columns = np.einsum("kj,jnc->nkc", change[:, of_parameter], unit[of_parameter])
            errors.append(columns.reshape(len(columns), -1))
        return errors

    def rest_error(self) -> FloatArray:
        """Return columns (n, k) of the rest, whose squares add up to the mean one."""
        rows = self.rest.reshape(-1, self.rest.shape[-1])
        return np.asarray(rows.T / np.sqrt(len(rows)))


@dataclass(frozen=True, eq=False, kw_only=True)
class ParameterSlopes:
    """Slopes over the flight state; as in
    :class:`~strainfmu.estimator.map.nonlinear_map.ParameterTables`."""

    powers: Powers
    slope: FloatArray
    unit_error: FloatArray
    spread_error: list[FloatArray]

    def compressed_errors(self) -> tuple[FloatArray, FloatArray]:
        """Return unit errors (J, n, k) and spread errors (n_p, n, k) in as few columns as their rows allow."""
        n_j, n, k = self.unit_error.shape
        unit = compressed(self.unit_error.reshape(n_j * n, k)) if k > n_j * n else self.unit_error
        return unit.reshape(n_j, n, -1), np.stack([compressed(columns) for columns in self.spread_error])


def compressed(columns: FloatArray) -> FloatArray:
    """Return at most as many columns as rows with the same covariance."""
    size = np.linalg.norm(columns, axis=1, keepdims=True)
    size[size == 0.0] = 1.0
    upper = np.asarray(np.linalg.qr((columns / size).T, mode="r"))
    return np.asarray(size * upper.T)


def condition_slopes(off: FloatArray, parameters: Sequence[tuple[float, ...]]) -> ConditionSlopes:
    """Return the slopes of ``off`` (n_M, n_a, n_b, n_k, n), whose mean over the n_k ``parameters`` is 0."""
    values = np.array(parameters)
    mean, spread = values.mean(axis=0), values.std(axis=0)
    highest = [min(len(np.unique(column)) - 1, MAX_POWER) for column in values.T]
    pairs = [(number, power) for number, most in enumerate(highest) for power in range(1, most + 1)]
    parameter, power = np.array(pairs, dtype=np.int64).T
    powers = Powers(mean=mean, spread=spread, parameter=parameter, power=power, offset=np.zeros(len(pairs)))
    powers = Powers(
        mean=mean, spread=spread, parameter=parameter, power=power, offset=powers.change(values).mean(axis=0)
    )
    change = powers.change(values)
    slope = np.linalg.pinv(change) @ off
    return ConditionSlopes(powers=powers, value=slope, rest=off - change @ slope, values=values)
