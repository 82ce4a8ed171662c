"""Flow parameters as columns of recorded data: health follows them, through map, FMU and filter."""

from pathlib import Path

import numpy as np
import pytest
from other_load_maps import with_further
from parameter_maps import with_parameters
from recorded_case import read_csv, write_csv
from scaled_maps import NOMINAL, scaled_map

from strainfmu.errors import InputError
from strainfmu.estimator.health import HealthState
from strainfmu.estimator.map.inverse_map import InverseMap, save_inverse_map
from strainfmu.fmu.export import export_estimator
from strainfmu.recorded.run import estimate_file
from strainfmu.recorded.summary import EstimationSummary

pytestmark = pytest.mark.fast

FIN = np.array([0.0, 3.9, 6.0, np.nan, -8.0, 4.0])
POWER = np.array([0.2, 0.2, 0.2, 0.2, 0.9, 0.2])
STATES = [HealthState.OUTSIDE if k in (2, 4) else HealthState.OK for k in range(6)]


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    made = tmp_path_factory.mktemp("parameters")
    held: InverseMap = with_parameters(with_further(scaled_map(1, 2)))
    save_inverse_map(held, made / "map.h5")
    export_estimator(made / "map.h5", made / "e.fmu")
    strain = np.tile(held.mean_strain, (6, 1))
    headings = ["time", *held.gauge_names, "fin_deg", "plant.power", "plant.M_R"]
    write_csv(made / "d.csv", headings, 1e-3 * np.arange(6), strain, FIN, POWER, FIN)
    write_csv(made / "unit.csv", [*headings[:-3], "fin_deg [deg]"], 1e-3 * np.arange(6), strain, FIN)
    return made


def estimated(folder: Path, source: str, filter_seconds: float | None = None) -> EstimationSummary:
    return estimate_file(
        folder / source, folder / "d.csv", folder / "o.csv", NOMINAL, filter_seconds=filter_seconds
    )


@pytest.mark.parametrize("source", ["map.h5", "e.fmu"])
def test_health_and_scores(folder: Path, source: str) -> None:
    summary = estimated(folder, source)
    found = read_csv(folder / "o.csv")
    assert [HealthState(int(one)) for one in found["health.state [1]"]] == STATES
    np.testing.assert_allclose(found["health.outside.fin_deg [1]"], [0.0, 0.0, 0.25, 0.0, 0.5, 0.0], rtol=1e-6)
    np.testing.assert_allclose(found["health.outside.power [1]"], [0.0, 0.0, 0.0, 0.0, 0.8, 0.0], rtol=1e-6)
    assert not found["health.outside.cant_deg [1]"].any()
    assert summary.blamed["OUTSIDE"] == {"fin_deg": 2, "power": 1}
    assert "most often to blame: 'fin_deg' (in 2)" in "\n".join(summary.health_lines())


def test_a_filter_keeps_the_health(folder: Path) -> None:
    estimated(folder, "map.h5", filter_seconds=0.01)
    assert [HealthState(int(one)) for one in read_csv(folder / "o.csv")["health.state [1]"]] == STATES


def test_a_unit_is_refused(folder: Path) -> None:
    with pytest.raises(InputError, match=r"column 'fin_deg \[deg\]': unit: expected one of"):
        estimate_file(folder / "map.h5", folder / "unit.csv", folder / "o.csv", NOMINAL)


@pytest.mark.parametrize(
    ("heading", "toml"),
    [
        ("power", ""),
        ("Schub [%]", "[[flow]]\nname = 'Schub'\nquantity = 'parameter.power'\nunit = '1'\n"),
    ],
)
def test_channels_of_a_recorder(folder: Path, tmp_path: Path, heading: str, toml: str) -> None:
    held = with_parameters(with_further(scaled_map(1, 2)))
    strain = np.tile(held.mean_strain, (6, 1))
    write_csv(tmp_path / "d.csv", ["time", *held.gauge_names, heading], 1e-3 * np.arange(6), strain, POWER)
    entries = [f"[[channel]]\nname = '{name}'\ngauge = '{name}'\nunit = 'm/m'\n" for name in held.gauge_names]
    (tmp_path / "channels.toml").write_text("\n".join([*entries, toml]))
    estimate_file(
        folder / "map.h5", tmp_path / "d.csv", tmp_path / "o.csv", NOMINAL, channels=tmp_path / "channels.toml"
    )
    found = read_csv(tmp_path / "o.csv")["health.outside.power [1]"]
    np.testing.assert_allclose(found, [0.0, 0.0, 0.0, 0.0, 0.8, 0.0], rtol=1e-6)


def test_a_channel_of_another_parameter_is_refused(folder: Path, tmp_path: Path) -> None:
    channel = "[[channel]]\nname = 'g0'\ngauge = 'g0'\nunit = 'm/m'\n"
    toml = f"{channel}[[flow]]\nname = 'fin_deg'\nquantity = 'parameter.flap_deg'\n"
    (tmp_path / "channels.toml").write_text(toml)
    with pytest.raises(InputError, match="expected a parameter of the map"):
        estimate_file(
            folder / "map.h5", folder / "d.csv", tmp_path / "o.csv", NOMINAL, channels=tmp_path / "channels.toml"
        )
