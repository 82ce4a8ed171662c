"""``strainfmu estimate`` with temperatures: columns of every kind of file, for maps and FMUs."""

from pathlib import Path

import numpy as np
import pytest
from recorded_case import read_csv, write_csv
from scaled_maps import NOMINAL, scaled_map
from thermal_maps import REFERENCE, with_temperature

from strainfmu.errors import InputError
from strainfmu.estimator.estimate import Estimate
from strainfmu.estimator.estimator import Estimator
from strainfmu.estimator.map.inverse_map import COEFFICIENT_NAMES, InverseMap, save_inverse_map
from strainfmu.fmu.export import ExportOptions, export_estimator
from strainfmu.recorded.run import estimate_file
from strainfmu.recorded.summary import EstimationSummary

pytestmark = pytest.mark.fast

K, N_T = 12, 4


@pytest.fixture(scope="module")
def held() -> InverseMap:
    return with_temperature(scaled_map(2, seed=4))


@pytest.fixture(scope="module")
def source(held: InverseMap, tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("warm") / "map.h5"
    save_inverse_map(held, path)
    return path


def drawn(n: int) -> tuple[np.ndarray, np.ndarray]:
    """Strains about the mean of a map, and temperatures, with a sensor that fails."""
    random = np.random.default_rng(2)
    temperature = REFERENCE + 25.0 * random.normal(size=(K, N_T))
    temperature[5:8, 2] = np.nan
    return 1e-5 * random.normal(size=(K, n)), temperature


def expected_of(held: InverseMap, strain: np.ndarray, temperature: np.ndarray | None) -> Estimate:
    return Estimator(held).estimate(strain, NOMINAL, temperature=temperature)


def check(source: Path, data: Path, expected: Estimate, rtol: float = 1e-9) -> EstimationSummary:
    output = data.with_name("o.csv")
    summary = estimate_file(source, data, output, NOMINAL)
    found = read_csv(output)
    for k, name in enumerate(COEFFICIENT_NAMES):
        scale = np.abs(expected.coefficients[:, k]).max()
        np.testing.assert_allclose(found[f"{name} [1]"], expected.coefficients[:, k], atol=rtol * scale, rtol=0)
        np.testing.assert_allclose(found[f"sigma.{name} [1]"], expected.coefficients_std[:, k], rtol=rtol)
    return summary


def columns(held: InverseMap, temperature: np.ndarray) -> list[str]:
    """Three of the sensors: by number, by name, in another unit."""
    return ["time", *held.gauge_names, "temperature[1]", "T1 [degC]", "temperature[3] [K]"]


def test_csv_by_map_and_by_fmu(held: InverseMap, source: Path, tmp_path: Path) -> None:
    strain, temperature = drawn(18)
    strain = held.mean_strain + strain
    temperature[:, 3] = np.nan  # no column
    by_unit = temperature[:, :3] - [0.0, 273.15, 0.0]
    data = write_csv(tmp_path / "d.csv", columns(held, by_unit), 1e-3 * np.arange(K), strain, by_unit)
    expected = expected_of(held, strain, temperature)
    summary = check(source, data, expected)
    assert any("no column for 1 of 4 temperature sensors: T3" in note for note in summary.notes)
    export_estimator(source, tmp_path / "e.fmu", ExportOptions())
    summary = check(tmp_path / "e.fmu", data, expected, rtol=1e-8)
    assert any("no column for 1 of 4 temperature sensors: T3" in note for note in summary.notes)


def test_recorder_channels(held: InverseMap, source: Path, tmp_path: Path) -> None:
    """channels.toml: a channel of its own name, one stated, at a rate of their own."""
    strain, temperature = drawn(18)
    strain, temperature[:, 2:] = held.mean_strain + strain, np.nan
    names = [f"AI/ch{i}" for i in range(18)]
    data = write_csv(
        tmp_path / "d.csv",
        ["time", *names, "T0 [degC]", "AI/t1"],
        1e-3 * np.arange(K),
        strain,
        temperature[:, :2] - [273.15, 0.0],
    )
    entries = [
        f'[[channel]]\nname = "{name}"\ngauge = "{gauge}"\nunit = "m/m"\n'
        for name, gauge in zip(names, held.gauge_names, strict=True)
    ]
    entries.append('[[flow]]\nname = "AI/t1"\nquantity = "temperature[2]"\nunit = "K"\n')
    (tmp_path / "c.toml").write_text("\n".join(entries))
    estimate_file(source, data, tmp_path / "o.csv", NOMINAL, channels=tmp_path / "c.toml")
    expected = expected_of(held, strain, temperature)
    np.testing.assert_allclose(read_csv(tmp_path / "o.csv")["C_N [1]"], expected.C_N, rtol=1e-8)


def test_filtered(held: InverseMap, source: Path, tmp_path: Path) -> None:
    """A filter over time takes the temperatures of a sample, too."""
    strain, temperature = drawn(18)
    headings = ["time", *held.gauge_names, *(f"temperature[{i + 1}]" for i in range(N_T))]
    data = write_csv(tmp_path / "d.csv", headings, 1e-3 * np.arange(K), held.mean_strain + strain, temperature)
    summary = estimate_file(source, data, tmp_path / "o.csv", NOMINAL, filter_seconds=1.0)
    assert not any("temperature" in note for note in summary.notes)
    time, linear = 1e-3 * np.arange(K), Estimator(held).filter(1.0)
    found = linear.track(held.mean_strain + strain, NOMINAL, time=time, temperature=temperature)
    np.testing.assert_allclose(read_csv(tmp_path / "o.csv")["C_N [1]"], found.C_N, rtol=1e-7)


def test_what_is_wrong_is_named(held: InverseMap, source: Path, tmp_path: Path) -> None:
    strain, temperature = drawn(18)
    parts = (1e-3 * np.arange(K), strain, temperature[:, :2])
    for headings, text in (
        (["temperature[1]", "T0"], "expected one column for sensor T0, got 2: 'temperature\\[1\\]' and 'T0'"),
        (["temperature[1]", "temperature[9]"], "column 'temperature\\[9\\]': unknown name"),
        (["temperature[1] [bar]", "T1"], "column 'temperature\\[1\\] \\[bar\\]': unit: expected one of K, degC"),
    ):
        data = write_csv(tmp_path / "d.csv", ["time", *held.gauge_names, *headings], *parts)
        with pytest.raises(InputError, match=text):
            estimate_file(source, data, tmp_path / "o.csv", NOMINAL)
    assert not (tmp_path / "o.csv").exists()


def test_a_map_without_modes_passes_them_over_and_says_so(tmp_path: Path) -> None:
    held = scaled_map(2, seed=4)
    save_inverse_map(held, tmp_path / "map.h5")
    strain, temperature = drawn(18)
    headings = ["time", *held.gauge_names, "temperature[1]"]
    data = write_csv(tmp_path / "d.csv", headings, 1e-3 * np.arange(K), strain, temperature[:, :1])
    assert estimate_file(tmp_path / "map.h5", data, tmp_path / "o.csv", NOMINAL).unused == ("temperature[1]",)
