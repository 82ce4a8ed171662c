"""Series of samples: equal to the samples one by one, in every state of health."""

import numpy as np
import pytest
from random_map import N_GAUGES, map_of, random_map, random_model

from strainfmu.errors import InputError
from strainfmu.estimator.estimate import Estimate
from strainfmu.estimator.estimator import PIECE, Estimator
from strainfmu.estimator.health import HealthState
from strainfmu.estimator.map.inverse_map import InverseMap
from strainfmu.estimator.settings import EstimatorSettings

Q = 95.8e3
MAPS = {
    "case 1": lambda: map_of(random_model(gamma=0.0, n_gauges=54, n_states=5)),
    "case 2": lambda: map_of(random_model(gamma=1.0, n_gauges=27, n_states=12)),
    "few gauges": random_map,
}


def samples(inverse_map: InverseMap, k: int, seed: int = 1) -> np.ndarray:
    """(k, n_d) strains of random states with the noise of the map, a third of the samples with a fault."""
    random = np.random.default_rng(seed)
    a, n = inverse_map.state_operator, inverse_map.n_gauges
    root = np.linalg.cholesky(inverse_map.noise_covariance)
    strain = (
        random.normal(size=(k, a.shape[1])) @ a.T + random.normal(size=(k, n)) @ root.T + inverse_map.mean_strain
    )
    faulty = random.permutation(k)[: k // 3]
    gauge = random.integers(n, size=len(faulty))
    strain[faulty, gauge] = random.choice([np.nan, np.inf, 1e3], size=len(faulty))
    off = random.permutation(k)[: k // 3]
    strain[off, random.integers(n, size=len(off))] += 8.0 * inverse_map.noise_std.max()
    return strain


NAMES = ("valid", "dynamic_pressure_std")
FIELDS = ("loads", "loads_std", "load_covariance", "coefficients", "coefficients_std", "coefficient_covariance")
FIELDS += ("health", "chi_square", "chi_square_limit", "degrees_of_freedom", "envelope_score", "residual_limit")
FIELDS += ("valid", "standardised_residual", "suspects", "fits", "other_loads", "other_coefficients_std")


def assert_equal(found: Estimate, expected: list[Estimate]) -> None:
    """Every field of every sample, bit by bit; NaN equals NaN."""
    assert len(found) == len(expected)
    for name in FIELDS:
        values = [getattr(one, name) for one in expected]
        if name == "suspects":
            assert found.suspects.tolist() == values
        else:
            np.testing.assert_array_equal(getattr(found, name), np.array(values), err_msg=name)


@pytest.mark.parametrize("name", MAPS)
def test_series_is_its_samples(name: str) -> None:
    """With lost gauges, outliers, pressures that are none, masks of the caller and all gauges lost."""
    inverse_map = MAPS[name]()
    random, k = np.random.default_rng(2), 60
    settings = EstimatorSettings(reference_area=0.3, reference_length=0.7, moment_station=1.5, sensor_range=1e2)
    strain = samples(inverse_map, k)
    q = np.where(random.random(k) < 0.8, Q * (1.0 + 0.1 * random.random(k)), random.choice([0.0, np.nan, -1.0], k))
    q_std = random.choice([0.0, 1e3, np.nan], k, p=[0.5, 0.4, 0.1])
    valid = random.random((k, inverse_map.n_gauges)) < 0.97
    valid[7] = False
    for estimator in (Estimator(inverse_map), Estimator(inverse_map, settings)):
        found = estimator.estimate(strain, q, valid=valid, dynamic_pressure_std=q_std)
        rows = zip(strain, q, valid, q_std, strict=True)
        expected = [estimator.estimate(d, p, valid=used, dynamic_pressure_std=std) for d, p, used, std in rows]
        assert_equal(found, expected)
        assert {HealthState.INVALID, HealthState.NO_COEFFICIENTS} <= {HealthState(h) for h in found.health}


def test_one_sample_of_a_series_is_an_estimate() -> None:
    inverse_map = random_map()
    estimator, strain = Estimator(inverse_map), samples(inverse_map, 9)
    found = estimator.estimate(strain, Q)
    for i, row in enumerate(strain):
        one, single = found[i], estimator.step(row, Q)
        assert (one.health, one.suspects) == (single.health, single.suspects)
        np.testing.assert_array_equal(one.valid, single.valid)


def test_residuals_may_be_found_at_once() -> None:
    inverse_map = random_map()
    estimator, strain = Estimator(inverse_map), samples(inverse_map, 30)
    at_once, later = (estimator.estimate(strain, Q, with_residuals=one) for one in (True, False))
    assert_equal(at_once, list(later))
    np.testing.assert_array_equal(at_once.standardised_residual, later.standardised_residual)
    assert list(at_once.suspects) == list(later.suspects)


def test_arguments_serve_all_samples_or_each() -> None:
    inverse_map = random_map()
    estimator, strain = Estimator(inverse_map), samples(inverse_map, 5)
    mask = np.arange(N_GAUGES) != 2
    one, each = (
        estimator.estimate(strain, Q, valid=mask, dynamic_pressure_std=1e3),
        estimator.estimate(strain, np.full(5, Q), valid=[mask] * 5, dynamic_pressure_std=[1e3] * 5),
    )
    np.testing.assert_array_equal(one.coefficients_std, each.coefficients_std)
    np.testing.assert_array_equal(one.valid, each.valid)


def test_no_samples() -> None:
    found = Estimator(random_map()).estimate(np.zeros((0, N_GAUGES)), Q)
    assert len(found) == 0
    assert found.coefficients.shape == (0, 5)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ((np.zeros((4, 7)), Q), r"strain: expected \(k, 8\) values, got \(4, 7\)"),
        ((np.zeros((4, 8)), np.full(3, Q)), r"dynamic_pressure: expected a number or 4 numbers, got shape \(3,\)"),
        ((np.zeros((4, 8)), None), "dynamic_pressure: expected a number or 4 numbers, got None"),
        ((np.zeros(8), None), "dynamic_pressure: expected a number, got None"),
        ((np.zeros(8), "high"), "dynamic_pressure: expected a number, got 'high'"),
        ((np.zeros(8), [Q, Q]), r"dynamic_pressure: expected a number, got shape \(2,\)"),
        ((np.zeros((4, 8)), Q, np.ones((3, 8), dtype=bool)), r"valid: expected \(8,\) or \(4, 8\) values of bool"),
        ((np.zeros((4, 8)), Q, np.ones((4, 8))), "of float64"),
        ((np.zeros((4, 8)), Q, None, [1.0, 2.0]), "dynamic_pressure_std: expected a number or 4 numbers"),
        ((np.zeros(8) + 1e-6j, Q), "strain: expected real numbers, got complex128"),
        ((np.zeros((4, 8)) + 0j, Q), "strain: expected real numbers, got complex128"),
        (([1e-6j] * 8, Q), "strain: expected real numbers, got complex128"),
        ((np.full(8, 1e-6j, dtype=object), Q), "strain: expected real numbers: .*complex"),
        ((["much"] * 8, Q), "strain: expected real numbers: .*'much'"),
        (([[0.0] * 8, [0.0] * 7], Q), "strain: expected real numbers: .*inhomogeneous"),
        ((np.zeros(8), np.array(Q + 1j)), "dynamic_pressure: expected a number, got complex128"),
    ],
)
def test_wrong_arguments_are_refused(arguments: tuple[object, ...], message: str) -> None:
    with pytest.raises(InputError, match=message):
        Estimator(random_map()).estimate(*arguments[:2], **dict(zip(NAMES, arguments[2:], strict=False)))


