"""Twelve recordings of one flight in the formats and units of other programs: the same estimates."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from recorded_case import NAMES, read_csv, write_csv
from recordings import RECORDINGS, flown
from synthetic_vehicle import SyntheticFiles

from strainfmu.estimator.map.inverse_map import COEFFICIENT_NAMES
from strainfmu.recorded.run import estimate_file

pytestmark = pytest.mark.fast

Run = Callable[..., tuple[int, str, str]]


@pytest.mark.parametrize("name", RECORDINGS)
def test_recordings_give_equal_estimates(name: str, synthetic: SyntheticFiles, tmp_path: Path, run: Run) -> None:
    library = {"tdms": "nptdms", "parquet": "pyarrow", "mf4": "asammdf", "csv": "pandas", "mat": "scipy"}
    pytest.importorskip(library.get(name.partition("_")[0], "h5py"))
    time, strain, pressure = flown()
    plain = write_csv(tmp_path / "plain.csv", ["time", *NAMES, "dynamic_pressure"], time, strain, pressure)
    estimate_file(synthetic.map_1, plain, tmp_path / "plain_out.csv")
    data, channels = RECORDINGS[name](tmp_path)
    code, out, errors = run(
        *("estimate", synthetic.map_1, data, "-o", tmp_path / "o.csv", "--channels", channels),
        *("--columns", "all"),
    )
    assert (code, errors) == (0, ""), errors
    assert "left out" not in out
    found, expected = read_csv(tmp_path / "o.csv"), read_csv(tmp_path / "plain_out.csv")
    np.testing.assert_allclose(found["time [s]"], expected["time [s]"], atol=2e-9)
    sigmas = () if name == "csv_mach" else tuple(f"sigma.{one}" for one in COEFFICIENT_NAMES)  # q is computed
    for coefficient in (*COEFFICIENT_NAMES, *sigmas):
        heading = f"{coefficient} [1]"
        np.testing.assert_allclose(found[heading], expected[heading], rtol=1e-7, atol=1e-9, err_msg=coefficient)
