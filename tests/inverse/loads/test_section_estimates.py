"""Section loads of the shipped vehicle, estimated from strain at flights between the snapshots."""

from typing import Any

import numpy as np
import pytest

from builder.aero.load_groups import other_load_operator
from builder.campaign.snapshots import Snapshots
from builder.inverse.build import build_inverse_map, inverse_map_of, on_observable_states
from builder.inverse.problem import inverse_problem
from builder.structure.fourier.fourier_model import StructuralModel
from builder.vehicle.file import Vehicle
from strainfmu.errors import InputError
from strainfmu.estimator.estimator import Estimator

STATIONS = (0.6, 1.2, 1.75, 2.5, 3.6)


def with_sections(vehicle: Vehicle, **entry: Any) -> Vehicle:
    changed = vehicle.map.model_copy(update={"section_stations_m": STATIONS, **entry})
    return vehicle.model_copy(update={"map": changed})


@pytest.mark.parametrize(("case", "form"), [(1, "dynamic_pressure"), (2, "dynamic_pressure"), (2, "absolute")])
def test_section_loads_of_held_out_flights(
    case: int,
    form: str,
    vehicle: Vehicle,
    snapshots: Snapshots,
    held_out: Snapshots,
    structure: StructuralModel,
) -> None:
    """Within 3 sigma but for 1 %; shear and bending to 0.5 % of range rms at gauges; whole loads at the base."""
    changed = with_sections(vehicle, case=case, form=form)
    inverse_map = build_inverse_map(changed, snapshots, structure)
    station = vehicle.reference_quantities().moment_station
    operator = other_load_operator(structure.surface, changed.map, station)
    net = held_out.pressure - held_out.internal_pressure[:, None]
    strain = net @ structure.strain_operator(vehicle.gauges.layout).T
    strain = strain + inverse_map.noise_std * np.random.default_rng(2).standard_normal(strain.shape)
    q = np.array([condition.dynamic_pressure for condition in held_out.conditions()])
    found = Estimator(inverse_map).estimate(strain, q)
    truth = np.swapaxes((net @ operator.T)[:, 1:].reshape(-1, 6, 5), 1, 2)
    error = np.abs(found.section_loads.loads - truth)
    assert np.mean(error <= 3.0 * found.section_loads.std) >= 0.99
    shear_and_bending = slice(1, 5)
    rms = np.sqrt(np.mean(error[:, :, shear_and_bending] ** 2, axis=0))
    # No gauge is aft of 3.3 m: there the base is, the last station.
    limit = np.array([0.005, 0.005, 0.005, 0.005, 0.01])[:, None]
    assert np.all(rms <= limit * np.ptp(truth[:, :, shear_and_bending], axis=0))
    base = found.section_loads.loads[:, -1]
    np.testing.assert_allclose(base[:, :3], found.loads[:, :3], rtol=1e-7, atol=1e-4)
    arm = 3.6 - station
    np.testing.assert_allclose(base[:, 3], found.pitching_moment + arm * found.normal_force, rtol=1e-6, atol=1e-3)
    np.testing.assert_array_equal(found.section_loads.torsion, 0.0)


def test_loads_of_states_that_no_gauge_sees_count_at_any_dynamic_pressure(
    vehicle: Vehicle, snapshots: Snapshots, structure: StructuralModel
) -> None:
    """A map on its observable states gives the deviations of the map on all of them."""
    changed = with_sections(vehicle, case=2)
    problem = inverse_problem(changed, snapshots, structure)
    before = inverse_map_of(changed, snapshots, structure, problem, problem.solution)
    after = on_observable_states(before)
    assert before.state_operator.shape[1] > after.state_operator.shape[1] == 54
    for ratio in (0.5, 2.0):
        q = ratio * before.nominal_dynamic_pressure
        expected, found = (Estimator(one).estimate(ratio * one.mean_strain, q) for one in (before, after))
        np.testing.assert_allclose(found.loads_std, expected.loads_std, rtol=1e-9)
        np.testing.assert_allclose(found.other_loads_std, expected.other_loads_std, rtol=1e-9)


@pytest.mark.fast
def test_stations_are_checked(vehicle: Vehicle) -> None:
    entries = vehicle.map.model_dump() | {"section_stations_m": [1.0, 0.5]}
    with pytest.raises(ValueError, match="section_stations_m: expected rising numbers"):
        type(vehicle.map)(**entries)


def test_station_off_the_body(vehicle: Vehicle, snapshots: Snapshots, structure: StructuralModel) -> None:
    changed = with_sections(vehicle, section_stations_m=(0.5, 4.2))
    with pytest.raises(InputError, match=r"map.section_stations_m: expected 0 to 3.6 m, got 4.2"):
        build_inverse_map(changed, snapshots, structure)