def test_names_are_views_of_the_arrays() -> None:
    inverse_map = random_map()
    estimator, strain = Estimator(inverse_map), samples(inverse_map, 6)
    for found in (estimator.estimate(strain, Q), estimator.estimate(strain[0], Q)):
        for i, name in enumerate(("C_A", "C_N", "C_Y", "M_P", "M_Y")):
            np.testing.assert_array_equal(getattr(found, name), found.coefficients[..., i])
            np.testing.assert_array_equal(getattr(found.sigma, name), found.coefficients_std[..., i])
        names = ("axial_force", "normal_force", "side_force", "pitching_moment", "yawing_moment")
        for i, name in enumerate(names):
            np.testing.assert_array_equal(getattr(found, name), found.loads[..., i])
            np.testing.assert_array_equal(getattr(found.sigma, name), found.loads_std[..., i])


def test_dataframe_has_a_row_a_sample() -> None:
    pandas = pytest.importorskip("pandas")
    inverse_map = random_map()
    estimator, strain = Estimator(inverse_map), samples(inverse_map, 6)
    found = estimator.estimate(strain, Q)
    table = found.to_dataframe()
    assert isinstance(table, pandas.DataFrame)
    np.testing.assert_array_equal(table["C_N"], found.C_N)
    np.testing.assert_array_equal(table["sigma.yawing_moment"], found.sigma.yawing_moment)
    assert table["health"].tolist() == [HealthState(h).name for h in found.health]
    assert table["valid_gauges"].tolist() == found.valid.sum(axis=1).tolist()
    one = estimator.estimate(strain[3], Q).to_dataframe()
    assert one.shape == (1, table.shape[1])
    assert one["health"].tolist() == table["health"].tolist()[3:4]


