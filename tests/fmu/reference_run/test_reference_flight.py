"""The run inside an estimator FMU: within the map's validity, errors as large as stated, a fault that is found."""

from dataclasses import replace

import numpy as np
import pytest
from field_maps import field_map
from flight_fmu import whole_map
from flight_maps import with_considered_columns, with_considered_error
from other_load_maps import with_further_tables
from parameter_maps import with_parameter_tables, with_parameters
from published_run import columns
from random_map import random_map
from scaled_maps import whole_scaled_map, with_envelope
from sensor_maps import with_sensors
from thermal_maps import with_temperature

from strainfmu.atmosphere import dynamic_pressure, pressure_and_temperature
from strainfmu.estimator.estimator import Estimator
from strainfmu.estimator.map import inverse_map as inverse_map_module
from strainfmu.estimator.map.flight_tables import LOG_PRESSURE, MACH, U, W
from strainfmu.estimator.map.inverse_map import InverseMap
from strainfmu.estimator.other_loads import FIVE_LOADS
from strainfmu.fmu.reference_run.flight_path import altitude_of, flight_path
from strainfmu.fmu.reference_run.readings import failing_gauge, reference_readings
from strainfmu.fmu.reference_run.reference_flight import (
    error_covariance,
    flight_of_states,
    flight_states,
    free_precision,
    largest_states,
    true_states,
)
from strainfmu.fmu.reference_run.run import (
    N_ROWS,
    ReferenceRun,
    as_recorded,
    is_usual,
    reference_run,
    signal_table,
)
from strainfmu.interface.estimator_variables import estimator_interface
from strainfmu.interface.fmi_variables import COEFFICIENTS

pytestmark = pytest.mark.fast

CASES = ("case 1", "case 2", "envelope", "scaled")


def made(name: str) -> InverseMap:
    """A map whose mean is inside its own ranges, as the mean of snapshots is."""
    if name == "scaled":
        return inside(whole_scaled_map(1, seed=4, n=54, n_states=5))
    raw = random_map({"case 1": 1, "case 2": 2, "envelope": 2}[name])
    if name != "envelope":
        return inside(raw)
    mean, spread = mean_and_spread(raw)
    stated = with_envelope(n=21, size=0.02)
    direction = np.asarray(stated["envelope_direction"])
    limit = direction @ mean + 0.3 * np.abs(direction) @ spread
    return replace(inside(raw), envelope_direction=direction, envelope_limit=limit)


def mean_and_spread(raw: InverseMap) -> tuple[np.ndarray, np.ndarray]:
    """(5,) coefficients of the mean, and what one of each state changes [1]."""
    scale = raw.nominal_dynamic_pressure * raw.references[FIVE_LOADS]
    return raw.load_of_mean / scale, np.abs(raw.load_per_state / scale[:, None]).sum(axis=1)


def inside(raw: InverseMap) -> InverseMap:
    mean, spread = mean_and_spread(raw)
    changed = {
        "coefficient_range": np.stack((mean - spread, mean + 0.5 * spread), axis=1),
        "strain_range": np.abs(raw.mean_strain) + np.abs(raw.state_operator).sum(axis=1),
    }
    return replace(raw, **changed)


def with_ranges(inverse_map: InverseMap, mach: tuple[float, float], altitude: tuple[float, float]) -> InverseMap:
    """``inverse_map`` for these ranges and their dynamic pressures; the nominal one is in their middle."""
    low, high = dynamic_pressure(mach[0], altitude[1]), dynamic_pressure(mach[1], altitude[0])
    nominal = dynamic_pressure(0.5 * sum(mach), 0.5 * sum(altitude))
    fields = {
        "mach_number_range": np.array(mach),
        "altitude_range": np.array(altitude),
        "dynamic_pressure_range": np.array([0.99 * low, 1.01 * high]),
    }
    factor = nominal / inverse_map.nominal_dynamic_pressure
    return replace(
        inverse_map, **fields, nominal_dynamic_pressure=nominal, reference_area=inverse_map.reference_area / factor
    )


