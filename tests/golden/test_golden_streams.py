"""Every carrier of the estimator gives what the golden files hold: ``kinds.py`` says what that is."""

from collections.abc import Callable
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from bus_carriers import by_bridge, by_loop
from comparison import NEAR_THRESHOLD, differences
from estimator_carrier import arguments, by_estimator, estimator_for, results_of
from fmu_carriers import Fmi2Host, Fmi3Host, by_fmu, python_host
from inputs import Inputs, Results, recorded
from kinds import KINDS, STREAMS, map_of_kind, tolerance_of
from other_carriers import by_recording, by_step
from sweeps import sweep

from strainfmu.estimator.estimator import Estimator
from strainfmu.estimator.health import HealthState
from strainfmu.estimator.map.inverse_map import InverseMap, save_inverse_map
from strainfmu.fmu.export import ExportOptions, export_estimator

CASES = [(kind, title, mode) for kind in KINDS for title in STREAMS[kind] for mode in STREAMS[kind][title].modes]
BY_FMU, BEGUN_AGAIN, BY_FMI_3 = 60, 20, 40
"""First samples by themselves that FMUs are given, of FMUs with memory, which begin again for each, and of FMI 3.0
all in all, another front of the same library. FMI 2.0 has every sample of a flight."""

BY_PYTHON = {
    ("absolute_case_1", "zeros", "each"): 12,
    ("scaled_case_2", "flight", "filter"): 12,
    ("sensors", "flight", "filter"): 8,
}
"""Samples of the Python FMU, whose steps are slow."""

Carrier = Callable[[Path, InverseMap, Inputs], Results]
OTHERS: dict[str, tuple[Carrier, str]] = {
    "step of a map": (by_step, "map.h5"),
    "step of an FMU": (by_step, "native.fmu"),
    "step of a Python FMU": (by_step, "python.fmu"),
    "recording by a map": (by_recording, "map.h5"),
    "recording by an FMU": (by_recording, "native.fmu"),
    "recording by a Python FMU": (by_recording, "python.fmu"),
    "bridge": (by_bridge, "native.fmu"),
    "closed loop": (by_loop, "native.fmu"),
}
"""Carriers that are given files, and the file."""

OTHER_SAMPLES = {"map.h5": 60, "native.fmu": 60, "python.fmu": 8}
BY_OTHERS = (
    *("scaled_sections", "scaled_sensors", "scaled_parameters", "scaled_air_sources", "scaled_masses"),
    *("sensors", "parameters", "air_sources", "masses"),
)
"""Kinds whose flights they are given."""

TWICE = ("scaled_sensors", "scaled_parameters", "scaled_air_sources", "scaled_masses")
"""Of these, linear maps whose inputs a nonlinear one has too: they are given in the slow tests."""

BY_OTHERS_IN_PYTHON = ("air_sources", "masses")
"""Of these, kinds of the Python FMU: a process starts for each, around the same core."""

SHOWN: dict[tuple[str, str, str], Callable[[Results], bool]] = {
    ("revolution", "air_data_dropped", "track"): lambda r: all(
        not r["air_data_used"][first : first + 14].all(axis=1).any() and health(r, "DEGRADED", first, first + 14)
        for first in (10, 34, 58)
    ),
    ("revolution", "air_data_doubted", "track"): lambda r: bool(
        np.sum(~r["air_data_used"].all(axis=1) & (r["health"] == HealthState.OK)) > 10
    ),
    ("revolution", "return_after_misfit", "track"): lambda r: returns(r, first=6, last=20),
    ("revolution", "return_after_misfit", "filter"): lambda r: returns(r, first=6, last=20),
    ("revolution", "jumps_and_spikes", "track"): lambda r: returns(r, first=54, last=55),
    ("revolution", "one_sensor_off", "track"): lambda r: {6, 18, 31} == suspected(r, "SUSPECT"),
    ("revolution", "pressure_off_the_tables", "track"): lambda r: bool(
        np.any((r["fits"] == 0) & (r["chi_square"] < r["chi_square_limit"]))
    ),
    ("revolution", "restart", "filter"): lambda r: bool(
        r["fits"].all() and np.any(r["loads_std"][20] > 1.2 * r["loads_std"][19])
    ),
    ("revolution", "each_without_air_data", "each"): lambda r: bool(
        np.ptp(np.log(r["air_data_std"][:, 4])) > np.log(10.0)
    ),
    ("revolution", "coasting", "filter"): lambda r: (
        health(r, "INVALID", 8, 18) and not np.isnan(r["loads"][8:18]).any() and health(r, "INVALID", 48, 52)
    ),
    ("few_gauges", "one_gauge_off", "each"): lambda r: len(suspected(r, "SUSPECT")) > 3,
    ("twin_gauges", "one_gauge_off", "each"): lambda r: bool(
        np.any((r["suspects"] == 2) & (r["health"] == HealthState.SUSPECT))
    ),
    ("scaled_case_1", "restart", "filter"): lambda r: (
        health(r, "INCONSISTENT", 36, 44) and bool(np.any(r["loads_std"][20:25].min(axis=0) < r["loads_std"][25]))
    ),
}
"""What a faulty flight is for: whether results show it."""


