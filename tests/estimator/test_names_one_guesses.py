"""Names and shapes that one guesses: floats of one sample, arrays of many, every quantity by its name."""

from dataclasses import fields

import numpy as np
import pytest
from random_map import map_of, random_model

import strainfmu
from strainfmu.estimator.air_data import AirData
from strainfmu.estimator.air_inputs import AIR_DATA_NAMES, AIR_INPUT_NAMES, INERTIAL_NAMES
from strainfmu.estimator.arguments import SampleInputs
from strainfmu.estimator.signal_names import COEFFICIENT_NAMES, LOAD_NAMES

pytestmark = pytest.mark.fast

Q = 95.8e3


@pytest.fixture(scope="module")
def estimator() -> strainfmu.Estimator:
    return strainfmu.Estimator(map_of(random_model(gamma=1.0, n_gauges=27, n_states=12)))


def test_one_sample_gives_floats_and_many_give_arrays(estimator: strainfmu.Estimator) -> None:
    strain = estimator.inverse_map.mean_strain
    one, many = estimator.estimate(strain, Q), estimator.estimate(np.stack([strain, strain]), Q)
    names = (*COEFFICIENT_NAMES, *LOAD_NAMES, "M_R", "rolling_moment")
    for of_one, of_many in ((one, many), (one.sigma, many.sigma)):
        assert {name: type(getattr(of_one, name)) for name in names} == dict.fromkeys(names, float)
        assert {name: getattr(of_many, name).shape for name in names} == dict.fromkeys(names, (2,))
    for name in AIR_DATA_NAMES:
        assert type(getattr(one.air_data, name)) is float
        assert getattr(many.air_data.sigma, name).shape == (2,)
    assert all(type(z) is float for z in one.residuals.values())
    assert all(type(z) is float for z in (one.in_wind_axes(0.1, 0.0).C_L, one.in_stability_axes(0.1).C_D))


def test_air_data_have_the_order_of_their_names() -> None:
    value = np.arange(7.0)
    found = AirData(value=value, std=10.0 + value, is_identified=np.ones(7, dtype=bool))
    assert [getattr(found, name) for name in AIR_DATA_NAMES] == value.tolist()
    assert [getattr(found.sigma, name) for name in AIR_DATA_NAMES] == (10.0 + value).tolist()
    assert [one.name for one in fields(found)] == ["value", "std", "is_identified"]


def test_gauges_loads_and_residuals_have_names(estimator: strainfmu.Estimator) -> None:
    inverse_map = estimator.inverse_map
    strain = inverse_map.mean_strain.copy()
    strain[4] += 60.0 * inverse_map.noise_std[4]
    found = estimator.estimate(np.stack([inverse_map.mean_strain, strain]), Q)
    assert tuple(found.residuals) == estimator.gauge_names == inverse_map.gauge_names
    np.testing.assert_array_equal(found.residuals[estimator.gauge_names[4]], found.standardised_residual[:, 4])
    assert found.suspect_names.tolist() == [(), (estimator.gauge_names[4],)]
    assert found[1].suspect_names == (estimator.gauge_names[4],)
    assert estimator.load_names[:5] == LOAD_NAMES
    assert len(estimator.load_names) == 5 + found.other_loads.shape[1]


def test_arguments_of_a_sample_are_those_of_the_tables() -> None:
    """The typed record against the tables of inputs: a new input cannot be forgotten in one of them."""
    others = {"valid", "temperature", "thrust", "parameters", "parameters_std"}
    assert set(SampleInputs.__annotations__) | {"dynamic_pressure"} == {*AIR_INPUT_NAMES, *INERTIAL_NAMES, *others}


def test_estimate_and_track_take_the_same_inputs(estimator: strainfmu.Estimator) -> None:
    """A linear map without a filter: equal bits; what stands behind the second place is refused."""
    strain = estimator.inverse_map.mean_strain
    inputs = {"mach_number": 6.0, "altitude": 2e4, "dynamic_pressure_std": 2e3, "valid": np.arange(27) != 3}
    of_each, of_track = (call(strain, Q, **inputs) for call in (estimator.estimate, estimator.track))
    np.testing.assert_array_equal(of_each.sample, of_track.sample)
    np.testing.assert_array_equal(of_each.loads, of_track.loads)
    with pytest.raises(TypeError, match="positional"):
        estimator.estimate(strain, Q, np.ones(27, dtype=bool))  # type: ignore[misc]
    with pytest.raises(strainfmu.InputError, match="angle: expected a quantity of a sample"):
        estimator.estimate(strain, Q, angle=1.0)  # type: ignore[call-arg]


def test_numbers_or_texts_where_both_are_natural() -> None:
    assert strainfmu.ExportOptions(fmi_version=3).fmi_version == "3"  # type: ignore[arg-type]


def test_every_public_name_is_there() -> None:
    assert {name for name in strainfmu.__all__ if not hasattr(strainfmu, name)} == set()
    assert "load_recording" in strainfmu.__all__
    assert sorted(set(strainfmu.__all__)) == sorted(strainfmu.__all__)
