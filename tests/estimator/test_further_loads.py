"""Rolling moment and section loads: other loads that combine the five must be estimated as they are."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
from other_load_maps import COMBINATION, STATION, groups_at, with_further
from random_map import map_of, random_map, random_model
from scaled_maps import NOMINAL, scaled_map, whole_scaled_map

from strainfmu.errors import InputError
from strainfmu.estimator.estimator import Estimator
from strainfmu.estimator.map.inverse_map import (
    LOAD_NAMES,
    SCHEMA,
    SCHEMA_VERSION,
    InverseMap,
    load_inverse_map,
    save_inverse_map,
    with_gauge_covariance,
)
from strainfmu.estimator.other_loads import names_of
from strainfmu.estimator.settings import default_settings
from strainfmu.files import write_hdf5_atomically
from strainfmu.records import write_record

pytestmark = pytest.mark.fast


def readings(inverse_map: InverseMap, k: int = 9) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return strains, dynamic pressures, and masks of which every third loses gauges."""
    rng = np.random.default_rng(5)
    ratio = rng.uniform(0.3, 2.0, k)
    states = rng.standard_normal((k, inverse_map.n_states))
    strain = ratio[:, None] * (inverse_map.mean_strain + states @ inverse_map.state_operator.T)
    valid = np.ones((k, inverse_map.n_gauges), dtype=bool)
    valid[::3, [2, 5]] = False
    return strain, ratio * inverse_map.nominal_dynamic_pressure, valid


@pytest.mark.parametrize("kind", ["case 1", "case 2", "absolute"])
def test_combinations_of_the_five_loads_are_estimated_as_such(kind: str) -> None:
    """Values and deviations, with errors at the current strain, with q_inf's error, with gauges lost."""
    plain = (
        map_of(random_model(gamma=0.7, n_gauges=18)) if kind == "absolute" else whole_scaled_map(int(kind[-1]), 3)
    )
    found_map = with_further(plain)
    strain, q, valid = readings(plain)
    found = Estimator(found_map).estimate(strain, q, valid=valid)
    np.testing.assert_allclose(found.other_loads, found.loads @ COMBINATION.T, rtol=1e-9)
    expected = np.einsum("mi,kij,mj->km", COMBINATION, found.load_covariance, COMBINATION)
    np.testing.assert_allclose(found.other_loads_std**2, expected, rtol=1e-8)
    alone = Estimator(plain).estimate(strain, q, valid=valid)
    for name in ("loads", "loads_std", "coefficients_std", "chi_square", "health"):
        np.testing.assert_allclose(getattr(found, name), getattr(alone, name), rtol=1e-12)


@pytest.mark.parametrize("kind", ["case 1", "case 2", "absolute"])
def test_errors_of_zeros_reach_them(kind: str) -> None:
    plain = (
        map_of(random_model(gamma=0.7, n_gauges=18)) if kind == "absolute" else whole_scaled_map(int(kind[-1]), 3)
    )
    noisy = with_gauge_covariance(with_further(plain), plain.gauge_covariance + 4.0 * np.diag(plain.noise_std**2))
    strain, q, valid = readings(plain)
    found = Estimator(noisy).estimate(strain, q, valid=valid)
    expected = np.einsum("mi,kij,mj->km", COMBINATION, found.load_covariance, COMBINATION)
    np.testing.assert_allclose(found.other_loads_std**2, expected, rtol=1e-8)


def test_coefficients_carry_the_error_of_dynamic_pressure() -> None:
    """A further load that is the pitching moment has its coefficient and deviation, at other references too."""
    plain = whole_scaled_map(2, 4)
    rows = np.zeros((7, 5))
    rows[0, 3] = 1.0
    found_map = with_further(plain, rows)
    settings = replace(default_settings(found_map), reference_area=0.3, reference_length=1.7)
    strain, q, valid = readings(plain)
    found = Estimator(found_map, settings).estimate(strain, q, valid=valid)
    np.testing.assert_allclose(found.M_R, found.M_P, rtol=1e-10)
    np.testing.assert_allclose(found.sigma.M_R, found.sigma.M_P, rtol=1e-9)
    np.testing.assert_allclose(found.rolling_moment, found.pitching_moment, rtol=1e-10)
    # The other rows are known to be zero.
    np.testing.assert_array_equal(found.section_loads.loads, 0.0)
    np.testing.assert_array_equal(found.section_loads.std, 0.0)


def test_sections_by_name() -> None:
    found_map = with_further(scaled_map(1, 2))
    strain, q, _ = readings(found_map)
    series = Estimator(found_map).estimate(strain, q)
    sections, one = series.section_loads, series[4].section_loads
    assert (sections.loads.shape, one.loads.shape) == ((9, 1, 6), (1, 6))
    np.testing.assert_array_equal(sections.station, STATION)
    names = ("axial", "normal_shear", "side_shear", "pitch_bending", "yaw_bending", "torsion")
    for k, name in enumerate(names):
        np.testing.assert_array_equal(getattr(sections, name)[:, 0], series.other_loads[:, 1 + k])
        np.testing.assert_array_equal(getattr(one, name)[0], series.other_loads[4, 1 + k])
    np.testing.assert_array_equal(series[3:5].section_loads.loads, sections.loads[3:5])
    assert names_of(groups_at(STATION))[:3] == ("rolling_moment", "section.axial[1]", "section.normal[1]")