def of_shape() -> InverseMap:
    """Tables for a shape whose angles have ranges of their own, which do not begin at zero."""
    held = whole_map()
    assert held.manifold is not None
    ranges = np.radians([[-1.0, 7.0], [-3.0, 3.0]])
    return replace(held, manifold=replace(held.manifold, crossflow_range=ranges))


def of_one_condition() -> InverseMap:
    """Tables for one Mach number and nearly one pressure."""
    held = whole_map()
    assert held.manifold is not None
    ranges = {"mach_range": np.array([6.0, 6.0]), "pressure_range": np.array([5400.0, 5500.0])}
    return replace(held, manifold=replace(held.manifold, **ranges))


MAPS = {
    **{name: lambda name=name: made(name) for name in CASES},
    "altitudes": lambda: with_ranges(made("scaled"), (5.0, 7.0), (15e3, 25e3)),
    "one altitude": lambda: with_ranges(made("scaled"), (5.0, 7.0), (20e3, 20e3)),
    "one condition": lambda: with_ranges(made("scaled"), (6.0, 6.0), (20e3, 20e3)),
    "absolute with ranges": lambda: with_ranges(made("case 1"), (5.0, 7.0), (15e3, 25e3)),
    "linear with everything": lambda: with_temperature(with_sensors(with_parameters(made("scaled")))),
    "tables": whole_map,
    "tables with a field": field_map,
    "tables of a shape": of_shape,
    "tables of one condition": of_one_condition,
    "tables with considered errors": lambda: with_considered_columns(with_considered_error(whole_map())),
    "tables with everything": lambda: with_temperature(
        with_sensors(with_parameter_tables(with_further_tables(whole_map())))
    ),
}
AIR_DATA = {
    "scaled",
    "linear with everything",
    "altitudes",
    "one altitude",
    "one condition",
    "absolute with ranges",
}
"""Linear maps that state ranges of Mach number and altitude; all tables do."""


@pytest.fixture(scope="module", params=MAPS)
def example(request: pytest.FixtureRequest) -> tuple[str, InverseMap, ReferenceRun]:
    inverse_map = MAPS[request.param]()
    return request.param, inverse_map, reference_run(inverse_map)


def test_health_is_ok_but_for_one_fault_that_is_found(example: tuple[str, InverseMap, ReferenceRun]) -> None:
    _, inverse_map, run = example
    fault, state = run.fault, run.outputs["health.state"]
    assert fault is not None
    assert is_usual(run)
    bad = np.flatnonzero(state)
    assert N_ROWS // 2 < bad[0] == np.flatnonzero(fault.fails)[0]
    assert len(bad) == bad[-1] - bad[0] + 1 <= 0.3 * N_ROWS
    assert bad[-1] < N_ROWS - 1
    assert len(bad) - fault.fails.sum() <= (0 if inverse_map.manifold is None else 4)


def test_estimates_agree_with_the_truth(example: tuple[str, InverseMap, ReferenceRun]) -> None:
    """Rows of a run belong to the inputs of the row before; errors of the strains are those of the map."""
    _, inverse_map, run = example
    ok = run.outputs["health.state"] == 0.0
    scores = []
    for output, true in run.truth.items():
        if output in COEFFICIENTS or output in ("air_data.angle_of_attack", "air_data.mach_number"):
            scores.append(np.abs(run.outputs[output] - true)[ok] / run.outputs[f"sigma.{output}"][ok])
    assert np.max(scores) < 4.0
    assert len(scores) == (5 if inverse_map.manifold is None else 7)
    # It moves, by more than its errors.
    moves = [np.ptp(run.truth[name]) / np.median(run.outputs[f"sigma.{name}"]) for name in COEFFICIENTS]
    assert max(moves) > 2.0
    # Not round-off: the residual is that of errors.
    if inverse_map.case == 1:
        limit = 0.1 * inverse_map.residual_degrees_of_freedom
        assert np.median(run.outputs["health.chi_square"][ok]) > limit


