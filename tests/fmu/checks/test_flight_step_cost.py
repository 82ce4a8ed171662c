"""``strainfmu bench`` steps FMUs of the nonlinear estimator with their filter, too."""

from pathlib import Path

import pytest
from flight_fmu import whole_map

from strainfmu.estimator.map.inverse_map import save_inverse_map
from strainfmu.fmu.checks.step_cost import step_costs

pytestmark = pytest.mark.slow


def test_the_filter_stands_beside_single_samples(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("strainfmu.fmu.checks.step_cost.REPEATS", 3)
    save_inverse_map(whole_map(), tmp_path / "map.h5")
    host = [name for name in step_costs(tmp_path / "map.h5", lambda _: 1.0) if "C host" in name]
    filtered = [name for name in host if "a step with the filter" in name]
    assert len(filtered) == (3 if host else 0)  # both forms of the linear map in the file have one, too
    searched = [name for name in host if "search of the tables" in name]
    assert len(searched) == (1 if host else 0)  # and searches nothing
