"""Flow parameters that are known with a deviation sharpen the pressure on the surface."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from deflected_shape import NAME, flights, known_map, snapshots_of_grid

from builder.trial.bound import KNOWN, cramer_rao_bound
from strainfmu.errors import InputError
from strainfmu.estimator.estimate import Estimate, PressureField
from strainfmu.estimator.estimator import Estimator
from strainfmu.estimator.map.inverse_map import load_inverse_map, save_inverse_map
from strainfmu.estimator.map.nonlinear_map import ManifoldMap, ShapeField, with_known
from strainfmu.estimator.off_deadline import table_pressure

STD = 0.05


def held() -> tuple[ManifoldMap, ShapeField]:
    manifold = known_map(keep_field=True).manifold
    assert manifold is not None
    assert manifold.shape_field is not None
    return manifold, manifold.shape_field


def estimated(**known: Any) -> Estimate:
    _, strain, flow = flights()
    return Estimator(known_map(keep_field=True)).estimate(strain, **flow, q_source="independent", **known)


def fields(found: Estimate) -> list[PressureField]:
    return [found[row].pressure() for row in range(len(found))]


def deflection() -> np.ndarray:
    return flights()[0].condition[:, -1]


def test_the_cramer_rao_bound_needs_no_field() -> None:
    """The bound takes the parameters out of the map, and the field that holds derivatives by them."""
    conditions = flights()[0].conditions()
    with_field, without = (
        cramer_rao_bound(known_map(keep_field=keep), conditions, KNOWN) for keep in (True, False)
    )
    assert with_field is not None
    assert without is not None
    assert np.all(with_field > 0.0)
    np.testing.assert_array_equal(with_field, without)


def test_tables_at_a_known_value_pass_through_its_snapshots() -> None:
    (manifold, field), snapshots = held(), snapshots_of_grid()
    for row in (0, 40, 140, 330):
        condition, true = snapshots.conditions()[row], snapshots.pressure[row]
        incidence, roll = condition.total_incidence, condition.leeward_roll_angle
        state = np.array([condition.mach_number, incidence * np.cos(roll), incidence * np.sin(roll), 0.0])
        state[3] = np.log(condition.ambient_pressure)
        at = with_known(manifold, np.array(condition.parameters), np.zeros(1)).shape_field
        assert at is not None
        off, of_mean = (np.abs(table_pressure(manifold, one, state).value - true).max() for one in (at, field))
        assert off < 5e-3 * true.max()
        if condition.parameters[0] != 0.0:
            assert of_mean > 10.0 * off


def test_a_known_deflection_sharpens_the_pressure_of_every_sample() -> None:
    true = flights()[0].pressure
    known = fields(estimated(parameters={NAME: deflection()}, parameters_std={NAME: STD}))
    blind = fields(estimated())
    rms, size = [], []
    for found in (known, blind):
        error, std = np.array([one.pressure for one in found]) - true, np.array([one.std for one in found])
        assert np.mean(np.abs(error) <= 3.0 * std) >= 0.99
        rms.append(np.sqrt(np.mean(error**2)))
        size.append(np.sqrt(np.mean(std**2)))
    assert rms[0] < 0.65 * rms[1]
    assert size[0] < 0.4 * size[1]


def test_a_value_of_a_boundless_deviation_changes_nothing() -> None:
    boundless = fields(estimated(parameters={NAME: deflection()}, parameters_std={NAME: 1e9}))
    for one, other in zip(boundless, fields(estimated()), strict=True):
        np.testing.assert_allclose(one.pressure, other.pressure, rtol=1e-5)
        np.testing.assert_allclose(one.std, other.std, rtol=1e-4)


def test_a_filtered_sample_and_one_of_a_file_hold_it_too(tmp_path: Path) -> None:
    save_inverse_map(known_map(keep_field=True), tmp_path / "map.h5")
    (_, strain, flow), whole = flights(), estimated(parameters={NAME: deflection()}, parameters_std={NAME: STD})
    expected = whole[3].pressure()
    found = Estimator(load_inverse_map(tmp_path / "map.h5")).filter(1e-9)
    one = found.track(
        np.tile(strain[3], (4, 1)),
        flow["dynamic_pressure"][3],
        mach_number=flow["mach_number"][3],
        q_source="independent",
        parameters={NAME: deflection()[3]},
        parameters_std={NAME: STD},
        time=np.arange(4.0),
    )[-1]
    np.testing.assert_allclose(one.pressure().pressure, expected.pressure, rtol=1e-4)
    np.testing.assert_allclose(one.pressure().std, expected.std, rtol=1e-3)
    np.testing.assert_allclose(one.pressure(with_std=False).pressure, one.pressure().pressure, rtol=1e-9)


def test_parameters_of_other_tables_are_refused() -> None:
    manifold, field = held()
    assert field.parameters is not None
    with pytest.raises(InputError, match="expected the parameters of the tables of strain"):
        replace(manifold, parameters=None)
    with pytest.raises(InputError, match=r"shape_field: parameters: .* has shape .*, must be"):
        replace(field, parameters=replace(field.parameters, slope=field.parameters.slope[:, :, :1]))
