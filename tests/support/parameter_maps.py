"""Maps whose snapshots have flow parameters."""

from dataclasses import replace

import numpy as np

from strainfmu.estimator.map.inverse_map import InverseMap
from strainfmu.estimator.map.nonlinear_map import ParameterTables, Powers

PARAMETERS = {"fin_deg": [-4.0, 4.0], "power": [0.0, 0.5], "cant_deg": [2.0, 2.0]}


def with_parameters(inverse_map: InverseMap) -> InverseMap:
    """Return ``inverse_map`` with the ranges :data:`PARAMETERS`, of which the last is of one value."""
    return replace(inverse_map, provenance={**inverse_map.provenance, "parameters": PARAMETERS})


def with_parameter_tables(inverse_map: InverseMap, size: float = 0.02) -> InverseMap:
    """Return :func:`with_parameters` with random tables of what the powers of each change, ``size`` of the mean's.

    Cubes of the first parameter, squares of the second, nothing of the last.
    """
    random, with_known = np.random.default_rng(12), with_parameters(inverse_map)
    manifold = with_known.manifold
    assert manifold is not None
    response = manifold.response
    error = np.vstack([manifold.error_strain, manifold.error_load[:5]])
    if manifold.n_loads > 5:
        std = np.sqrt(np.sum(manifold.error_load[5:] ** 2, axis=1))
        error = np.vstack([error, random.normal(size=(len(response[0, 0]) - len(error), error.shape[1]))])
        error[len(manifold.error_strain) + 5 :] *= std[:, None] / error.shape[1]
    powers = Powers(
        mean=np.array([0.2, 0.25, 2.0]),
        spread=np.array([2.8, 0.2, 0.0]),
        parameter=np.array([0, 0, 0, 1, 1]),
        power=np.array([1, 2, 3, 1, 2]),
        offset=np.array([0.0, 1.0, 0.1, 0.0, 1.0]),
    )
    factors = size * random.normal(size=(len(powers.power), response.shape[2], *response.shape[3:]))
    rows = 0.1 * size * np.abs(response).max(axis=(0, 1, 3, 4))
    tables = ParameterTables(
        powers=powers,
        slope=response[:, :, None] * factors,
        unit_error=rows[:, None] * random.normal(size=(len(powers.power), len(rows), 7)),
        spread_error=rows[:, None] * random.normal(size=(len(powers.mean), len(rows), 9)),
        error=error,
    )
    return replace(with_known, manifold=replace(manifold, parameters=tables))


def with_errors_of_parameters(inverse_map: InverseMap) -> InverseMap:
    """Return a map of :func:`with_parameter_tables` whose errors, where no parameter is known, are those that its
    tables of parameters have then."""
    manifold = inverse_map.manifold
    assert manifold is not None
    tables = manifold.parameters
    assert tables is not None
    error = np.hstack([tables.error, *tables.spread_error])
    n_d = inverse_map.n_gauges
    changed = {"error_strain": error[:n_d], "error_load": error[n_d:]}
    return replace(inverse_map, manifold=replace(manifold, **changed))