def test_all_that_the_map_takes_is_given(example: tuple[str, InverseMap, ReferenceRun]) -> None:
    name, inverse_map, run = example
    given = {one.partition("[")[0].partition(".")[0] for one in run.inputs}
    expected = {"strain", "dynamic_pressure"}
    if name in AIR_DATA or inverse_map.manifold is not None:
        expected |= {"mach_number", "altitude"}
        # What the sensors give agrees, to the errors that they have.
        pressure = [
            dynamic_pressure(m, h) for m, h in zip(run.inputs["mach_number"], run.inputs["altitude"], strict=True)
        ]
        np.testing.assert_allclose(pressure, run.inputs["dynamic_pressure"], rtol=0.05)
    if inverse_map.has_temperature:
        expected |= {"temperature", "sensor", "parameter"}
    if inverse_map.manifold is not None and inverse_map.manifold.parameters is not None:
        expected.add("parameter_std")
    assert given == expected


@pytest.mark.parametrize("case", range(2))
@pytest.mark.parametrize("seed", range(4))
def test_maps_of_random_numbers_have_an_example(seed: int, case: int) -> None:
    inverse_map = inside(whole_scaled_map(case + 1, seed=seed, n=24, n_states=5))
    assert is_usual(reference_run(inverse_map))


def test_another_alarm_is_not_usual() -> None:
    run = reference_run(made("case 1"))
    state, suspect = run.outputs["health.state"], run.outputs["health.suspect_gauge"]
    row = np.arange(N_ROWS)
    for change in (
        {"health.state": np.where(row == 5, 1.0, state)},
        {"health.state": np.where(row == N_ROWS - 1, 7.0, state)},
        {"health.state": 0.0 * state},
        {"health.suspect_gauge": 0.0 * suspect},
    ):
        assert not is_usual(replace(run, outputs={**run.outputs, **change}))
    assert is_usual(run)


@pytest.mark.parametrize("name", CASES)
def test_the_motion_stays_inside_what_the_snapshots_cover(name: str) -> None:
    case = made(name)
    flight, states = flight_of_states(case, flight_path(case, N_ROWS)), true_states(case, N_ROWS)
    truth = flight.loads / flight.load_per_coefficient
    low, high = case.coefficient_range.T
    room = 1e-12 * np.maximum(np.abs(low), np.abs(high))
    assert np.all(truth >= low - room)
    assert np.all(truth <= high + room)
    healthy = case.mean_strain + states @ case.state_operator.T
    assert np.all(np.abs(healthy) <= case.strain_range * (1.0 + 1e-12))
    assert np.all(truth @ case.envelope_direction.T <= case.envelope_limit + 1e-12)
    # It moves, and uses a good part of the room.
    assert np.all(np.max(np.abs(states), axis=0)[:2] > 0.2 * largest_states(case)[:2])
    assert np.ptp(truth, axis=0).max() > 0.0


@pytest.mark.parametrize("name", [name for name in MAPS if "tables" in name])
def test_the_flight_stays_inside_the_tables_and_ends_where_it_begins(name: str) -> None:
    inverse_map = MAPS[name]()
    manifold = inverse_map.manifold
    assert manifold is not None
    state = flight_states(manifold, flight_path(inverse_map, N_ROWS))
    np.testing.assert_allclose(state[0], state[-1], rtol=0.0, atol=1e-12)
    for column, (low, high) in ((MACH, manifold.mach_range), (LOG_PRESSURE, np.log(manifold.pressure_range))):
        assert low - 1e-9 <= state[:, column].min() <= state[:, column].max() <= high + 1e-9
    middle, half = manifold.crossflow
    assert np.all(np.abs(state[:, U : W + 1] - middle) <= half)
    assert np.all(np.hypot(state[:, U], state[:, W]) <= manifold.incidence_limit)
    assert np.degrees(np.ptp(state[:, U])) > 0.5


