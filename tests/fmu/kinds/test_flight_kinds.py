"""FMUs of the nonlinear estimator: valid, and every kind gives what numpy gives in an importer."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from xml.etree.ElementTree import Element, fromstring
from zipfile import ZipFile

import numpy as np
import pytest
from flight_fmu import N_D, fresh_tracker, random_flight, tracked, whole_map
from fmpy.validation import validate_fmu
from fmu_host import OPTIONS, exported_kinds, loaded
from further_maps import STATIONS, with_further_tables

from strainfmu.estimator.filter.flight_filter import FlightFilter
from strainfmu.estimator.filter.settings import FilterSettings
from strainfmu.estimator.health import HealthState
from strainfmu.estimator.manifold.estimator import ManifoldEstimator
from strainfmu.fmu.checks.crosscheck import write_crosscheck
from strainfmu.fmu.checks.integrity import damaged_entries
from strainfmu.interface.filter_variables import FILTER_TIME_CONSTANT
from strainfmu.interface.further_variables import further_outputs


@pytest.fixture(scope="module")
def flights(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    return exported_kinds(with_further_tables(whole_map()), tmp_path_factory.mktemp("flights"))


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
def test_derivatives_without_model_exchange(flights: dict[str, Path], kind: str) -> None:
    root = description(flights[kind])
    assert root.find("ModelExchange") is None
    simulation = root.find("CoSimulation")
    assert simulation is not None
    found = {name for name, value in simulation.attrib.items() if "Derivative" in name and value == "true"}
    offered = {
        "python": set[str](),
        "native": {"providesDirectionalDerivative"},
        "native_3": {"providesDirectionalDerivatives", "providesAdjointDerivatives"},
    }
    assert found == offered[kind]


def test_names_and_units_of_the_air_data(flights: dict[str, Path]) -> None:
    for kind in OPTIONS:
        root = description(flights[kind])
        found = {one.get("name"): one for one in root.find("ModelVariables") or ()}
        for name in ("angle_of_attack", "static_pressure"):
            for prefix in ("air_data", "sigma.air_data", "identified.air_data"):
                assert f"{prefix}.{name}" in found, kind
        assert {"navigation_used.mach_number", "health.linear_loads", "static_pressure_std"} <= set(found)


@pytest.mark.parametrize("time_constant", [0.0, 1.0])
@pytest.mark.parametrize("kind", ["native", "python"])
def test_section_loads_step_by_step(
    flights: dict[str, Path], tmp_path: Path, kind: str, time_constant: float
) -> None:
    """Each sample on its own, and filtered."""
    held = with_further_tables(whole_map())
    tracker = fresh_tracker(held)
    flight = FlightFilter(ManifoldEstimator(held), FilterSettings(time_constant=1.0))
    with loaded(flights[kind], tmp_path / kind) as host:
        host.initialize()
        host.set([FILTER_TIME_CONSTANT], [time_constant])
        names = list(host.references)
        further = names[names.index("M_R") :][: 4 + 12 * len(STATIONS)]
        assert further[-1] == f"sigma.section.torsion[{len(STATIONS)}]"
        for k, sample in enumerate(random_flight(held, 5, seed=41)):
            valid = np.arange(N_D) != k
            host.set([f"strain[{i + 1}]" for i in range(N_D)], sample.strain)
            host.set_booleans([f"valid[{i + 1}]" for i in range(N_D)], valid.tolist())
            host.set(list(sample.flow), list(sample.flow.values()))
            host.fmu.doStep(0.01 * k, 0.01)
            given = replace(sample, valid=valid)
            filtered = flight.recorded(0.01, given.strain, given.flow, valid=valid).estimate[0]
            expected = further_outputs(filtered if time_constant else tracked(tracker, given))
            # A step of the PythonFMU is 0.01 s but for rounding: the time of its start less that of the last.
            rtol = 1e-8 if time_constant else 0.0 if kind == "python" else 1e-10
            np.testing.assert_allclose(host.get(further), expected, rtol=rtol, atol=0.0)


@pytest.mark.parametrize("kind", ["native", "python"])
def test_a_deviation_that_is_not_given_is_the_map_s(flights: dict[str, Path], tmp_path: Path, kind: str) -> None:
    """0, which hosts fill in, below, or NaN; with an infinite one its value counts as not known."""
    sample = random_flight(whole_map(), 1, seed=5)[0]
    outputs = ["C_A", "sigma.C_A", "air_data.mach_number", "sigma.air_data.mach_number", "health.chi_square"]
    with loaded(flights[kind], tmp_path / kind) as host:

        def stepped(name: str, deviation: float) -> list[float]:
            host.fmu.reset()
            host.initialize()
            host.set([f"strain[{i + 1}]" for i in range(N_D)], sample.strain)
            host.set([*sample.flow, f"{name}_std"], [*sample.flow.values(), deviation])
            host.fmu.doStep(0.0, 0.01)
            return [*host.get(outputs), *host.fmu.getBoolean([host.references[f"navigation_used.{name}"]])]

        for name in sample.flow:
            own, unknown = stepped(name, np.nan), stepped(name, np.inf)
            assert own[-1]
            assert not unknown[-1]
            assert np.isfinite([*own, *unknown]).all()
            assert [stepped(name, value) for value in (0.0, -1.0, -np.inf)] == [own, own, own]


@pytest.mark.parametrize("kind", ["numpy", "native", "python"])
def test_navigation_is_not_given_or_impossible(flights: dict[str, Path], tmp_path: Path, kind: str) -> None:
    """What is not given, 0, below or NaN, costs sigma alone; what is impossible is a fault, with the loads
    without it."""
    sample = random_flight(whole_map(), 1, seed=5)[0]
    altitude = {"static_pressure": 0.0, "altitude": 72e3}  # above the atmosphere
    without: dict[str, dict[str, float]] = {name: {name: np.nan} for name in sample.flow}
    changes = {f"{name} {value}": {name: value} for name in sample.flow for value in (0.0, -6.0, np.inf)}
    changes |= {f"altitude {value}": altitude | {"altitude": value} for value in (np.nan, 0.0, 72e3)}
    found = {}
    if kind == "numpy":
        estimator = ManifoldEstimator(with_further_tables(whole_map()))
        for name, change in (without | changes).items():
            one = estimator.step(sample.strain, **(sample.flow | change))
            found[name] = (HealthState(int(one.health)).name, *one.coefficients)
    else:
        with loaded(flights[kind], tmp_path / kind) as host:
            for name, change in (without | changes).items():
                host.fmu.reset()
                host.initialize()
                flow = sample.flow | change
                host.set([f"strain[{i + 1}]" for i in range(N_D)], sample.strain)
                host.set(list(flow), list(flow.values()))
                host.fmu.doStep(0.0, 0.01)
                state = HealthState(host.health()).name
                found[name] = (state, *host.get(["C_A", "C_N", "C_Y", "M_P", "M_Y"]))
    for name, change in changes.items():
        given = any(value > 0.0 for value in change.values())
        as_without = found["static_pressure" if "altitude" in change else next(iter(change))]
        assert as_without[0] == "OK"
        assert found[name] == (("DEGRADED", *as_without[1:]) if given else as_without), name
