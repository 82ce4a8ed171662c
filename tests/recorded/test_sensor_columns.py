"""``strainfmu estimate`` with auxiliary sensors: columns of every kind of file and unit, for maps and FMUs."""

from math import pi
from pathlib import Path

import h5py
import numpy as np
import pytest
from flight_fmu import N_D, random_flight, whole_map
from recorded_case import read_csv, suspect_names, write_csv
from scaled_maps import NOMINAL, scaled_map
from sensor_maps import LARGEST, ROWS, with_sensors

from strainfmu.errors import InputError
from strainfmu.estimator.estimate import Estimate
from strainfmu.estimator.estimator import Estimator
from strainfmu.estimator.map.inverse_map import COEFFICIENT_NAMES, InverseMap, save_inverse_map
from strainfmu.fmu.export import ExportOptions, export_estimator
from strainfmu.interface.sensor_variables import PREFIX, sensor_names
from strainfmu.recorded.run import estimate_file

pytestmark = pytest.mark.fast

K, N = 10, 20
N_S = len(ROWS)
COLUMNS = [name.removeprefix(PREFIX) for name in sensor_names(with_sensors(scaled_map(2, seed=4, n=N)))]
UNITS = {
    "port_0deg": ("kPa", 1e3),
    "imu_axial": ("g", 9.80665),
    "imu_pitch": ("deg/s2", pi / 180.0),
    "cell_axial": ("kN", 1e3),
    "cell_yaw": ("N m", 1.0),
    "displacement_0_2m_45deg": ("mm", 1e-3),
    "fibre_90deg_1": ("um/m", 1e-6),
}
THRUST = np.linspace(0.0, 900.0, K)


def plain_map() -> InverseMap:
    return scaled_map(2, seed=4, n=N)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    made = tmp_path_factory.mktemp("sensors")
    save_inverse_map(with_sensors(plain_map()), made / "map.h5")
    save_inverse_map(plain_map(), made / "plain.h5")
    export_estimator(made / "map.h5", made / "e.fmu")
    export_estimator(made / "map.h5", made / "python.fmu", ExportOptions(kind="python"))
    return made


def drawn() -> tuple[np.ndarray, np.ndarray]:
    """Rows of the map [m/m], and what gauges and sensors read of them; one sensor fails for a while."""
    held, random = with_sensors(plain_map()), np.random.default_rng(3)
    rows = held.mean_strain + held.noise_std * random.normal(size=(K, N))
    rows[3:6, N - N_S + 2] = np.nan
    rows[7, N - 1] = 2.0 * LARGEST
    return rows, rows * held.sensors.scale + THRUST[:, None] * held.sensors.thrust_response


def expected_of(rows: np.ndarray) -> Estimate:
    valid = np.isfinite(rows) & (np.abs(rows) <= LARGEST)
    return Estimator(plain_map()).estimate(rows, NOMINAL, valid=valid)


def check(output: Path, expected: Estimate, rtol: float = 1e-8) -> None:
    found = read_csv(output)
    for k, name in enumerate(COEFFICIENT_NAMES):
        np.testing.assert_allclose(found[f"{name} [1]"], expected.coefficients[:, k], rtol=rtol)
        np.testing.assert_allclose(found[f"sigma.{name} [1]"], expected.coefficients_std[:, k], rtol=rtol)
    np.testing.assert_array_equal(found["health.state [1]"], expected.health)
    np.testing.assert_array_equal(found["gauges_used [1]"], expected.valid.sum(axis=1))


def written(path: Path, readings: np.ndarray, lost: str | None = None, prefix: str = "") -> Path:
    """Write gauges in um/m, sensors in :data:`UNITS`, and thrust, without the column ``lost``."""
    n, headings = N - N_S, ["time", *(f"g{i} [um/m]" for i in range(N - N_S))]
    columns = [1e-3 * np.arange(K), *(1e6 * readings[:, :n].T)]
    for name, values in zip(COLUMNS, readings[:, n:].T, strict=True):
        unit, factor = UNITS.get(name, ("", 1.0))
        if name != lost:
            headings.append(f"{prefix}{name} [{unit}]" if unit else f"{prefix}{name}")
            columns.append(values / factor)
    return write_csv(path, [*headings, "thrust [kN]"], *columns, 1e-3 * THRUST)


@pytest.mark.parametrize(
    ("source", "prefix"), [("map.h5", ""), ("map.h5", "sensor."), ("e.fmu", "sensor."), ("python.fmu", "")]
)
def test_columns_in_units_of_their_own(folder: Path, tmp_path: Path, source: str, prefix: str) -> None:
    rows, readings = drawn()
    data = written(tmp_path / "d.csv", readings, prefix=prefix)
    summary = estimate_file(folder / source, data, tmp_path / "o.csv", NOMINAL)
    check(tmp_path / "o.csv", expected_of(rows))
    assert not summary.notes
    assert not summary.unused


OWN_NAME = "displacement_0.2m_45deg"
"""Name of a sensor in the map that no identifier can be."""