def test_strain_scales_with_the_dynamic_pressure_and_fixed_strain_does_not() -> None:
    """Over all gauges and loads: what is left of a row after its fixed part follows q_inf."""
    case = with_ranges(made("scaled"), (5.0, 7.0), (15e3, 25e3))
    rng = np.random.default_rng(3)
    case = replace(case, fixed_strain=1e-5 * rng.normal(size=case.n_gauges), fixed_load=rng.normal(size=5))
    path = flight_path(case, N_ROWS)
    assert np.ptp(path.dynamic_pressure) > 0.02 * case.nominal_dynamic_pressure
    flight, states = flight_of_states(case, path), true_states(case, N_ROWS)
    ratio = (path.dynamic_pressure / case.nominal_dynamic_pressure)[:, None]
    np.testing.assert_allclose(
        (flight.strain - case.fixed_strain) / ratio,
        case.mean_strain - case.fixed_strain + states @ case.state_operator.T,
        atol=1e-16,
    )
    np.testing.assert_allclose(
        flight.load_per_coefficient, path.dynamic_pressure[:, None] * case.references[FIVE_LOADS], rtol=1e-12
    )


def test_errors_of_strain_have_the_covariance_of_the_map_and_the_loads_theirs() -> None:
    """Over many draws, at one row: strain errors, and the loads that they come with."""
    case = inside(whole_scaled_map(1, seed=4, n=12, n_states=4))
    flight, count = flight_of_states(case, flight_path(case, 2)), 1000
    sample = [flight.sample(seed) for seed in range(count)]
    strain = np.array([one[0] for one, _ in sample]) - flight.strain[0]
    coefficients = np.array([[true[name][0] for name in COEFFICIENTS] for _, true in sample])
    loads = coefficients * flight.load_per_coefficient[0] - flight.loads[0]
    covariance = flight.covariance[0] + np.diag(flight.noise_std**2)
    spread, of_loads = np.sqrt(np.diag(covariance)), np.sqrt(np.mean(loads**2, axis=0))
    for found, stated, size in (
        (strain.T @ strain, covariance, np.outer(spread, spread)),
        (loads.T @ strain, flight.load_strain_covariance[0], np.outer(of_loads, spread)),
    ):
        np.testing.assert_allclose(found / count / size, stated / size, atol=4.0 / np.sqrt(count))


@pytest.mark.parametrize("name", CASES)
def test_errors_follow_the_strain(name: str) -> None:
    """Symmetric, without negative variances; the map's own where no error follows the strain."""
    case = made(name)
    flight = flight_of_states(case, flight_path(case, 3))
    ratio = np.ones(3)
    at = error_covariance(case, flight.loads / flight.load_per_coefficient, ratio)
    np.testing.assert_allclose(at, at.transpose(0, 2, 1), rtol=1e-12, atol=0.0)
    assert np.linalg.eigvalsh(at).min() > -1e-9 * np.abs(at).max()
    if not case.errors_follow_strain:
        np.testing.assert_allclose(at, np.repeat(case.noise_covariance[None], 3, axis=0), rtol=1e-12)


