"""Maps of many gauges: columns of errors give what full matrices of the same gauges give."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from linear_kinds import KINDS
from scaled_maps import whole_scaled_map
from sweeps import crossed
from test_linear_reference import agreement

from strainfmu.errors import InputError
from strainfmu.estimator.estimate import Estimate
from strainfmu.estimator.estimator import Estimator
from strainfmu.estimator.health import chi_square_limit, chi_square_survival
from strainfmu.estimator.map import inverse_map as of_maps
from strainfmu.estimator.map.inverse_map import InverseMap, load_inverse_map
from strainfmu.estimator.reference import gain as gain_module
from strainfmu.estimator.reference.gain import nominal
from strainfmu.estimator.reference.linear import models

SMALL_KINDS = [name for name in KINDS if name.startswith(("case", "five", "zeros"))]
"""Kinds that may be computed by columns of errors."""


@pytest.fixture
def by_columns(monkeypatch: pytest.MonkeyPatch) -> None:
    """Any number of gauges counts as many."""
    monkeypatch.setattr(of_maps, "DENSE_GAUGES", 1)


@pytest.mark.fast
@pytest.mark.usefixtures("by_columns")
@pytest.mark.parametrize("name", SMALL_KINDS)
def test_few_gauges_by_columns_agree_with_the_reference(name: str) -> None:
    """z is left out: with as many columns as gauges it is a difference of nearly equal numbers."""
    assert KINDS[name].make().is_low_rank
    apart = agreement(name, n=100, seed=3)
    assert not {quantity: value for quantity, value in apart.items() if quantity != "z" and value > 1e-8}


@pytest.mark.fast
@pytest.mark.parametrize("case", [1, 2])
def test_gain_and_precision_by_columns_are_those_by_matrices(case: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """To 1e-9 of the largest entry, of each load and of each pair of gauges."""
    model = models(whole_scaled_map(case, seed=4, n=60, n_states=4))[0]
    full = nominal(model)
    monkeypatch.setattr(gain_module, "DENSE_GAUGES", 1)
    many = nominal(model)
    size = np.abs(full.gain).max(axis=1, keepdims=True)
    np.testing.assert_allclose(many.gain / size, full.gain / size, rtol=0.0, atol=1e-9)
    std = np.sqrt(np.diag(full.precision))
    size = np.outer(std, std)
    np.testing.assert_allclose(many.precision / size, full.precision / size, rtol=0.0, atol=1e-9)


@pytest.fixture(scope="module", params=[54, 128])
def inverse_map(request: pytest.FixtureRequest) -> InverseMap:
    """A map of so many gauges with errors of every kind."""
    return whole_scaled_map(1, seed=4, n=request.param, n_states=4)


def samples(inverse_map: InverseMap, lost: int, fault: float, seed: int) -> tuple[np.ndarray, np.ndarray]:
    """Return readings (k, n_d) of the map's own law, with gauges lost and one off by ``fault``, and q_inf (k,)."""
    random, m, k = np.random.default_rng(seed), inverse_map, 6
    pressure = np.geomspace(1e4, 1.5e6, k)
    s = (pressure / m.nominal_dynamic_pressure)[:, None]
    state = (
        random.standard_normal((k, m.n_states))
        * np.sqrt(np.mean(m.mean_strain**2))
        / np.sqrt(np.mean(m.state_operator**2, axis=0))
    )
    response = m.mean_strain + 0.1 * state @ m.state_operator.T
    response = response + random.standard_normal((k, m.error_strain.shape[1])) @ m.error_strain.T
    own = s * m.own_error_strain * random.standard_normal((k, m.n_gauges))
    readings = s * response + own + m.noise_std * random.standard_normal((k, m.n_gauges))
    readings[:, m.n_gauges // 2] += fault * (1.0 + s[:, 0])
    readings[:, random.permutation(m.n_gauges)[:lost]] = np.nan
    return readings, pressure


@pytest.mark.parametrize(("lost", "fault"), crossed([0, 1, 7, 18], [0.0, 1e-4]))
def test_columns_agree_with_full_matrices(
    inverse_map: InverseMap, monkeypatch: pytest.MonkeyPatch, lost: int, fault: float
) -> None:
    readings, pressure = samples(inverse_map, lost * inverse_map.n_gauges // 54, fault, seed=lost + 1)
    full = Estimator(replace(inverse_map)).estimate(readings, pressure)
    monkeypatch.setattr(of_maps, "DENSE_GAUGES", 1)
    many = replace(inverse_map)
    assert many.is_low_rank
    # The columns of these maps nearly determine some gauges: their z are differences of nearly equal numbers.
    compare(full, Estimator(many).estimate(readings, pressure), of_z=1e-5)


@pytest.mark.slow
@pytest.mark.parametrize("lost", [0, 1, 18])
@pytest.mark.parametrize("fault", [0.0, 1e-4])
def test_shipped_gauges_by_columns_agree_with_full_matrices(
    ic3x_demo: Path, monkeypatch: pytest.MonkeyPatch, lost: int, fault: float
) -> None:
    shipped = load_inverse_map(ic3x_demo / "map.h5").without_tables()
    readings, pressure = samples(shipped, lost, fault, seed=lost + 1)
    full = Estimator(replace(shipped)).estimate(readings, pressure)
    monkeypatch.setattr(of_maps, "DENSE_GAUGES", 1)
    compare(full, Estimator(replace(shipped)).estimate(readings, pressure), of_z=1e-9)


@pytest.mark.slow
@pytest.mark.parametrize("lost", [0, 1, 16, 17, 170])
def test_512_gauges_by_columns_agree_with_full_matrices(monkeypatch: pytest.MonkeyPatch, lost: int) -> None:
    """Few columns, and errors of each gauge; lost ones are taken off one by one, or are too many for that."""
    whole = whole_scaled_map(1, seed=4, n=512, n_states=4)
    common, own = np.r_[:20, -18:0], whole.error_strain[:, -530:-18]  # errors at strain stand last
    columns = {"error_strain": whole.error_strain[:, common], "error_load": whole.error_load[:, common]}
    many = replace(whole, **columns, own_error_strain=np.linalg.norm(own, axis=1))
    readings, pressure = samples(many, lost, 1e-4, seed=lost + 1)
    full = Estimator(many).estimate(readings, pressure)
    monkeypatch.setattr(of_maps, "DENSE_GAUGES", 511)
    by_columns = replace(many)
    assert by_columns.is_low_rank
    compare(full, Estimator(by_columns).estimate(readings, pressure), of_z=1e-9)


def compare(full: Estimate, columns: Estimate, of_z: float) -> None:
    """Assert that two estimates are one to 1e-9 standard deviations, and their health is the same."""
    std = full.loads_std
    assert np.abs((columns.loads - full.loads) / std).max() < 1e-9
    assert np.abs(columns.loads_std / std - 1.0).max() < 1e-9
    assert np.abs(columns.load_covariance - full.load_covariance)[:, 0, 1] @ (1.0 / (std[:, 0] * std[:, 1])) < 1e-9
    assert np.abs(columns.chi_square / full.chi_square - 1.0).max() < 1e-9
    assert np.abs(columns.chi_square_limit / full.chi_square_limit - 1.0).max() < 1e-9
    z = full.standardised_residual
    assert np.nanmax(np.abs(columns.standardised_residual - z) / np.maximum(np.abs(z), 1.0)) < of_z
    assert np.array_equal(columns.health, full.health)
    assert [*columns.suspects] == [*full.suspects]


def test_a_filtered_track_by_columns_is_the_same(inverse_map: InverseMap, monkeypatch: pytest.MonkeyPatch) -> None:
    """The filter needs gains; zero offsets of unknown errors change what the gauges have in common."""
    readings, _ = samples(inverse_map, 0, 0.0, seed=5)

    def track(of: InverseMap) -> np.ndarray:
        estimator = Estimator(of, filter_time_constant=0.5)
        return np.array(
            [
                estimator.track(row, 139e3, time=0.01 * k).loads_std
                for k, row in enumerate(np.repeat(readings[3:4], 20, axis=0))
            ]
        )

    full = track(replace(inverse_map))
    monkeypatch.setattr(of_maps, "DENSE_GAUGES", 1)
    assert np.abs(track(replace(inverse_map)) / full - 1.0).max() < 1e-9


def test_full_matrices_have_a_largest_number_of_gauges(monkeypatch: pytest.MonkeyPatch) -> None:
    few = whole_scaled_map(1, seed=4, n=24, n_states=4)
    monkeypatch.setattr(of_maps, "MOST_DENSE_GAUGES", 23)
    with pytest.raises(InputError, match="24 gauges found, must be 23 at most with tables, temperature"):
        replace(few)
    monkeypatch.setattr(of_maps, "DENSE_GAUGES", 23)
    assert replace(few).is_low_rank


@pytest.mark.fast
@pytest.mark.parametrize(("freedom", "limit"), [(513, 640.76079), (2000, 2243.80835), (4096, 4441.19141)])
def test_limits_of_many_degrees_of_freedom(freedom: int, limit: float) -> None:
    """scipy.stats.chi2.isf(1e-4, freedom)."""
    assert abs(chi_square_limit(freedom, 1e-4) - limit) < 1e-4
    assert abs(chi_square_survival(chi_square_limit(freedom, 1e-4), freedom) / 1e-4 - 1.0) < 1e-9