@pytest.mark.parametrize(("source", "prefix"), [("map.h5", ""), ("map.h5", "plant.sensor."), ("e.fmu", "sensor.")])
def test_a_sensor_by_its_own_name(folder: Path, tmp_path: Path, source: str, prefix: str) -> None:
    rows, readings = drawn()
    data = written(tmp_path / "d.csv", readings)
    text = data.read_text(encoding="utf-8")
    data.write_text(text.replace("displacement_0_2m_45deg", prefix + OWN_NAME), encoding="utf-8")
    assert not estimate_file(folder / source, data, tmp_path / "o.csv", NOMINAL).notes
    check(tmp_path / "o.csv", expected_of(rows))


def test_both_names_of_a_sensor_are_one_too_many(folder: Path, tmp_path: Path) -> None:
    _, readings = drawn()
    data = written(tmp_path / "d.csv", readings)
    text = data.read_text(encoding="utf-8").replace("port_0deg [kPa]", f"{OWN_NAME} [mm]")
    data.write_text(text, encoding="utf-8")
    with pytest.raises(InputError, match=r"expected one column for displacement_0_2m_45deg, got 2"):
        estimate_file(folder / "map.h5", data, tmp_path / "o.csv", NOMINAL)


@pytest.mark.parametrize(("source", "lost"), [*(("map.h5", name) for name in COLUMNS), ("e.fmu", COLUMNS[0])])
def test_a_sensor_without_a_column_is_left_out(folder: Path, tmp_path: Path, source: str, lost: str) -> None:
    rows, readings = drawn()
    rows[:, N - N_S + COLUMNS.index(lost)] = np.nan
    summary = estimate_file(
        folder / source, written(tmp_path / "d.csv", readings, lost), tmp_path / "o.csv", NOMINAL
    )
    check(tmp_path / "o.csv", expected_of(rows))
    assert f"no column for {lost}: sensors are left out" in summary.notes[0]


def test_suspects_and_residuals_have_names(folder: Path, tmp_path: Path) -> None:
    rows, _ = drawn()
    held = with_sensors(plain_map())
    rows[:] = held.mean_strain
    rows[5, N - N_S + 1] += 4e-4
    data = written(tmp_path / "d.csv", rows * held.sensors.scale + THRUST[:, None] * held.sensors.thrust_response)
    summary = estimate_file(folder / "map.h5", data, tmp_path / "o.csv", NOMINAL, residuals=True)
    found = read_csv(tmp_path / "o.csv")
    assert suspect_names(tmp_path / "o.csv")[5] == "port_180deg"
    assert [name for name in found if name.startswith("residual.")] == [
        f"residual.{name} [1]" for name in held.gauge_names
    ]
    assert summary.blamed
    estimate_file(folder / "e.fmu", data, tmp_path / "f.csv", NOMINAL)
    assert suspect_names(tmp_path / "f.csv")[5] == "port_180deg"


def test_filter_takes_them_as_rows(folder: Path, tmp_path: Path) -> None:
    """The same rows as those of a map of strain gauges alone: the same filtered and smoothed estimates."""
    rows, readings = drawn()
    usable = np.where(np.abs(rows) <= LARGEST, rows, np.nan)
    plain = write_csv(tmp_path / "p.csv", ["time", *plain_map().gauge_names], 1e-3 * np.arange(K), usable)
    data = written(tmp_path / "d.csv", readings)
    options = {"filter_seconds": 0.01, "smooth": True}
    estimate_file(folder / "map.h5", data, tmp_path / "o.csv", NOMINAL, **options)
    estimate_file(folder / "plain.h5", plain, tmp_path / "q.csv", NOMINAL, **options)
    found, expected = read_csv(tmp_path / "o.csv"), read_csv(tmp_path / "q.csv")
    for name, values in expected.items():
        np.testing.assert_allclose(found[name], values, rtol=1e-7, err_msg=name)


@pytest.mark.parametrize("filtered", [False, True])
def test_nonlinear_estimator_takes_them(tmp_path: Path, filtered: bool) -> None:
    """Recorded in units of their own, with thrust: the estimates of Python step by step."""
    held = with_sensors(whole_map())
    save_inverse_map(held, tmp_path / "map.h5")
    flown = random_flight(held, K, seed=6)
    rows = np.array([one.strain for one in flown])
    rows[3:6, N_D - N_S + 2] = np.nan
    readings = rows * held.sensors.scale + THRUST[:, None] * held.sensors.thrust_response
    first = N_D - N_S
    headings = ["time", *held.gauge_names[:first]]
    columns = [1e-3 * np.arange(K), *readings[:, :first].T]
    for name, values in zip(COLUMNS, readings[:, first:].T, strict=True):
        unit, factor = UNITS.get(name, ("", 1.0))
        headings.append(f"{name} [{unit}]" if unit else name)
        columns.append(values / factor)
    for name in ("mach_number", "dynamic_pressure"):
        headings.append(name)
        columns.append(np.array([one.flow[name] for one in flown]))
    data = write_csv(tmp_path / "d.csv", [*headings, "thrust [N]"], *columns, THRUST)
    estimate_file(tmp_path / "map.h5", data, tmp_path / "o.csv", filter_seconds=0.5 if filtered else None)
    estimator, found = Estimator(held).filter(0.5 if filtered else 0.0), read_csv(tmp_path / "o.csv")
    for k, (one, row) in enumerate(zip(flown, readings, strict=True)):
        known = {name: one.flow[name] for name in ("mach_number", "dynamic_pressure")}
        expected = estimator.track(row, time=1e-3 * k, thrust=THRUST[k], **known)
        for i, name in enumerate(COEFFICIENT_NAMES):
            size = expected.coefficients_std[i]
            assert found[f"{name} [1]"][k] == pytest.approx(expected.coefficients[i], abs=1e-6 * size)
            assert found[f"sigma.{name} [1]"][k] == pytest.approx(size, rel=1e-6)
        assert found["gauges_used [1]"][k] == (N_D - 1 if 3 <= k < 6 else N_D)


