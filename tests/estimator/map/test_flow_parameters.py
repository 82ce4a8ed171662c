"""Flow parameters: out of range they tell that the map does not hold, by name, and nothing else."""

from typing import Any

import numpy as np
import pytest
from parameter_maps import with_parameters
from random_map import random_map
from scaled_maps import NOMINAL, whole_scaled_map

from strainfmu.errors import InputError
from strainfmu.estimator.estimator import Estimator
from strainfmu.estimator.health import HealthState
from strainfmu.estimator.map.validity import flow_parameters

pytestmark = pytest.mark.fast


@pytest.fixture(scope="module")
def estimator() -> Estimator:
    return Estimator(with_parameters(whole_scaled_map(1, seed=4, n=30, n_states=5)))


@pytest.mark.parametrize(
    ("given", "outside"),
    [
        ({}, ()),
        ({"fin_deg": np.nan, "power": 0.3}, ()),
        ({"fin_deg": -4.0, "power": 0.0, "cant_deg": 2.0}, ()),
        ({"fin_deg": 4.079}, ()),
        ({"fin_deg": 4.081}, ("fin_deg",)),
        ({"fin_deg": -9.0, "power": 0.6}, ("fin_deg", "power")),
        ({"cant_deg": 2.01}, ()),
        ({"cant_deg": 2.05}, ("cant_deg",)),
        ({"power": np.inf}, ("power",)),
    ],
)
def test_health_names_what_leaves_its_range(
    estimator: Estimator, given: dict[str, float], outside: tuple[str, ...]
) -> None:
    strain = estimator.inverse_map.mean_strain
    plain, found = estimator.step(strain, NOMINAL), estimator.step(strain, NOMINAL, parameters=given)
    assert plain.health == HealthState.OK
    assert found.outside_parameters == outside
    assert found.health == (HealthState.OUTSIDE if outside else HealthState.OK)
    assert np.isfinite(found.parameter_score).all()
    np.testing.assert_array_equal(found.loads, plain.loads)
    np.testing.assert_array_equal(found.coefficients_std, plain.coefficients_std)


def test_score_is_the_part_of_the_range(estimator: Estimator) -> None:
    given = {"fin_deg": 6.0, "power": -0.1, "cant_deg": 3.0}
    found = estimator.step(estimator.inverse_map.mean_strain, NOMINAL, parameters=given)
    np.testing.assert_allclose(found.parameter_score, [0.25, 0.2, 0.5], rtol=1e-14)


def test_series_with_lost_gauges(estimator: Estimator) -> None:
    strain = np.tile(estimator.inverse_map.mean_strain, (4, 1))
    strain[2, 5] = np.nan
    strain[3] = np.nan
    found = estimator.estimate(strain, NOMINAL, parameters={"fin_deg": [0.0, 5.0, 5.0, 5.0], "power": 0.1})
    states = [HealthState.OK, HealthState.OUTSIDE, HealthState.OUTSIDE, HealthState.INVALID]
    assert [HealthState(one) for one in found.health] == states
    assert [found[i].outside_parameters for i in range(4)] == [(), *[("fin_deg",)] * 3]
    assert [found[i].parameter_score.tolist() for i in range(4)] == found.parameter_score.tolist()
    assert found.outside_parameters.tolist() == [(), *[("fin_deg",)] * 3]


def test_strain_that_does_not_fit_is_second_to_the_range(estimator: Estimator) -> None:
    strain = estimator.inverse_map.mean_strain + 1e-3 * (-1.0) ** np.arange(30)
    assert estimator.step(strain, NOMINAL).health == HealthState.INCONSISTENT
    assert estimator.step(strain, NOMINAL, parameters={"power": 1.0}).health == HealthState.OUTSIDE


def test_bad_input_is_one_line(estimator: Estimator) -> None:
    strain = estimator.inverse_map.mean_strain
    with pytest.raises(InputError, match="parameters of the map, fin_deg, power, cant_deg, got 'flap_deg'"):
        estimator.step(strain, NOMINAL, parameters={"flap_deg": 1.0})
    with pytest.raises(InputError, match="power: expected a number, got shape"):
        estimator.step(strain, NOMINAL, parameters={"power": [1.0, 2.0]})
    with pytest.raises(InputError, match="expected the parameters of the map, none, got 'power'"):
        Estimator(random_map()).step(random_map().mean_strain, 1e5, parameters={"power": 1.0})


@pytest.mark.parametrize("given", [[1.0], (), np.ones(3), 0.5, "power"])
def test_values_without_names_are_refused_in_one_line(estimator: Estimator, given: Any) -> None:
    strain = estimator.inverse_map.mean_strain
    for call in (estimator.step, estimator.estimate):
        with pytest.raises(InputError, match=r"^parameters: expected values by name, of the map's fin_deg, power"):
            call(strain, NOMINAL, parameters=given)
    with pytest.raises(InputError, match=r"^parameters_std: expected values by name, .* got \S"):
        estimator.step(strain, NOMINAL, parameters_std=given)


def test_a_map_without_parameters_has_none() -> None:
    assert flow_parameters(random_map()).names == ()
    assert Estimator(random_map()).step(random_map().mean_strain, 1e5).parameter_score.shape == (0,)
