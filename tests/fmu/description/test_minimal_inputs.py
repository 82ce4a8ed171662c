"""The inputs of an FMU as it is exported without options: those that a host connects, and no others."""

from pathlib import Path

import fmpy
import numpy as np
import pytest
from flight_fmu import N_D, random_flight, whole_map
from fmu_host import Host, loaded
from synthetic_vehicle import N_GAUGES, SyntheticFiles

from strainfmu.errors import InputError
from strainfmu.estimator.air_inputs import AIR_INPUT_NAMES
from strainfmu.estimator.map.inverse_map import save_inverse_map
from strainfmu.fmu.export import ExportOptions, export_estimator

pytestmark = pytest.mark.fast

AIR = {"dynamic_pressure", "mach_number", "altitude", "static_pressure", "q_source"}
KINDS = {
    "native": ExportOptions(platforms=["linux64"]),
    "arrays": ExportOptions(platforms=["linux64"], fmi_version="3"),
    "scalars": ExportOptions(platforms=["linux64"], fmi_version="3", scalars=True),
    "python": ExportOptions(kind="python"),
}


def inputs_of(fmu: Path) -> set[str]:
    return {v.name for v in fmpy.read_model_description(str(fmu)).modelVariables if v.causality == "input"}


@pytest.mark.parametrize("kind", KINDS)
def test_strain_air_data_and_tare_are_all(synthetic: SyntheticFiles, tmp_path: Path, kind: str) -> None:
    """Six inputs in addition to the gauges, 60 with 54 gauges; fewer where the map takes no static pressure."""
    save_inverse_map(whole_map(), tmp_path / "map.h5")
    for source, n, without in (
        (synthetic.map_1, N_GAUGES, {"static_pressure"}),
        (tmp_path / "map.h5", N_D, set()),
    ):
        export_estimator(source, tmp_path / "few.fmu", KINDS[kind])
        strains = {"strain"} if kind == "arrays" else {f"strain[{i}]" for i in range(1, n + 1)}
        found = inputs_of(tmp_path / "few.fmu")
        of_map = {name for name in found if name.startswith(("temperature", "parameter", "sensor", "thrust"))}
        assert found - of_map == strains | (AIR - without) | {"tare"}
        assert not of_map & {*AIR_INPUT_NAMES}


def test_fmpy_names_only_what_a_user_leaves_out(
    synthetic: SyntheticFiles, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    export_estimator(synthetic.map_1, tmp_path / "few.fmu", KINDS["native"])
    names = sorted(inputs_of(tmp_path / "few.fmu") - {"tare", "altitude"})
    signals = np.zeros(2, dtype=[("time", float), *((name, float) for name in names)])
    signals["time"], signals["dynamic_pressure"], signals["strain[1]"] = (0.0, 1.0), 9e4, 1e-6
    fmpy.simulate_fmu(str(tmp_path / "few.fmu"), stop_time=0.2, output_interval=0.1, input=signals)
    missing = [line for line in capsys.readouterr().out.splitlines() if "missing input" in line]
    assert [line.split('"')[1] for line in missing] == ["altitude", "tare"]


@pytest.mark.parametrize("kind", ["native", "python"])
def test_a_strain_of_nan_is_a_gauge_that_is_not_valid(tmp_path: Path, kind: str) -> None:
    """Outputs are those of the FMU with all inputs whose flag is false, to the bit."""
    save_inverse_map(whole_map(), tmp_path / "map.h5")
    sample, found = random_flight(whole_map(), 1, seed=3)[0], {}
    for inputs in ("minimal", "full"):
        options = ExportOptions(kind=kind, inputs=inputs)
        export_estimator(tmp_path / "map.h5", tmp_path / f"{inputs}.fmu", options)
        with loaded(tmp_path / f"{inputs}.fmu", tmp_path / inputs) as host:
            found[inputs] = outputs_without(host, sample.strain, sample.flow, gauge=2, by_flag=inputs == "full")
    np.testing.assert_array_equal(found["minimal"], found["full"])
    assert np.isfinite(found["minimal"]).all()


def outputs_without(
    host: Host, strain: np.ndarray, flow: dict[str, float], gauge: int, by_flag: bool
) -> np.ndarray:
    """Coefficients, their standard deviations and the number of gauges in use after a step without a gauge."""
    host.initialize()
    read = strain.copy()
    if by_flag:
        host.set_booleans([f"valid[{gauge}]"], [False])
    else:
        read[gauge - 1] = np.nan
    host.set([f"strain[{i}]" for i in range(1, len(read) + 1)], read)
    host.set([*flow], [*flow.values()])
    host.fmu.doStep(0.0, 0.01)
    names = ["C_A", "C_N", "C_Y", "M_P", "M_Y"]
    assert host.integers(["health.valid_gauges"]) == [len(read) - 1]
    return host.get([*names, *(f"sigma.{name}" for name in names)])


def test_other_words_for_inputs_are_refused() -> None:
    with pytest.raises(InputError, match="inputs: 'all' found, must be one of minimal, full"):
        ExportOptions(inputs="all")
    with pytest.raises(InputError, match="inputs: expected none with kind c"):
        ExportOptions(kind="c", inputs="full")
