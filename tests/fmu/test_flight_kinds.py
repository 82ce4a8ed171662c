"""FMUs of the nonlinear estimator: valid, and every kind gives what numpy gives in an importer."""

from __future__ import annotations

from pathlib import Path
from xml.etree.ElementTree import Element, fromstring
from zipfile import ZipFile

import pytest
from flight_fmu import whole_map
from fmpy.validation import validate_fmu
from fmu_host import OPTIONS

from strainfmu.estimator.inverse_map import save_inverse_map
from strainfmu.fmu.crosscheck import write_crosscheck
from strainfmu.fmu.export import export_estimator
from strainfmu.fmu.integrity import damaged_entries


@pytest.fixture(scope="module")
def flights(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    folder = tmp_path_factory.mktemp("flights")
    save_inverse_map(whole_map(), folder / "map.h5")
    paths = {kind: folder / f"{kind}.fmu" for kind in OPTIONS}
    for kind, options in OPTIONS.items():
        export_estimator(folder / "map.h5", paths[kind], options)
    return paths


def description(path: Path) -> Element:
    with ZipFile(path) as archive:
        return fromstring(archive.read("modelDescription.xml"))


@pytest.mark.parametrize("kind", OPTIONS)
def test_no_faults(flights: dict[str, Path], kind: str) -> None:
    assert validate_fmu(flights[kind]) == []
    assert damaged_entries(flights[kind]) == []


@pytest.mark.parametrize("kind", OPTIONS)
def test_an_importer_finds_the_reference(flights: dict[str, Path], tmp_path: Path, kind: str) -> None:
    """Reals to 1e-5, in FMPy; all variables of all kinds belong to one list of numpy's."""
    results = write_crosscheck(flights[kind], tmp_path)
    assert [one.outcome for one in results if one.importer.startswith("FMPy")] == ["passed"], results


@pytest.mark.parametrize("kind", OPTIONS)
def test_neither_model_exchange_nor_derivatives(flights: dict[str, Path], kind: str) -> None:
    root = description(flights[kind])
    assert root.find("ModelExchange") is None
    simulation = root.find("CoSimulation")
    assert simulation is not None
    assert [name for name in simulation.attrib if "Derivative" in name] == []


def test_names_and_units_of_the_air_data(flights: dict[str, Path]) -> None:
    for kind in OPTIONS:
        root = description(flights[kind])
        found = {one.get("name"): one for one in root.find("ModelVariables") or ()}
        for name in ("angle_of_attack", "static_pressure"):
            for prefix in ("air_data", "sigma.air_data", "identified.air_data"):
                assert f"{prefix}.{name}" in found, kind
        assert {"navigation_used.mach_number", "health.linear_loads", "static_pressure_std"} <= set(found)
