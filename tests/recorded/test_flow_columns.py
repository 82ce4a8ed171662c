"""Columns of the flow: deviation of the dynamic pressure, Mach number, altitude, in files of every form."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import h5py
import numpy as np
import pytest
from recorded_case import NAMES, read_csv, samples, write_flight
from synthetic_vehicle import N_GAUGES, SyntheticFiles, synthetic_inverse_map

from strainfmu.cosim.estimators.fmu_step import FmuStep
from strainfmu.errors import InputError
from strainfmu.estimator.estimator import Estimator
from strainfmu.estimator.health import HealthState
from strainfmu.estimator.map.inverse_map import save_inverse_map
from strainfmu.recorded.names import Wanted
from strainfmu.recorded.run import estimate_file
from strainfmu.recorded.samples import open_recording

pytestmark = pytest.mark.fast

Run = Callable[..., tuple[int, str, str]]
WANTED = Wanted(gauge_names=tuple(NAMES))


@pytest.mark.parametrize("kind", ["map_1", "estimator_1"])
def test_the_deviation_of_the_dynamic_pressure_widens_sigma(
    kind: str, synthetic: SyntheticFiles, tmp_path: Path
) -> None:
    _, strain, pressure = samples(20)
    std = np.linspace(0.0, 9e3, 20)
    data = write_flight(tmp_path / "d.csv", **{"nav.dynamic_pressure_std [kPa]": 1e-3 * std})
    summary = estimate_file(getattr(synthetic, kind), data, tmp_path / "o.csv")
    found = read_csv(tmp_path / "o.csv")
    expected = Estimator(synthetic_inverse_map(1)).estimate(strain, pressure, dynamic_pressure_std=std)
    np.testing.assert_allclose(found["sigma.C_N [1]"], expected.coefficients_std[:, 1], rtol=1e-9)
    np.testing.assert_allclose(found["dynamic_pressure_std [Pa]"], std, atol=1e-9)
    assert summary.unused == ()
    assert summary.notes == []


def test_navigation_decides_on_the_envelope(synthetic: SyntheticFiles, tmp_path: Path, run: Run) -> None:
    """Beyond the Mach numbers of the map, beyond its altitudes, unlike the dynamic pressure; not where unknown."""
    held = replace(
        synthetic_inverse_map(1),
        mach_number_range=np.array([4.0, 7.0]),
        altitude_range=np.array([15e3, 30e3]),
        dynamic_pressure_range=np.array([5e4, 2e5]),
    )
    save_inverse_map(held, tmp_path / "map.h5")
    _, strain, pressure = samples(20)
    altitude = np.full(20, 20e3)
    mach = np.sqrt(pressure / (0.7 * 5474.9))
    mach[3], mach[4], mach[5], altitude[6] = 8.0, np.nan, 6.5, 40e3
    more = {"mach_number": mach, "altitude [km]": 1e-3 * altitude}
    data = write_flight(tmp_path / "d.csv", **more)
    found = Estimator(held).estimate(strain, pressure, mach_number=mach, altitude=altitude)
    assert np.flatnonzero(found.health == HealthState.OUTSIDE).tolist() == [3, 5, 6]
    code, out, errors = run("estimate", tmp_path / "map.h5", data, "-o", tmp_path / "o.csv", "--columns", "all")
    assert (code, errors) == (0, "")
    np.testing.assert_array_equal(read_csv(tmp_path / "o.csv")["health.state [1]"], found.health)
    np.testing.assert_allclose(read_csv(tmp_path / "o.csv")["altitude [m]"], altitude)
    assert "OUTSIDE: 3 of 20 samples (15 %)" in out
    assert "by the estimated coefficients in 0, by the flow alone in 3" in out


def test_coefficients_beyond_the_envelope_are_told_apart(
    synthetic: SyntheticFiles, tmp_path: Path, run: Run
) -> None:
    _, strain, pressure = samples(20)
    free = Estimator(synthetic_inverse_map(1)).estimate(strain, pressure)
    direction = np.array([[0.0, 1.0, 0.0, 0.0, 0.0]])
    beyond = free.C_N - 40.0 * free.sigma.C_N
    limit = np.sort(beyond)[-5:-3].mean(keepdims=True)
    held = replace(synthetic_inverse_map(1), envelope_direction=direction, envelope_limit=limit)
    held = replace(held, envelope_score_limit=40.0)
    save_inverse_map(held, tmp_path / "map.h5")
    data = write_flight(tmp_path / "d.csv")
    _, out, _ = run("estimate", tmp_path / "map.h5", data, "-o", tmp_path / "o.csv", "--columns", "all")
    assert "OUTSIDE: 4 of 20 samples (20 %)" in out
    assert "by the estimated coefficients in 4, by the flow alone in 0" in out
    found = read_csv(tmp_path / "o.csv")
    score, limits = found["health.envelope_score [1]"], found["health.envelope_score_limit [1]"]
    np.testing.assert_array_equal(score > limits, found["health.state [1]"] == HealthState.OUTSIDE)


def test_what_the_fmu_does_not_take_is_said(synthetic: SyntheticFiles, tmp_path: Path) -> None:
    summary = estimate_file(
        synthetic.estimator_1, write_flight(tmp_path / "d.csv", mach_number=6.0), tmp_path / "o.csv"
    )
    with FmuStep(synthetic.estimator_1, ("mach_number",)) as step:
        taken = bool(step.other_inputs)
    line = f"{tmp_path / 'd.csv'}: mach_number: written but not used, {synthetic.estimator_1} does not take them"
    notes = [one for one in summary.notes if "q_source" not in one]
    assert notes == ([] if taken else [line])


def test_mach_number_and_altitude_are_read_in_their_units(tmp_path: Path) -> None:
    more = {"plant.mach_number": np.linspace(5.0, 7.0, 20), "altitude [km]": 20.0}
    data = write_flight(tmp_path / "d.csv", **more)
    with open_recording(data, WANTED) as opened:
        (block,) = opened.blocks
        assert opened.selection.stated == ("mach_number", "altitude")
    np.testing.assert_allclose(block.flow["mach_number"], more["plant.mach_number"])
    np.testing.assert_allclose(block.flow["altitude"], 20e3)
    time, strain, pressure = samples(5)
    with h5py.File(tmp_path / "d.h5", "w") as file:
        file["time"], file["strain"], file["dynamic_pressure"] = time, strain, pressure
        file["mach_number"], file["altitude"], file["dynamic_pressure_std"] = 6.0, np.full(5, 65617.0), 900.0
        file["altitude"].attrs["unit"] = "ft"
    with open_recording(tmp_path / "d.h5", WANTED) as opened:
        (block,) = opened.blocks
    found = {name: values[0] for name, values in block.flow.items() if name != "dynamic_pressure"}
    assert found == {"mach_number": 6.0, "altitude": pytest.approx(20e3, rel=1e-4), "dynamic_pressure_std": 900.0}


def test_an_empty_cell_is_a_quantity_that_is_not_known(tmp_path: Path) -> None:
    rows = "".join(f"{k}{',1e-5' * N_GAUGES},9e4,{mach}\n" for k, mach in enumerate(("", "6")))
    path = tmp_path / "d.csv"
    path.write_text(f"time,{','.join(NAMES)},dynamic_pressure,mach_number\n{rows}")
    with open_recording(path, WANTED) as opened:
        (block,) = opened.blocks
    np.testing.assert_array_equal(block.flow["mach_number"], [np.nan, 6.0])


@pytest.mark.parametrize(
    ("columns", "line"),
    [
        ({"dynamic_pressure_std": -1.0}, "column 'dynamic_pressure_std', line 2: expected at least 0, got -1"),
        ({"altitude [mi]": 1.0}, "column 'altitude [mi]': unit: expected one of m, km, ft, got 'mi'"),
        ({"mach_number [m/s]": 1.0}, "unit: expected one of 1, -, got 'm/s'"),
        ({"a.mach_number": 1.0, "b.mach_number": 1.0}, "expected one column for mach_number, got 2"),
        (
            {"altitude": 2e4, "altitude [km]": 20.0},
            "expected one column for altitude, got 2: 'altitude' and 'altitude [km]'",
        ),
    ],
)
def test_wrong_columns_get_one_line(columns: dict[str, float], line: str, tmp_path: Path) -> None:
    data = write_flight(tmp_path / "d.csv", **columns)
    with pytest.raises(InputError) as error, open_recording(data, WANTED) as opened:
        list(opened.blocks)
    assert line in str(error.value)


def test_the_data_are_not_overwritten(synthetic: SyntheticFiles, tmp_path: Path, run: Run) -> None:
    data = write_flight(tmp_path / "d.csv")
    before = data.read_bytes()
    code, _, errors = run("estimate", synthetic.map_1, data, "-o", data)
    assert (code, errors) == (2, f"strainfmu: {data}: --output: expected another file than those that are read\n")
    assert data.read_bytes() == before