def test_without_other_loads_the_rolling_moment_is_known_to_be_zero() -> None:
    plain = scaled_map(1, 2)
    strain, q, valid = readings(plain)
    found = Estimator(plain).estimate(strain, q, valid=valid)
    np.testing.assert_array_equal(np.array([found.M_R, found.sigma.M_R, found.rolling_moment]), 0.0)
    assert found.section_loads.loads.shape == (9, 0, 6)
    unknown = Estimator(plain).estimate(strain[0], np.nan)
    assert np.isnan([unknown.M_R, unknown.sigma.M_R, unknown.rolling_moment]).all()
    absolute = Estimator(random_map())
    assert absolute.estimate(random_map().mean_strain, np.nan).rolling_moment == 0.0
    assert np.isnan(absolute.estimate(random_map().mean_strain, np.nan).M_R)


def test_map_file_holds_them(tmp_path: Path) -> None:
    found_map = with_further(whole_scaled_map(2, 6))
    save_inverse_map(found_map, tmp_path / "map.h5")
    again = load_inverse_map(tmp_path / "map.h5")
    for name in ("section_station", "load_per_state", "load_of_mean", "error_load", "fixed_load"):
        np.testing.assert_array_equal(getattr(again, name), getattr(found_map, name))


def test_map_with_a_group_of_other_loads_is_refused(tmp_path: Path) -> None:
    """The layout of an earlier state, without section_station beside the five loads."""
    found_map = with_further(scaled_map(1, 2))
    units: dict[str, str] = {}

    def fill(file: h5py.File) -> None:
        write_record(file, found_map, units)
        file.move("section_station", "further/section_station")

    write_hdf5_atomically(tmp_path / "map.h5", SCHEMA, SCHEMA_VERSION, fill)
    with pytest.raises(InputError, match=r"map.h5: damaged, entry 'section_station' is missing"):
        load_inverse_map(tmp_path / "map.h5")


def test_loads_have_names() -> None:
    with_sections, plain = with_further(scaled_map(1, 2)), scaled_map(1, 2)
    names = (*LOAD_NAMES, *names_of(with_sections.load_groups))
    assert names == (*LOAD_NAMES, *names_of(groups_at(STATION)))
    assert (plain.n_loads, with_sections.n_loads) == (5, 12)
    assert (plain.has_other_loads, with_sections.has_other_loads) == (False, True)
    moments = [name for name, one in zip(names, with_sections.is_moment, strict=True) if one]
    sections = [f"section.{name}[1]" for name in ("pitch", "yaw", "torsion")]
    assert moments == ["pitching_moment", "yawing_moment", "rolling_moment", *sections]


@pytest.mark.parametrize(
    ("changes", "fault"),
    [
        ({"section_station": np.array([1.0, 0.5])}, "section_station must hold rising numbers"),
        ({"section_station": np.array([0.5, np.nan])}, "section_station must hold rising numbers"),
        ({"section_station": np.array([0.5, 1.0])}, "load_of_mean has 12 loads, must be 18 for 2 sections"),
        ({"section_station": np.zeros(0)}, "load_of_mean has 12 loads, must be 5 or 6"),
        ({"load_of_mean": np.ones(5)}, "load_of_mean has 5 loads, must be 12 for 1 sections"),
        ({"load_of_mean": np.ones((2, 6))}, r"load_of_mean has shape \(2, 6\), must be \(12,\)"),
        ({"load_of_mean": np.full(12, np.nan)}, "load_of_mean holds values that are not finite"),
        ({"load_per_state": np.ones((5, 3))}, r"load_per_state has shape \(5, 3\), must be \(12, "),
        ({"error_load": np.ones((12, 2))}, r"error_load has shape \(12, 2\), must be \(12, "),
    ],
)
def test_what_does_not_fit_is_refused(changes: dict[str, Any], fault: str) -> None:
    good = with_further(scaled_map(1, 2))
    with pytest.raises(InputError, match=fault):
        replace(good, **changes)


def test_pressure_ratio_moves_them_as_it_moves_loads() -> None:
    """At another dynamic pressure weights change; the combination still holds."""
    found_map = with_further(whole_scaled_map(1, 7))
    strain, _, _ = readings(found_map)
    for ratio in (0.1, 3.0):
        found = Estimator(found_map).estimate(strain, ratio * NOMINAL)
        np.testing.assert_allclose(found.other_loads, found.loads @ COMBINATION.T, rtol=1e-9)
