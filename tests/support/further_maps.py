"""Further loads: known combinations of the five loads of a map, and such as are none."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from flight_maps import AREA, LENGTH, table_coefficients

from strainfmu.estimator.further_loads import FurtherLoads
from strainfmu.estimator.map.inverse_map import InverseMap
from strainfmu.estimator.tables.further_tables import FurtherTables

STATION = np.array([0.8])
COMBINATION = np.random.default_rng(8).standard_normal((7, 5))
"""(7, 5) further loads, of the rolling moment and one section, per load."""

STATIONS = np.array([0.8, 1.7, 2.9])
"""Of :func:`with_own_further` and :func:`with_further_tables`."""

M = 1 + 6 * len(STATIONS)


def with_further(inverse_map: InverseMap, combination: np.ndarray = COMBINATION) -> InverseMap:
    """Return ``inverse_map`` with further loads that are ``combination`` (7, 5) times its loads."""
    fixed = inverse_map.fixed_load
    further = FurtherLoads(
        section_station=STATION,
        load_per_state=combination @ inverse_map.load_per_state,
        load_of_mean=combination @ inverse_map.load_of_mean,
        error_load=combination @ inverse_map.error_load,
        fixed_load=combination @ fixed if fixed.any() else None,
    )
    return replace(inverse_map, further=further)


def with_own_further(held: InverseMap) -> InverseMap:
    """Loads that are no combination of the five."""
    random, errors, loads = np.random.default_rng(8), held.error_strain, held.error_load
    size = float(np.abs(held.load_of_mean).max())
    states = float(np.abs(held.load_per_state).max())
    per_state = states * random.standard_normal((M, held.n_states))
    of_mean = size * random.standard_normal(M)
    random.uniform(size=M)  # not used: the golden streams are of the numbers that follow
    further = FurtherLoads(
        section_station=STATIONS,
        load_per_state=per_state,
        load_of_mean=of_mean,
        error_load=float(np.abs(loads).max()) * random.standard_normal((M, errors.shape[1])),
        fixed_load=0.01 * size * random.standard_normal(M),
    )
    return replace(held, further=further)


def with_further_tables(held: InverseMap) -> InverseMap:
    """Return ``held``, of :func:`flight_fmu.whole_map`, with :func:`with_own_further` and tables of other loads.

    The rolling moment is that of a body of revolution; the torsion follows cosines and sines of every harmonic.
    """
    random, manifold = np.random.default_rng(9), held.manifold
    assert manifold is not None
    factors = np.zeros((M, 3, 2))
    rows = 1 + np.arange(6 * len(STATIONS)).reshape(6, -1)
    sizes = (
        AREA * np.array([1.0, 1.0, 1.0, LENGTH, LENGTH, LENGTH])[:, None] * random.uniform(0.5, 2.0, rows.shape)
    )
    factors[rows[0], 0, 0], factors[rows[5]] = sizes[0], sizes[5, :, None, None] * random.normal(size=(3, 3, 2))
    for load, phase in ((1, 0), (2, 1), (3, 0), (4, 1)):
        factors[rows[load], 1, phase] = sizes[load]
    errors = 1e-2 * factors.reshape(M, -1) @ random.normal(size=(6, manifold.error_strain.shape[1]))
    further = FurtherTables(
        response=table_coefficients(factors),
        fixed_response=1.0 + np.arange(M),
        strain_covariance=errors @ manifold.error_strain.T,
        variance=np.sum(errors**2, axis=1),
    )
    return replace(with_own_further(held), manifold=replace(manifold, further=further))


def check_further(ours: np.ndarray, theirs: np.ndarray, tolerance: float = 1e-12) -> None:
    """Assert that outputs of further loads at :data:`STATIONS` agree, relative to the largest of their kind.

    A small one is a difference of large terms.
    """
    k = len(STATIONS)
    forces, moments = 4 + np.arange(3 * k), 4 + np.arange(3 * k, 6 * k)
    for group in (forces, np.append(moments, 2), forces + 6 * k, np.append(moments + 6 * k, 3)):
        if np.isfinite(theirs[group]).all():
            scale = np.abs(theirs[group]).max()
            np.testing.assert_allclose(ours[group], theirs[group], rtol=0.0, atol=tolerance * scale)
        else:
            assert np.array_equal(ours[group], theirs[group], equal_nan=True)
    if np.isfinite(theirs[:4]).all() and theirs[2] != 0.0:
        largest = np.abs(theirs[[0, 1]]) * np.abs(theirs[np.append(moments, 2)]).max() / abs(theirs[2])
        assert np.all(np.abs(ours[:2] - theirs[:2]) <= tolerance * largest)
