"""Other loads: known combinations of the five loads of a map, and such as are none."""

from collections.abc import Sequence
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
from flight_maps import AREA, LENGTH, table_coefficients

from strainfmu.estimator.map.inverse_map import InverseMap
from strainfmu.estimator.map.nonlinear_map import ManifoldMap
from strainfmu.estimator.other_loads import LoadGroup, load_groups

STATION = np.array([0.8])
COMBINATION = np.random.default_rng(8).standard_normal((7, 5))
"""(7, 5) other loads, of the rolling moment and one section, per load."""

STATIONS = np.array([0.8, 1.7, 2.9])
"""Of :func:`with_own_further` and :func:`with_further_tables`."""

M = 1 + 6 * len(STATIONS)


def groups_at(stations: Sequence[float]) -> tuple[LoadGroup, ...]:
    """Return the groups of a map with sections at ``stations`` [m]: the rolling moment, and six loads of them."""
    places = SimpleNamespace(section_station=np.array(stations, dtype=float), hinge_lines=None, bending_lines=None)
    return load_groups(places)


def with_further(inverse_map: InverseMap, combination: np.ndarray = COMBINATION) -> InverseMap:
    """Return ``inverse_map``, and its tables, with other loads that are ``combination`` (7, 5) times its loads."""

    def with_more(rows: np.ndarray) -> np.ndarray:
        return combination @ rows

    manifold = inverse_map.manifold
    if manifold is not None:
        n = manifold.n_gauges
        manifold = _with_tables(
            manifold,
            np.einsum("fl,ijlms->ijfms", combination, manifold.response[:, :, n:]),
            with_more(manifold.fixed_response[n:]),
            with_more(manifold.error_load),
        )
    return _with_loads(
        inverse_map,
        STATION,
        manifold,
        load_per_state=with_more(inverse_map.load_per_state),
        load_of_mean=with_more(inverse_map.load_of_mean),
        error_load=with_more(inverse_map.error_load),
        fixed_load=with_more(inverse_map.fixed_load),
    )


def with_own_further(inverse_map: InverseMap, manifold: ManifoldMap | None = None) -> InverseMap:
    """Loads that are no combination of the five, with tables ``manifold`` of as many loads."""
    random, errors, loads = np.random.default_rng(8), inverse_map.error_strain, inverse_map.error_load
    size = float(np.abs(inverse_map.load_of_mean).max())
    states = float(np.abs(inverse_map.load_per_state).max())
    per_state = states * random.standard_normal((M, inverse_map.n_states))
    of_mean = size * random.standard_normal(M)
    random.uniform(size=M)  # not used: the golden streams are of the numbers that follow
    return _with_loads(
        inverse_map,
        STATIONS,
        manifold,
        load_per_state=per_state,
        load_of_mean=of_mean,
        error_load=float(np.abs(loads).max()) * random.standard_normal((M, errors.shape[1])),
        fixed_load=0.01 * size * random.standard_normal(M),
    )


def of_five_loads(inverse_map: InverseMap) -> InverseMap:
    """Return ``inverse_map`` without the loads behind the five, in its tables too."""
    manifold = inverse_map.manifold
    if manifold is not None:
        n = manifold.n_gauges + 5
        five = {"response": manifold.response[:, :, :n], "fixed_response": manifold.fixed_response[:n]}
        manifold = replace(manifold, **five, error_load=manifold.error_load[:5])
    names = ("load_per_state", "load_of_mean", "error_load", "fixed_load")
    rows = {name: None if getattr(inverse_map, name) is None else getattr(inverse_map, name)[:5] for name in names}
    return replace(inverse_map, section_station=np.zeros(0), manifold=manifold, **rows)


def _with_tables(
    manifold: ManifoldMap, response: np.ndarray, fixed_response: np.ndarray, error_load: np.ndarray
) -> ManifoldMap:
    """Return ``manifold``, of five loads, with tables and errors of others behind them."""
    return replace(
        manifold,
        response=np.concatenate([manifold.response, response], axis=2),
        fixed_response=np.append(manifold.fixed_response, fixed_response),
        error_load=np.vstack([manifold.error_load, error_load]),
    )


def _with_loads(
    inverse_map: InverseMap, station: np.ndarray, manifold: ManifoldMap | None, **rows: np.ndarray
) -> InverseMap:
    """Return ``inverse_map``, of five loads, with ``rows`` of others behind them."""
    joined = {name: np.concatenate([getattr(inverse_map, name), more]) for name, more in rows.items()}
    return replace(inverse_map, section_station=station, manifold=manifold, **joined)


def with_further_tables(inverse_map: InverseMap) -> InverseMap:
    """Return ``inverse_map``, of :func:`flight_fmu.whole_map`, with :func:`with_own_further` and their tables.

    The rolling moment is that of a body of revolution; the torsion follows cosines and sines of every harmonic.
    """
    random, manifold = np.random.default_rng(9), inverse_map.manifold
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
    return with_own_further(
        inverse_map, _with_tables(manifold, table_coefficients(factors), 1.0 + np.arange(M), errors)
    )
