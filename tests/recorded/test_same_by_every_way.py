"""One recording of everything that a map knows of: columns of map, FMU and filter, and its zero offsets.

That map and FMU give the same numbers is held by tests/golden.
"""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from flight_fmu import whole_map
from flight_maps import exact_response
from other_load_maps import with_further_tables, with_own_further
from parameter_maps import PARAMETERS, with_parameter_tables, with_parameters
from recorded_case import read_csv, write_csv
from scaled_maps import NOMINAL, scaled_map
from sensor_maps import ROWS, with_sensors
from thermal_maps import REFERENCE, with_temperature

from strainfmu.estimator.air_inputs import AIR_DATA_NAMES
from strainfmu.estimator.estimator import Estimator
from strainfmu.estimator.map.inverse_map import (
    InverseMap,
    load_inverse_map,
    save_inverse_map,
)
from strainfmu.estimator.map.validity import flow_parameters
from strainfmu.fmu.export import export_estimator
from strainfmu.interface.sensor_variables import identifier
from strainfmu.recorded.run import estimate_file
from strainfmu.recorded.tare_window import tare

pytestmark = pytest.mark.fast
K, BLANK = 22, 8
OF_NONLINEAR = ("mach_number_std", "static_pressure_std", "fin_deg_std", "power_std")


def linear_map() -> InverseMap:
    return with_sensors(with_parameters(with_own_further(with_temperature(scaled_map(2, seed=4, n=40)))))


def nonlinear_map() -> InverseMap:
    held = whole_map()
    assert held.manifold is not None
    held = replace(held, manifold=replace(held.manifold, gauge_covariance=held.gauge_covariance))
    return with_sensors(with_parameter_tables(with_further_tables(with_temperature(held))))


def with_gaps(values: np.ndarray | float, *rows: int) -> np.ndarray:
    found = np.array(np.broadcast_to(values, K), dtype=float)
    found[list(rows)] = np.nan
    return found


def recording(held: InverseMap) -> dict[str, np.ndarray]:
    """Columns of a recording with a gap in each, one sample without any gauge, and values that cannot be."""
    random, n, k = np.random.default_rng(1), held.n_gauges, np.arange(K)
    if held.manifold is None:
        rows = held.mean_strain + held.noise_std * random.normal(size=(K, n))
    else:
        rows = np.array([exact_response(6.0 + 0.002 * i, 0.03 + 0.001 * i, 0.01, 5500.0)[:n] for i in k])
        rows += 2e-7 * random.normal(size=rows.shape)
    thrust = with_gaps(20.0 * k, 4)
    readings = rows * held.sensors.scale + np.nan_to_num(thrust)[:, None] * held.sensors.thrust_response
    first, mach = held.n_strain_gauges, 6.0 + 0.002 * k
    readings[5, 3] = readings[9, first + 2] = readings[BLANK] = np.nan
    readings[7, 2], readings[10, 1] = 1e-3, 0.5
    pressure = NOMINAL if held.manifold is None else 0.7 * 5500.0 * mach**2
    flow = {
        "dynamic_pressure": with_gaps(pressure, 11, 12, 16),
        "dynamic_pressure_std": with_gaps(0.02 * pressure, 13),
        "mach_number": with_gaps(mach, 12, 14, 16),
        "mach_number_std": with_gaps(0.1, 15),
        "static_pressure": with_gaps(5500.0, 11, 16, 17, 19),
        "static_pressure_std": with_gaps(200.0, 18),
        "altitude": with_gaps(19970.0, 16, 17),
        "fin_deg": with_gaps(1.5, 3),
        "power": with_gaps(0.2, 5),
        "cant_deg": with_gaps(2.0),
        "fin_deg_std": with_gaps(0.1, 6),
        "power_std": with_gaps(0.05, 7),
    }
    flow["dynamic_pressure"][20], flow["static_pressure"][20], flow["mach_number"][21] = 0.0, 0.0, 0.0
    flow["fin_deg"][4], flow["altitude"][19] = 6.0, -5000.0
    warm = REFERENCE + 30.0 * random.normal(size=(K, 4))
    warm[2, 0] = warm[3] = np.nan
    return {
        "time": 0.01 * k,
        **{f"strain[{i + 1}]": readings[:, i] for i in range(first)},
        **{identifier(name): readings[:, first + j] for j, name in enumerate(ROWS)},
        "thrust": thrust,
        **flow,
        **{f"temperature[{i + 1}]": warm[:, i] for i in range(4)},
    }