def health(results: Results, state: str, first: int, last: int) -> bool:
    """Return whether health of samples from ``first`` up to ``last`` is ``state``."""
    return bool(np.all(results["health"][first:last] == HealthState[state]))


def returns(results: Results, first: int, last: int) -> bool:
    """Return whether loads are linear from ``first`` to four samples after ``last``, and not from the fifth on."""
    linear = results["is_linear"] != 0
    inconsistent = health(results, "INCONSISTENT", first, last) and health(results, "DEGRADED", last, last + 4)
    return bool(inconsistent and linear[first : last + 4].all() and not linear[[first - 1, last + 4]].any())


def suspected(results: Results, state: str) -> set[int]:
    """Return the numbers of suspects of samples whose health is ``state``."""
    return set(results["suspect_gauge"][results["health"] == HealthState[state]].tolist())


of_cases = pytest.mark.parametrize(("kind", "title", "mode"), CASES)


def assert_as_recorded(kind: str, mode: str, expected: Results, found: Results) -> None:
    """Assert that ``found`` is ``expected`` to the tolerance, but for samples near a threshold."""
    near = expected[NEAR_THRESHOLD] != 0
    off = []
    for field, values in differences(expected, found).items():
        for row in np.flatnonzero(values > tolerance_of(kind, mode)):
            if not near[row]:
                off.append(f"{field}[{row}] {values[row]:.1e}")
    assert not off, f"{len(off)} differences [standard deviations]: {', '.join(off[:20])}"


@cache
def estimator_of_kind(kind: str) -> Estimator:
    """Return the estimator of a kind, without zero offsets and with the settings of its map."""
    return Estimator(map_of_kind(kind))


@pytest.fixture(scope="module")
def resources(tmp_path_factory: pytest.TempPathFactory) -> Callable[[str], Path]:
    """Return a function that returns the folder of native resources of a kind: the map of its estimator."""

    def write(kind: str) -> Path:
        folder = tmp_path_factory.mktemp("golden")
        (folder / "map.bin").write_bytes(estimator_of_kind(kind).core.resource)
        return folder

    return cache(write)


@pytest.fixture(scope="module")
def sources(tmp_path_factory: pytest.TempPathFactory) -> Callable[[str, str], Path]:
    """Return a function that returns a map of a kind, or an FMU of it, which names the kind of FMU."""

    @cache
    def folder_of(kind: str) -> Path:
        folder = tmp_path_factory.mktemp(kind)
        save_inverse_map(map_of_kind(kind), folder / "map.h5")
        return folder

    def source(kind: str, name: str) -> Path:
        file = folder_of(kind) / name
        if not file.exists():
            options = ExportOptions(inputs="full", kind=file.stem, zero_inputs=file.stem == "native")
            export_estimator(file.with_name("map.h5"), file, options)
        return file

    return source


@pytest.mark.fast
def test_files_hold_all_streams() -> None:
    for kind in KINDS:
        held = {title: set(one.results) for title, one in recorded(kind).items()}
        assert held == {title: set(stream.modes) for title, stream in STREAMS[kind].items()}, kind


@pytest.mark.fast
@pytest.mark.parametrize("stream", SHOWN, ids="/".join)
def test_faults_have_their_effect(stream: tuple[str, str, str]) -> None:
    """What the estimator does about a fault is in the file, also after it was recorded again."""
    kind, title, mode = stream
    results = recorded(kind)[title].results[mode]
    assert SHOWN[stream](results), results["health"]


@pytest.mark.parametrize("kind", [name for name, one in KINDS.items() if not one.is_nonlinear])
def test_linear_maps_have_no_memory(kind: str) -> None:
    one = recorded(kind)["flight"]
    found = by_estimator(estimator_of_kind(kind), one.inputs, "track", 0.0)
    assert_as_recorded(kind, "each", one.results["each"], found)


@of_cases
def test_estimator(kind: str, title: str, mode: str) -> None:
    one = recorded(kind)[title]
    estimator = estimator_for(estimator_of_kind(kind), one.inputs)
    found = by_estimator(estimator, one.inputs, mode, STREAMS[kind][title].seconds)
    assert_as_recorded(kind, mode, one.results[mode], found)


@pytest.mark.parametrize("host", [Fmi2Host, Fmi3Host])
@of_cases
def test_fmu(
    kind: str, title: str, mode: str, host: type[Fmi2Host] | type[Fmi3Host], resources: Callable[[str], Path]
) -> None:
    one, inverse_map = recorded(kind)[title], map_of_kind(kind)
    given = len(one.inputs) if mode != "each" else BEGUN_AGAIN if KINDS[kind].is_nonlinear else BY_FMU
    given = min(given, BY_FMI_3) if host is Fmi3Host else given
    fmu = host(inverse_map, resources(kind))
    found = by_fmu(fmu, inverse_map, one.inputs.rows(slice(given)), mode, STREAMS[kind][title].seconds)
    fmu.fmu.free()
    assert {"loads", "loads_std", "coefficients", "chi_square", "health", "suspect_gauge"} <= found.keys()
    assert_as_recorded(kind, mode, one.results[mode], found)


