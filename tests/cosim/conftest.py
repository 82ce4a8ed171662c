"""A slender vehicle that flies, once per module."""

from pathlib import Path

import pytest
from slender_vehicle import SlenderFiles, make_slender_files

from strainfmu.cosim.flight import flight_system
from strainfmu.cosim.scenario import Scenario, load_scenario
from strainfmu.cosim.systems.ssp import write_ssp
from strainfmu.fmu.flight_export import export_flight


@pytest.fixture(scope="module")
def files(tmp_path_factory: pytest.TempPathFactory) -> SlenderFiles:
    return make_slender_files(tmp_path_factory.mktemp("slender"))


@pytest.fixture(scope="module")
def scenario(files: SlenderFiles) -> Scenario:
    return load_scenario(files.scenario)


@pytest.fixture(scope="module")
def fmus(scenario: Scenario, files: SlenderFiles) -> dict[str, Path]:
    return export_flight(scenario, files.folder / "fmus")


@pytest.fixture(scope="module")
def packages(scenario: Scenario, fmus: dict[str, Path], files: SlenderFiles) -> dict[bool, Path]:
    """Return SSP packages of the flight by estimates, without and with connectors of the system."""
    system = flight_system(scenario, fmus, "estimate")
    paths = {with_them: files.folder / f"flight_{with_them}.ssp" for with_them in (False, True)}
    for with_them, path in paths.items():
        write_ssp(system, path, scenario.name, scenario.stop_time, scenario.step_size, with_them)
    return paths