@pytest.fixture(scope="module", params=["linear", "nonlinear"])
def case(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, InverseMap]:
    """A folder with map and recording; and the map."""
    folder = tmp_path_factory.mktemp(request.param)
    held = linear_map() if request.param == "linear" else nonlinear_map()
    save_inverse_map(held, folder / "map.h5")
    data = recording(held)
    write_csv(folder / "d.csv", list(data), *data.values())
    return folder, held


def test_a_recording_for_the_nonlinear_estimator_suits_the_linear_one(case: tuple[Path, InverseMap]) -> None:
    """It does not take deviations of M, p_inf and parameters: said, not refused."""
    folder, held = case
    summary = estimate_file(folder / "map.h5", folder / "d.csv", folder / "o.h5")
    assert set(summary.unused) == ({*OF_NONLINEAR, "static_pressure"} if held.manifold is None else set())


def test_fmu_and_filter_have_the_columns_of_their_map(case: tuple[Path, InverseMap]) -> None:
    folder, held = case
    export_estimator(folder / "map.h5", folder / "e.fmu")
    by_map, by_fmu, by_filter = (
        estimated_columns(folder, source, time_constant)
        for source, time_constant in (("map.h5", None), ("e.fmu", None), ("map.h5", 0.01))
    )
    assert by_map == by_fmu == by_filter
    assert sum(name.startswith(("section.", "sigma.section.")) for name in by_map) > 0
    assert sum("air_data." in name for name in by_map) == (0 if held.manifold is None else 3 * len(AIR_DATA_NAMES))


def estimated_columns(folder: Path, source: str, time_constant: float | None) -> list[str]:
    estimate_file(folder / source, folder / "d.csv", folder / "o.csv", filter_seconds=time_constant)
    return list(read_csv(folder / "o.csv"))


def test_a_map_on_file_keeps_the_order_of_its_parameters(case: tuple[Path, InverseMap]) -> None:
    """It is that of the powers in the tables; the names of these are in no alphabetical one."""
    folder, held = case
    assert flow_parameters(held).names == (*PARAMETERS,) != (*sorted(PARAMETERS),)
    assert flow_parameters(load_inverse_map(folder / "map.h5")).names == (*PARAMETERS,)


def test_linear_filter_takes_parameters() -> None:
    held = with_parameters(scaled_map(2, seed=4))
    found, m = Estimator(held).filter(1.0), held.mean_strain
    health = [
        found.track(m, NOMINAL, time=0.1 * k, parameters={"fin_deg": value}).health
        for k, value in enumerate((0.0, 9.0))
    ]
    assert [one.name for one in health] == ["OK", "OUTSIDE"]


@pytest.mark.parametrize("by_channels", [False, True])
def test_zeros_of_a_recording_that_can_be_estimated(
    case: tuple[Path, InverseMap], tmp_path: Path, by_channels: bool
) -> None:
    _, held = case
    n, random = held.n_strain_gauges, np.random.default_rng(2)
    strain = 1e-6 * np.arange(n) + 1e-8 * random.normal(size=(100, n))
    data = {name: np.resize(values, 100) for name, values in recording(held).items()}
    data |= {f"strain[{i + 1}]": strain[:, i] for i in range(n)}
    data |= {"time": 0.01 * np.arange(100), "dynamic_pressure": np.zeros(100)}
    if held.manifold is None:
        data = {name: values for name, values in data.items() if name not in OF_NONLINEAR}
    write_csv(tmp_path / "d.csv", list(data), *data.values())
    entries = [
        f"[[channel]]\nname = 'strain[{i + 1}]'\ngauge = '{name}'\nunit = 'm/m'\n"
        for i, name in enumerate(held.gauge_names[:n])
    ]
    entries += ["[[flow]]\nname = 'fin_deg'\nquantity = 'parameter.fin_deg'\n"]
    entries += ["[[flow]]\nname = 'temperature[1]'\nquantity = 'temperature[1]'\nunit = 'K'\n"]
    (tmp_path / "channels.toml").write_text("\n".join(entries))
    channels = tmp_path / "channels.toml" if by_channels else None
    save_inverse_map(held, tmp_path / "tare.h5")
    output = tmp_path / "zeros.toml"
    found = tare(tmp_path / "tare.h5", tmp_path / "d.csv", (0.0, 0.99), output, channels=channels, accept=True)
    np.testing.assert_allclose(found.zeros.value, strain.mean(axis=0), rtol=0.0, atol=1e-14)
