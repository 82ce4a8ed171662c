"""The pressure field of a linear map with its standard deviation."""

from dataclasses import replace

import numpy as np
import pytest
from coarse_vehicle import with_paper_map
from random_map import random_map
from state_estimates import state_gain, state_offset

from builder.campaign.snapshots import Snapshots
from builder.inverse.build import build_inverse_map
from builder.structure.fourier.fourier_model import StructuralModel
from builder.vehicle.file import Vehicle
from strainfmu.errors import InputError
from strainfmu.estimator.estimator import Estimator
from strainfmu.estimator.map.inverse_map import InverseMap


@pytest.fixture(scope="module", params=[1, 2])
def inverse_map(
    request: pytest.FixtureRequest, vehicle: Vehicle, structure: StructuralModel, snapshots: Snapshots
) -> InverseMap:
    entry = vehicle.map.model_copy(update={"keep_field": True, "case": request.param})
    return build_inverse_map(vehicle.model_copy(update={"map": entry}), snapshots, structure)


def test_sigma_covers_flights_between_the_snapshots(
    vehicle: Vehicle, structure: StructuralModel, held_out: Snapshots, inverse_map: InverseMap
) -> None:
    net = held_out.pressure - held_out.internal_pressure[:, None]
    strain = net @ structure.strain_operator(vehicle.gauges.layout).T
    strain = strain + inverse_map.noise_std * np.random.default_rng(1).standard_normal(strain.shape)
    q = np.array([condition.dynamic_pressure for condition in held_out.conditions()])
    valid = np.ones(inverse_map.n_gauges, dtype=bool)
    valid[[3, 17]] = False
    for used in (None, valid):
        found = Estimator(inverse_map).estimate(strain, q, valid=used)
        fields = [found[row].pressure() for row in range(len(net))]
        error = np.array([one.pressure for one in fields]) - net
        sigma = np.array([one.std for one in fields])
        assert all(one.is_net for one in fields)
        assert np.mean(np.abs(error) <= 3.0 * sigma) > 0.99
        # Not wide for its own sake: a field of the mean alone would need more.
        spread = np.sqrt(np.mean((net - net.mean(axis=0)) ** 2))
        assert np.sqrt(np.mean(error**2)) < np.sqrt(np.mean(sigma**2)) < spread


def test_strain_of_a_state_gives_its_field_at_any_dynamic_pressure(inverse_map: InverseMap) -> None:
    size = 1e4 if inverse_map.case == 1 else 1.0
    state = size * np.random.default_rng(2).standard_normal(inverse_map.n_states)
    for ratio in (0.3, 2.0):
        strain = ratio * (inverse_map.mean_strain + inverse_map.state_operator @ state)
        found = Estimator(inverse_map).step(strain, ratio * inverse_map.nominal_dynamic_pressure).pressure()
        wanted = ratio * (inverse_map.field_mean + inverse_map.field_modes @ state)
        if inverse_map.case == 1:
            np.testing.assert_allclose(found.pressure, wanted, atol=1e-5 * np.max(np.abs(wanted)))
        else:  # the prior draws the states to the mean
            assert np.mean(np.abs(found.pressure - wanted) <= 3.0 * found.std) > 0.99


def test_no_number_depends_on_a_lost_gauge(inverse_map: InverseMap) -> None:
    valid = np.arange(inverse_map.n_gauges) != 5
    estimator, q = Estimator(inverse_map), inverse_map.nominal_dynamic_pressure
    fields = []
    for value in (0.0, 1e-3, np.nan):
        strain = inverse_map.mean_strain.copy()
        strain[5] = value
        fields.append(estimator.estimate(strain, q, valid=valid).pressure())
    for one in fields[1:]:
        np.testing.assert_array_equal(one.pressure, fields[0].pressure)
        np.testing.assert_array_equal(one.std, fields[0].std)
    nothing = estimator.estimate(strain, q, valid=np.zeros(inverse_map.n_gauges, dtype=bool)).pressure()
    assert np.all(np.isnan(nothing.pressure))
    assert np.all(np.isnan(nothing.std))


def test_the_array_of_the_caller_may_change(inverse_map: InverseMap) -> None:
    strain = inverse_map.mean_strain.copy()
    found = Estimator(inverse_map).step(strain, inverse_map.nominal_dynamic_pressure)
    before = found.pressure().pressure
    strain[:] = 0.0
    np.testing.assert_array_equal(found.pressure().pressure, before)


def test_the_map_of_the_source_gives_absolute_pressure(
    vehicle: Vehicle, structure: StructuralModel, snapshots: Snapshots
) -> None:
    found = build_inverse_map(with_paper_map(vehicle, keep_field=True), snapshots, structure)
    strain = 1.05 * found.mean_strain
    field = Estimator(found).step(strain, found.nominal_dynamic_pressure).pressure()
    wanted = found.field_mean + found.field_modes @ (state_gain(found) @ strain + state_offset(found))
    np.testing.assert_allclose(field.pressure, wanted, rtol=1e-6)
    assert not field.is_net


@pytest.mark.fast
def test_a_map_without_a_field_refuses() -> None:
    held = random_map()
    found = Estimator(held).step(held.mean_strain, held.nominal_dynamic_pressure)
    with pytest.raises(InputError, match="holds no pressure field, expected one built with keep_field = true"):
        found.pressure()
    point = np.zeros((3, 3), dtype=np.float32)
    with pytest.raises(InputError, match="field_std must be at least 0"):
        replace(
            held,
            field_mean=point[0],
            field_modes=np.zeros((3, held.n_states), dtype=np.float32),
            field_std=-1.0 - point[0],
            point=point,
            triangle=np.array([[0, 1, 2]], dtype=np.int32),
        )
