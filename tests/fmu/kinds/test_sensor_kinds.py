"""FMUs of every kind with further sensors: valid, each an input with its unit, and all give what numpy does."""

from __future__ import annotations

from pathlib import Path
from zipfile import ZipFile

import numpy as np
import pytest
from fmpy import read_csv, read_model_description, simulate_fmu
from fmpy.validation import validate_fmu
from fmu_host import OPTIONS, exported_kinds, loaded
from further_maps import with_further
from scaled_maps import NOMINAL, scaled_map
from sensor_maps import ROWS, sensor_rows, with_sensors

from strainfmu.errors import InputError
from strainfmu.estimator.linear.estimator import Estimator
from strainfmu.estimator.map.inverse_map import InverseMap
from strainfmu.estimator.map.sensors import SensorRows
from strainfmu.fmu.checks.crosscheck import write_crosscheck
from strainfmu.interface.estimator_variables import NOT_KNOWN, estimator_interface, output_values
from strainfmu.interface.sensor_variables import reading_names, sensor_names

pytestmark = pytest.mark.fast

N, N_S = 20, len(ROWS)


def held_map() -> InverseMap:
    return with_further(with_sensors(scaled_map(2, seed=4, n=N)))


def rows_of(inverse_map: InverseMap) -> SensorRows:
    assert inverse_map.sensors is not None
    return inverse_map.sensors


@pytest.fixture(scope="module")
def paths(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    return exported_kinds(held_map(), tmp_path_factory.mktemp("sensors"))


def test_names_are_identifiers() -> None:
    assert sensor_names(held_map())[-2:] == ("sensor.displacement_0_2m_45deg", "sensor.fibre_90deg_1")


@pytest.mark.parametrize("kind", OPTIONS)
def test_no_faults(paths: dict[str, Path], kind: str) -> None:
    """Each sensor is an input with its unit, thrust is one of 0 N, and outputs depend on all of them."""
    assert validate_fmu(str(paths[kind])) == []
    description = read_model_description(str(paths[kind]))
    variables = {one.name: one for one in description.modelVariables}
    units = {"m/m": "1", "N m": "N.m"}
    for name, (_, unit, scale, _) in zip(sensor_names(held_map()), ROWS.values(), strict=True):
        assert (variables[name].causality, variables[name].unit) == ("input", units.get(unit, unit))
        assert float(variables[name].nominal) < 10.0 * scale
    assert (variables["thrust"].unit, float(variables["thrust"].start)) == ("N", 0.0)
    for unknown in description.outputs:
        names = {one.name for one in unknown.dependencies}
        whole = {*sensor_names(held_map()), "thrust"} <= names
        assert whole == (unknown.variable.name != "tare_state")
    zeros = [name for name in variables if name.startswith("zero[")]
    assert len(zeros) == (0 if kind == "native_3" else N - N_S)


@pytest.mark.parametrize("kind", OPTIONS)
def test_page_terminals_and_contents(paths: dict[str, Path], kind: str) -> None:
    with ZipFile(paths[kind]) as archive:
        page = archive.read("documentation/index.html").decode()
        terminals = archive.read("terminalsAndIcons/terminalsAndIcons.xml").decode()
        contents = archive.read("extra/strainfmu/contents.json").decode()
    assert "and the readings of 8 further sensors" in page
    assert all(name in page and name in terminals for name in sensor_names(held_map()))
    assert '<Terminal name="sensors"' in terminals
    assert '"displacement_0.2m_45deg": "sensor.displacement_0_2m_45deg"' in contents
    largest = 1e6 * held_map().strain_range[: N - N_S].max()
    assert f'"|strain| of the gauge that strains most": "0 to {largest:.6g} um/m"' in contents


@pytest.mark.parametrize("kind", OPTIONS)
def test_an_importer_finds_the_reference(paths: dict[str, Path], tmp_path: Path, kind: str) -> None:
    results = write_crosscheck(paths[kind], tmp_path)
    assert [one.outcome for one in results if one.importer.startswith("FMPy")] == ["passed"], results


@pytest.mark.parametrize("kind", ["native", "python"])
def test_kinds_give_what_numpy_does(paths: dict[str, Path], tmp_path: Path, kind: str) -> None:
    held, random = held_map(), np.random.default_rng(1)
    estimator, rows = Estimator(held), rows_of(held)
    with loaded(paths[kind], tmp_path / kind) as host:
        host.initialize()
        outputs = [one.name for one in estimator_interface(held) if one.causality == "output"]
        outputs.remove("tare_state")
        host.set(["dynamic_pressure"], [NOMINAL])
        for k in range(3 * N_S):
            thrust = float(random.choice([0.0, 500.0, np.nan, NOT_KNOWN]))
            known = np.nan if thrust == NOT_KNOWN else thrust
            row = held.mean_strain + held.noise_std * random.normal(size=N)
            readings = row * rows.scale + np.nan_to_num(known) * rows.thrust_response
            valid = np.ones(N, dtype=bool)
            lost = N - 1 - k % N_S
            if k < N_S:
                readings[lost] = np.nan
            elif k < 2 * N_S:
                valid[lost] = False
            host.set([*reading_names(held), "thrust"], [*readings, thrust])
            host.set_booleans([f"valid[{i + 1}]" for i in range(N)], valid.tolist())
            found = estimator.step(rows.without_thrust(readings, known), NOMINAL, valid)
            expected = dict(zip(outputs, output_values(found, with_further=True), strict=True))
            assert host.integers(["health.valid_gauges"])[0] == int(found.valid.sum())
            names = [name for name in expected if not name.startswith("health")]
            np.testing.assert_allclose(host.get(names), [expected[name] for name in names], rtol=1e-12)


def test_model_exchange_takes_what_co_simulation_does(paths: dict[str, Path], tmp_path: Path) -> None:
    with ZipFile(paths["native"]) as archive:
        archive.extract("extra/org.fmi-standard.fmi-ls-ref/reference_in.csv", tmp_path)
    signals = read_csv(str(tmp_path / "extra/org.fmi-standard.fmi-ls-ref/reference_in.csv"))
    found = simulate_fmu(
        str(paths["native"]), stop_time=0.2, output_interval=0.05, input=signals, fmi_type="ModelExchange"
    )
    assert np.isfinite(found["C_A"]).all()
    assert np.ptp(found["C_N"]) > 0.0


def test_rows_in_another_order_are_refused() -> None:
    rows = sensor_rows(3)
    with pytest.raises(InputError, match="strain gauges, then the other sensors"):
        SensorRows(
            kind=rows.kind[::-1],
            unit=rows.unit,
            scale=rows.scale,
            largest=rows.largest,
            thrust_response=rows.thrust_response,
        )


def test_thrust_that_is_not_known_leaves_other_readings_alone() -> None:
    rows = sensor_rows(3)
    found = rows.without_thrust(np.ones((2, 3 + N_S)), np.array([np.nan, 300.0]))
    assert np.isnan(found[0]).tolist() == rows.follows_thrust.tolist()
    assert found[1, 5] == 1.0 + 300.0 / 150.0
