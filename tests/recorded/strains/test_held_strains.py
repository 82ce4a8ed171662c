"""A recorder that holds its last values is noted; a filter takes gaps of any length."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from flight_fmu import random_flight, whole_map
from recorded_case import NAMES, samples, write_csv
from synthetic_vehicle import SyntheticFiles

from strainfmu.estimator.map.inverse_map import save_inverse_map
from strainfmu.recorded.run import estimate_file
from strainfmu.recorded.strains.held_strains import NOTED, HeldStrains

pytestmark = pytest.mark.fast


@pytest.mark.parametrize("held", [0, NOTED - 1, NOTED, 30])
def test_samples_that_repeat_are_noted(held: int, synthetic: SyntheticFiles, tmp_path: Path) -> None:
    time, strain, pressure = samples(60)
    strain[:, 1] = np.nan  # a lost gauge repeats nothing
    strain[20 : 20 + held] = strain[20]
    data = write_csv(tmp_path / "d.csv", ["time", *NAMES, "dynamic_pressure"], time, strain, pressure)
    found = [
        one for one in estimate_file(synthetic.map_1, data, tmp_path / "o.csv").notes if "no gauge changes" in one
    ]
    if held < NOTED:
        assert found == []
    else:
        assert found[0].startswith(f"{data}: no gauge changes in {held} samples from 0.02 s on, to the last bit: ")


def test_a_row_goes_on_over_blocks_and_lost_samples_are_none(tmp_path: Path) -> None:
    held = HeldStrains(tmp_path)
    for first in range(0, 40, 4):
        held.add(np.arange(first, first + 4.0), np.ones((4, 3)))
    held.add(np.arange(40.0, 100.0), np.full((60, 3), np.nan))
    (note,) = held.notes()
    assert "in 40 samples from 0 s on" in note


@pytest.mark.parametrize("smooth", [False, True])
def test_a_gap_of_weeks_begins_again(tmp_path: Path, smooth: bool) -> None:
    """After it the filter knows what one sample says."""
    held = whole_map()
    save_inverse_map(held, tmp_path / "map.h5")
    flight = random_flight(held, 6, seed=4)
    time = np.array([0.0, 0.01, 0.02, 5e6, 5e6 + 0.01, 5e6 + 0.02])
    flow = np.array([list(one.flow.values()) for one in flight])
    strain = np.array([one.strain for one in flight])
    headings = ["time", *held.gauge_names, *flight[0].flow]
    tables = {}
    for name, rows in (("whole", slice(0, 6)), ("after", slice(3, 6))):
        data = write_csv(tmp_path / f"{name}.csv", headings, time[rows], strain[rows], flow[rows])
        out = tmp_path / f"{name}_loads.csv"
        estimate_file(tmp_path / "map.h5", data, out, time_constant=1.0, smooth=smooth)
        tables[name] = np.genfromtxt(out, delimiter=",", names=True, deletechars="", replace_space=" ")
    # Not to the bit: the iterations start from the last state in one of the two, from a search in the other.
    whole, after = (tables[name][-3:] for name in ("whole", "after"))
    np.testing.assert_allclose(whole["sigma.C_N [1]"], after["sigma.C_N [1]"], rtol=1e-2)
    assert np.all(np.abs(whole["C_N [1]"] - after["C_N [1]"]) < 0.01 * after["sigma.C_N [1]"])