def test_each_value_has_a_description_of_its_own() -> None:
    described = {name: value.__doc__ for name, value in vars(Estimate).items() if isinstance(value, property)}
    texts = list(described.values())
    assert described["chi_square_limit"].startswith("Detection threshold of chi-square")
    assert [name for name, text in described.items() if not text or texts.count(text) > 1] == []


def test_notebooks_show_tables() -> None:
    """Every text is escaped, and no number is missing."""
    from dataclasses import replace

    inverse_map = replace(random_map(), vehicle="A <b> & co")
    estimator, strain = Estimator(inverse_map), samples(inverse_map, 6)
    shown = inverse_map._repr_html_()
    assert "A &lt;b&gt; &amp; co" in shown
    assert "Case 1" in shown
    one = estimator.estimate(inverse_map.mean_strain, Q)
    assert f"<td>{one.C_N:.5g} +- {one.sigma.C_N:.2g}</td>" in one._repr_html_()
    assert "Estimate of" in estimator.estimate(strain, Q)._repr_html_()


def test_estimates_compare_by_identity() -> None:
    inverse_map = random_map()
    one = Estimator(inverse_map).estimate(inverse_map.mean_strain, Q)
    assert one == one
    assert one != Estimator(inverse_map).estimate(inverse_map.mean_strain, Q)
    assert inverse_map != random_map()


def test_samples_in_several_pieces_are_those_of_each() -> None:
    """Of so many samples that several processors share them."""
    inverse_map = MAPS["case 1"]()
    estimator, k = Estimator(inverse_map), 2 * PIECE + 5
    random = np.random.default_rng(3)
    strain = inverse_map.mean_strain + random.normal(size=(k, 54)) * inverse_map.noise_std
    found = estimator.estimate(strain, Q)
    for first in range(0, k, 1000):
        part = estimator.estimate(strain[first : first + 1000], Q)
        for name in ("loads", "loads_std", "coefficients", "chi_square", "health", "standardised_residual"):
            np.testing.assert_array_equal(getattr(found, name)[first : first + 1000], getattr(part, name))


@pytest.mark.parametrize("n_samples", [None, 0, 1, 2000])
def test_a_result_is_shown_in_a_few_lines(n_samples: int | None) -> None:
    """Kind, number of samples, every load with its sigma and unit, and health: of one sample and of thousands."""
    inverse_map = random_map()
    strain = inverse_map.mean_strain if n_samples is None else samples(inverse_map, n_samples)
    found = Estimator(inverse_map).estimate(strain, Q)
    lines = repr(found).splitlines()
    assert len(lines) <= 8
    assert max(map(len, lines)) <= 110
    if not found.is_series:
        assert lines[0].startswith(f"Estimate: health OK, chi-square {found.chi_square:.4g}")
        assert f"{found.normal_force:.5g} +- {found.sigma.normal_force:.2g} N" in repr(found)
        assert f"C_N {found.C_N:.5g} +- {found.sigma.C_N:.2g}" in repr(found)
    else:
        assert lines[0].startswith(f"Estimate of {n_samples} sample")
        for state, count in zip(*np.unique(found.health, return_counts=True), strict=True):
            assert f"{count} {HealthState(int(state)).name}" in lines[0]
    if n_samples == 2000:
        known = found.normal_force[np.isfinite(found.normal_force)]
        assert f"{known.min():.5g} to {known.max():.5g} N" in repr(found)


def test_a_result_without_loads_is_shown() -> None:
    inverse_map = random_map()
    found = Estimator(inverse_map).estimate(np.full(N_GAUGES, np.nan), Q)
    assert repr(found).startswith("Estimate: health INVALID, chi-square 0,")
    assert "normal_force not known" in repr(found)
    lost = Estimator(inverse_map).estimate(np.full((3, N_GAUGES), np.nan), Q)
    assert "3 INVALID" in repr(lost)
    assert "normal_force not known" in repr(lost)