@pytest.mark.parametrize("own_name", [False, True])
def test_hdf5_arrays(folder: Path, tmp_path: Path, own_name: bool) -> None:
    rows, readings = drawn()
    with h5py.File(tmp_path / "d.h5", "w") as file:
        file["time"], file["strain"], file["thrust"] = 1e-3 * np.arange(K), readings[:, : N - N_S], THRUST
        for name, values in zip(COLUMNS, readings[:, N - N_S :].T, strict=True):
            unit, factor = UNITS.get(name, ("Pa", 1.0))
            if own_name and name == "displacement_0_2m_45deg":
                name = OWN_NAME
            file[name] = values / factor
            file[name].attrs["unit"] = unit
    estimate_file(folder / "map.h5", tmp_path / "d.h5", tmp_path / "o.csv", NOMINAL)
    check(tmp_path / "o.csv", expected_of(rows))
    with h5py.File(tmp_path / "d.h5", "a") as file:
        file["sensor.port_0deg"] = readings[:, N - N_S]
    with pytest.raises(InputError, match=r"one column for port_0deg, got 2: 'port_0deg' and 'sensor.port_0deg'"):
        estimate_file(folder / "map.h5", tmp_path / "d.h5", tmp_path / "o.csv", NOMINAL)


def test_channels_of_a_recorder(folder: Path, tmp_path: Path) -> None:
    """A sensor's own name needs no entry; another one, and thrust, have theirs."""
    rows, readings = drawn()
    data = written(tmp_path / "d.csv", readings)
    text = data.read_text(encoding="utf-8").replace("port_0deg [kPa]", "Kulite 7 [kPa]")
    data.write_text(text.replace("thrust [kN]", "F_T [kN]"), encoding="utf-8")
    entries = [f"[[channel]]\nname = 'g{i}'\ngauge = 'g{i}'\nunit = 'um/m'\n" for i in range(N - N_S)]
    text = data.read_text(encoding="utf-8").replace("displacement_0_2m_45deg", "Wire 1")
    data.write_text(text, encoding="utf-8")
    flow = [
        ("Kulite 7", "sensor.port_0deg", "kPa"),
        ("Wire 1", f"sensor.{OWN_NAME}", "mm"),
        ("F_T", "thrust", "kN"),
    ]
    entries += [f"[[flow]]\nname = '{a}'\nquantity = '{b}'\nunit = '{c}'\n" for a, b, c in flow]
    channels = tmp_path / "channels.toml"
    channels.write_text("\n".join(entries))
    estimate_file(folder / "map.h5", data, tmp_path / "o.csv", NOMINAL, channels=channels)
    check(tmp_path / "o.csv", expected_of(rows))
    channels.write_text(
        "\n".join([*entries[:-1], "[[flow]]\nname = 'F_T'\nquantity = 'sensor.gyro'\nunit = 'N'\n"])
    )
    with pytest.raises(InputError, match=r"expected a sensor of the map, port_0deg, .*, got 'gyro'"):
        estimate_file(folder / "map.h5", data, tmp_path / "o.csv", NOMINAL, channels=channels)


def test_a_unit_is_refused(folder: Path, tmp_path: Path) -> None:
    _, readings = drawn()
    data = written(tmp_path / "d.csv", readings)
    data.write_text(data.read_text(encoding="utf-8").replace("[kPa]", "[kN]"), encoding="utf-8")
    with pytest.raises(InputError, match=r"column 'port_0deg \[kN\]': unit: expected one of Pa"):
        estimate_file(folder / "map.h5", data, tmp_path / "o.csv", NOMINAL)


def test_without_thrust_it_is_none(folder: Path, tmp_path: Path) -> None:
    rows, readings = drawn()
    held = with_sensors(plain_map())
    data = written(tmp_path / "d.csv", readings - THRUST[:, None] * held.sensors.thrust_response)
    lines = [line.rpartition(",")[0] for line in data.read_text(encoding="utf-8").splitlines()]
    data.write_text("\n".join(lines) + "\n", encoding="utf-8")
    summary = estimate_file(folder / "map.h5", data, tmp_path / "o.csv", NOMINAL)
    check(tmp_path / "o.csv", expected_of(rows))
    assert "no column for thrust: sensors are left out, thrust is 0" in summary.notes[0]
