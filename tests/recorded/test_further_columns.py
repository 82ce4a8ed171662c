"""Rolling moment and section loads as columns of the estimates of recorded data."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from flight_fmu import random_flight, whole_map
from other_load_maps import with_further, with_further_tables
from recorded_case import read_csv, samples, write_csv, write_flight
from scaled_maps import NOMINAL, scaled_map
from synthetic_vehicle import synthetic_inverse_map

from strainfmu.estimator.estimator import Estimator
from strainfmu.estimator.map.inverse_map import save_inverse_map
from strainfmu.fmu.export import ExportOptions, export_estimator
from strainfmu.recorded.run import estimate_file

pytestmark = pytest.mark.fast


def test_loads_beside_the_five_are_columns_with_deviations(tmp_path: Path) -> None:
    held = with_further(synthetic_inverse_map(1))
    save_inverse_map(held, tmp_path / "map.h5")
    _, strain, pressure = samples(20)
    estimate_file(tmp_path / "map.h5", write_flight(tmp_path / "d.csv"), tmp_path / "o.csv")
    found, expected = read_csv(tmp_path / "o.csv"), Estimator(held).estimate(strain, pressure)
    for name, values in {
        "M_R [1]": expected.M_R,
        "sigma.M_R [1]": expected.sigma.M_R,
        "rolling_moment [N m]": expected.rolling_moment,
        "section.axial[1] [N]": expected.section_loads.axial[:, 0],
        "section.torsion[1] [N m]": expected.section_loads.torsion[:, 0],
        "sigma.section.pitch[1] [N m]": expected.section_loads.std[:, 0, 3],
    }.items():
        np.testing.assert_allclose(found[name], values, rtol=1e-9, err_msg=name)


def test_an_fmu_has_the_columns_of_its_map(tmp_path: Path) -> None:
    held = with_further(scaled_map(1, 2))
    save_inverse_map(held, tmp_path / "map.h5")
    export_estimator(tmp_path / "map.h5", tmp_path / "e.fmu", ExportOptions())
    strain = held.mean_strain + 1e-5 * np.random.default_rng(3).standard_normal((8, held.n_gauges))
    data = write_csv(tmp_path / "d.csv", ["time", *held.gauge_names], 1e-3 * np.arange(8), strain)
    found = {}
    for source in ("map.h5", "e.fmu"):
        estimate_file(tmp_path / source, data, tmp_path / "o.csv", NOMINAL)
        found[source] = read_csv(tmp_path / "o.csv")
    of_map, of_fmu = found.values()
    assert "sigma.section.yaw[1] [N m]" in of_map
    assert list(of_fmu) == list(of_map)
    for name, values in of_map.items():
        if "M_R" in name or "rolling" in name or "section" in name:
            np.testing.assert_allclose(of_fmu[name], values, rtol=1e-9, err_msg=name)


def test_the_nonlinear_estimator_has_those_of_its_fmu_and_of_its_filter(tmp_path: Path) -> None:
    held = with_further_tables(whole_map())
    save_inverse_map(held, tmp_path / "map.h5")
    export_estimator(tmp_path / "map.h5", tmp_path / "e.fmu", ExportOptions())
    flight = random_flight(held, 8, seed=2)
    strain, q = np.array([one.strain for one in flight]), flight[0].flow["dynamic_pressure"]
    data = write_csv(tmp_path / "d.csv", ["time", *held.gauge_names], 1e-2 * np.arange(8), strain)
    found = {}
    for source, filtered in (("map.h5", None), ("e.fmu", None), ("map.h5", 1.0)):
        estimate_file(tmp_path / source, data, tmp_path / "o.csv", q, time_constant=filtered)
        found[source, filtered is None] = read_csv(tmp_path / "o.csv")
    of_map, of_fmu = found["map.h5", True], found["e.fmu", True]
    assert set(of_fmu) == set(of_map)
    assert list(of_map) == list(found["map.h5", False])
    further = [name for name in of_map if "M_R" in name or "rolling" in name or "section" in name]
    assert len(further) == 2 + 2 + 12 * 3
    for name in further:
        np.testing.assert_allclose(of_fmu[name], of_map[name], rtol=1e-7, atol=1e-9, err_msg=name)
    last = "sigma.section.normal[2] [N]"
    assert 0.0 < found["map.h5", False][last][-1] < of_map[last][-1]


def test_a_map_without_them_has_no_such_columns(tmp_path: Path) -> None:
    save_inverse_map(synthetic_inverse_map(1), tmp_path / "map.h5")
    estimate_file(tmp_path / "map.h5", write_flight(tmp_path / "d.csv"), tmp_path / "o.csv")
    assert not any("M_R" in name or "section" in name for name in read_csv(tmp_path / "o.csv"))
