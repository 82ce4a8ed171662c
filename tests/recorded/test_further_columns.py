"""Rolling moment and section loads as columns of the estimates of recorded data."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from other_load_maps import with_further
from recorded_case import read_csv, samples, write_flight
from synthetic_vehicle import synthetic_inverse_map

from strainfmu.estimator.estimator import Estimator
from strainfmu.estimator.map.inverse_map import save_inverse_map
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


def test_a_map_without_them_has_no_such_columns(tmp_path: Path) -> None:
    save_inverse_map(synthetic_inverse_map(1), tmp_path / "map.h5")
    estimate_file(tmp_path / "map.h5", write_flight(tmp_path / "d.csv"), tmp_path / "o.csv")
    assert not any("M_R" in name or "section" in name for name in read_csv(tmp_path / "o.csv"))