def test_errors_of_many_gauges_by_columns_are_those_by_matrices(monkeypatch: pytest.MonkeyPatch) -> None:
    """Their covariance, and of the loads with them, to 1e-12 of the standard deviations."""
    case = with_ranges(made("scaled"), (5.0, 7.0), (15e3, 25e3))
    monkeypatch.setattr(inverse_map_module, "DENSE_GAUGES", 1)
    case = replace(case, own_error_strain=np.full(case.n_gauges, 1e-5))
    assert case.is_low_rank
    path = flight_path(case, 3)
    flight = flight_of_states(case, path)
    assert flight.basis is not None
    own = np.broadcast_to(flight.own_std, flight.strain.shape)[1] ** 2 + flight.noise_std**2
    covariance = flight.basis @ flight.covariance[1] @ flight.basis.T + np.diag(own)
    ratio = path.dynamic_pressure / case.nominal_dynamic_pressure
    stated = error_covariance(case, flight.loads / flight.load_per_coefficient, ratio)[1]
    std = np.sqrt(np.diag(stated))
    np.testing.assert_allclose(covariance / np.outer(std, std), stated / np.outer(std, std), rtol=0.0, atol=1e-12)
    of_loads = ratio[1] ** 2 * case.strain_load_covariance[:, FIVE_LOADS].T
    size = np.abs(of_loads).max(axis=1, keepdims=True)
    found = flight.load_strain_covariance[1] @ flight.basis.T
    np.testing.assert_allclose(found / size, of_loads / size, rtol=0.0, atol=1e-12)


def test_the_gauge_that_fails_is_one_whose_fault_is_told() -> None:
    """Not one that no other checks, nor one of two that are alike."""
    precision = np.diag([1.0, 4.0, 0.0, 4.0, 2.0])
    precision[1, 3] = precision[3, 1] = 3.9
    gauge, size = failing_gauge(precision)
    assert (gauge, size) == (4, 15.0 / np.sqrt(2.0))


def test_what_states_do_to_strain_is_taken_out_of_its_precision() -> None:
    """The inverse of the covariance across the columns; columns that are alike or zero change nothing."""
    random = np.random.default_rng(3)
    columns, root = random.standard_normal((6, 3)), random.standard_normal((6, 6))
    covariance = root @ root.T + np.eye(6)
    q = np.linalg.qr(columns, mode="complete")[0][:, 3:]
    expected = q @ np.linalg.inv(q.T @ covariance @ q) @ q.T
    scaled = columns * [1.0, 1e4, 1e-6]
    np.testing.assert_allclose(free_precision(covariance, scaled), expected, atol=1e-12)
    alike = np.column_stack([scaled, 3.0 * columns[:, 0], np.zeros(6)])
    np.testing.assert_allclose(free_precision(covariance, alike), expected, atol=1e-12)


def test_the_run_is_in_its_file_to_the_last_digit() -> None:
    """Outputs belong to what the file holds."""
    case = MAPS["altitudes"]()
    run = reference_run(case)
    written = columns(signal_table(run.time, run.inputs, estimator_interface(case)))
    assert {name: values.tolist() for name, values in written.items()} == {
        "time": run.time.tolist(),
        **{name: values.tolist() for name, values in run.inputs.items()},
    }
    strain = [values[-2] for name, values in run.inputs.items() if name.startswith("strain[")]
    flow = {name: run.inputs[name][-2] for name in ("dynamic_pressure", "mach_number", "altitude")}
    assert run.outputs["C_N"][-1] == Estimator(case).step(strain, **flow).coefficients[1]


def test_altitude_of_a_pressure() -> None:
    for altitude in (0.0, 11e3, 20e3, 70e3):
        assert altitude_of(pressure_and_temperature(altitude)[0]) == pytest.approx(altitude, abs=1e-3)
    assert altitude_of(2e5) == pytest.approx(0.0, abs=1e-3)
    assert altitude_of(1e-3) == pytest.approx(71e3, abs=1e-3)


def test_an_importer_records_at_the_end_of_a_step() -> None:
    assert as_recorded(np.array([3, 1, 4, 1])).tolist() == [3, 3, 1, 4]


def test_a_flight_without_ranges_is_at_the_nominal_dynamic_pressure() -> None:
    case = made("case 1")
    readings = reference_readings(case, 5)
    assert set(readings.known) == {"dynamic_pressure"}
    np.testing.assert_allclose(readings.known["dynamic_pressure"], case.nominal_dynamic_pressure, rtol=0.01)