@pytest.mark.parametrize("host", [Fmi2Host, Fmi3Host])
@pytest.mark.parametrize("kind", ["scaled_five_gauges", "scaled_sensors", "sensors"])
def test_a_time_constant_that_changes_in_flight(
    kind: str, host: type[Fmi2Host] | type[Fmi3Host], resources: Callable[[str], Path]
) -> None:
    """The filter goes on with its state, as in Python; a last change to 0 turns it off."""
    inputs, inverse_map = recorded(kind)["flight"].inputs.rows(slice(40)), map_of_kind(kind)
    changes = {0: 1.0, 10: 1e-9, 20: 10.0, 30: 0.0}
    estimator, parts = estimator_of_kind(kind), list[Results]()
    for first, seconds in changes.items():
        estimator, rows = estimator.filter(seconds), inputs.rows(slice(first, first + 10))
        parts.append(results_of(estimator.track(rows.strain, time=rows.time, **arguments(estimator, rows))))
    whole = {name for name in parts[0] if all(len(one[name]) == 10 for one in parts)}
    expected = {name: np.concatenate([one[name] for one in parts]) for name in whole} | {
        NEAR_THRESHOLD: np.zeros(40)
    }
    fmu = host(inverse_map, resources(kind))
    found = by_fmu(fmu, inverse_map, inputs, "filter", 1.0, changes)
    fmu.fmu.free()
    assert_as_recorded(kind, "filter", expected, found)
    fixed = recorded(kind)["flight"].results["filter"]["loads_std"][10:40]
    assert np.nanmax(np.abs(found["loads_std"][10:40] / fixed - 1.0)) > 0.001


@pytest.mark.parametrize(("kind", "title", "mode"), sweep(BY_PYTHON, [("sensors", "flight", "filter")]))
def test_python_fmu(kind: str, title: str, mode: str, sources: Callable[[str, str], Path], tmp_path: Path) -> None:
    one, inverse_map = recorded(kind)[title], map_of_kind(kind)
    fmu = python_host(inverse_map, sources(kind, "python.fmu"), tmp_path / "unzipped")
    inputs = one.inputs.rows(slice(BY_PYTHON[kind, title, mode]))
    found = by_fmu(fmu, inverse_map, inputs, mode, STREAMS[kind][title].seconds)
    fmu.fmu.free()
    assert_as_recorded(kind, mode, one.results[mode], found)


@pytest.mark.parametrize(
    ("kind", "name"),
    [
        pytest.param(
            kind,
            name,
            id=f"{kind}-{name}",
            marks=pytest.mark.slow if kind in TWICE or (kind, source) == ("masses", "python.fmu") else (),
        )
        for kind in BY_OTHERS
        for name, (_, source) in OTHERS.items()
        if source != "python.fmu" or kind in BY_OTHERS_IN_PYTHON
    ],
)
def test_others(kind: str, name: str, sources: Callable[[str, str], Path]) -> None:
    """A bridge gives no scores of parameters, which need no gauge, of a cycle without any gauge."""
    carrier, source = OTHERS[name]
    one, inverse_map = recorded(kind)["flight"], map_of_kind(kind)
    mode = "track" if KINDS[kind].is_nonlinear else "each"
    inputs = one.inputs.rows(slice(OTHER_SAMPLES[source]))
    expected, found = one.results[mode], carrier(sources(kind, source), inverse_map, inputs)
    assert {"coefficients", "coefficients_std", "chi_square", "health", "envelope_score"} <= found.keys()
    if carrier is by_bridge and "parameter_score" in found:
        lost = ~inputs.valid.any(axis=1)
        assert lost.sum() < 4
        found["parameter_score"][lost] = expected["parameter_score"][: len(inputs)][lost]
    assert_as_recorded(kind, mode, expected, found)


@pytest.mark.parametrize("kind", ["scaled_sensors", "sensors"])
def test_a_plain_sample_keeps_nothing_of_the_one_before(kind: str) -> None:
    estimator = Estimator(map_of_kind(kind))
    strain, temperature = estimator.inverse_map.mean_strain, estimator.core.inputs["temperature"]
    estimator.estimate(strain, 1e5, temperature=[350.0] * (temperature.stop - temperature.start), thrust=2e3)
    found, of_many = estimator.estimate(strain, 1e5).sample, estimator.estimate(strain[None], 1e5).sample[0]
    np.testing.assert_array_equal(found, of_many)
    assert np.isnan(found[temperature]).all()
    assert found[estimator.core.inputs["thrust"]] == 0.0
