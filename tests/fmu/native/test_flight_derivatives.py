"""Derivatives of the nonlinear estimator's values: against differences of its own outputs, of another step."""

import ctypes
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from flight_fmu import (
    FILTER,
    FIRST,
    N_D,
    N_INPUTS,
    N_REALS,
    FlightFmu,
    FlightSample,
    random_flight,
)
from other_load_maps import STATIONS, with_further_tables
from raw_fmu import DISCARD, ERROR, N_OUTPUTS, N_SCALARS, OK, SETTINGS, VALUES, Fmu3, write_resource
from thermal_maps import REFERENCE, with_temperature

from strainfmu.estimator.air_inputs import QSource
from strainfmu.estimator.map.inverse_map import InverseMap

pytestmark = pytest.mark.fast

SCALARS = N_OUTPUTS + 2 * N_D
"""Value reference of q_inf; then its deviation, M, altitude, settings."""

ZEROS, Q_SOURCE = FIRST + N_INPUTS + N_REALS + 11, FILTER + 2 * N_D + 6
KNOWNS = [
    *range(N_OUTPUTS, N_OUTPUTS + N_D),
    *range(SCALARS, SCALARS + N_SCALARS),
    *range(FIRST, FIRST + N_INPUTS),
    *range(ZEROS, ZEROS + N_D),
]
"""Strains, scalars, deviation of M, p_inf and its deviation, zeros."""

OF_REFERENCES = slice(N_D + 6, N_D + 9)
"""Places in :data:`KNOWNS` of reference area, reference length and moment point."""

FLOW = tuple(
    f"{name}{end}" for name in ("mach_number", "static_pressure", "dynamic_pressure") for end in ("", "_std")
)
ZERO_ARRAY = 24 + N_INPUTS + N_REALS + 11
"""Value reference of FMI 3.0 of the zeros."""

UNKNOWNS = [*VALUES, *range(FIRST + N_INPUTS, FIRST + N_INPUTS + 7)]
"""Coefficients, loads, air data."""

UNITS = ((0, 3), (3, 5), (5, 8), (8, 10), (10, 14), (14, 15), (15, 16), (16, 17))
"""Of them those of one unit."""

ENDED = 40
"""Steps after which a repeated sample changes nothing any more."""

Flow = dict[str, float]


def sample_of(inverse_map: InverseMap, seed: int, left_out: tuple[str, ...] = (), **more: float) -> FlightSample:
    """A sample with noise and a lost gauge, navigation without ``left_out``."""
    sample = random_flight(inverse_map, 1, seed)[0]
    flow = {name: value for name, value in sample.flow.items() if name not in left_out} | more
    return replace(sample, valid=np.arange(N_D) != seed, flow=flow)


def ended(fmu: FlightFmu, unknowns: Sequence[int] = UNKNOWNS) -> np.ndarray:
    """Real outputs once the iterations have ended."""
    for _ in range(ENDED):
        assert fmu.step() == OK
    return fmu.get_reals(unknowns)


def by_group(values: np.ndarray) -> list[np.ndarray]:
    """Real outputs of one unit each."""
    return [values[first:end] for first, end in UNITS]


def sizes(fmu: FlightFmu) -> np.ndarray:
    """Changes of the inputs whose effects are of one order; 0 of those that are not known."""
    given = fmu.get_reals(KNOWNS)
    size = np.concatenate(
        [np.full(N_D, 2e-7), [1e3, 300.0, 0.05, 50.0, 0.0, 0.1, 0.01, 0.02, 0.05, 0.01, 50.0, 20.0]]
    )
    return np.where(given == 0.0, 0.0, np.concatenate([size, np.full(N_D, 2e-7)]))


NAVIGATION: dict[str, tuple[tuple[str, ...], Flow]] = {
    "all": ((), {}),
    "deviations": ((), {"dynamic_pressure_std": 900.0, "mach_number_std": 0.04, "static_pressure_std": 300.0}),
    "altitude": (("static_pressure", "mach_number"), {"altitude": 13e3, "static_pressure_std": 2e3}),
    "tiny deviations": (("mach_number",), {"dynamic_pressure_std": 10.0}),
    "static pressure": (("mach_number", "dynamic_pressure"), {}),
}


def of_further(values: np.ndarray) -> list[np.ndarray]:
    """Other loads of one unit each: M_R and rolling moment, forces, moments."""
    k = 3 * len(STATIONS)
    return [values[[0]], values[[1]], *np.split(values[2:], [k])]


def check_directions(
    fmu: FlightFmu,
    knowns: list[int],
    directions: list[np.ndarray],
    unknowns: Sequence[int] = UNKNOWNS,
    groups: Callable[[np.ndarray], list[np.ndarray]] = by_group,
) -> None:
    """Assert that derivatives along ``directions`` of ``knowns`` are the differences of outputs, each once the
    iterations have ended: to 1e-6, and to what rounding leaves of differences."""
    ended(fmu)
    state, centre = fmu.get_state(), fmu.get_reals(knowns)
    for direction in directions:
        exact = fmu.derivative(unknowns, knowns, direction)
        sides = []
        for h in (0.01, -0.01, 0.02, -0.02):
            assert fmu.call("SetFMUstate", state) == OK
            moved = np.where(direction == 0.0, centre, centre + h * direction)
            assert fmu.set_reals(knowns, moved) == OK
            sides.append(ended(fmu, unknowns))
        assert fmu.call("SetFMUstate", state) == OK
        near, far = (sides[0] - sides[1]) / 0.02, (sides[2] - sides[3]) / 0.04
        parts = (groups(one) for one in (exact, (4.0 * near - far) / 3.0, sides[0]))
        for group, (found, difference, value) in enumerate(zip(*parts, strict=True)):
            error, allowed = np.abs(found - difference).max(), 1e-6 * np.linalg.norm(difference)
            assert error <= allowed + 1e-11 * np.linalg.norm(value), (group, found, difference)


@pytest.mark.parametrize("case", NAVIGATION)
@pytest.mark.parametrize("seed", [1, 3])
def test_against_differences_of_its_own_outputs(
    fmu: FlightFmu, inverse_map: InverseMap, seed: int, case: str
) -> None:
    fmu.give(sample_of(inverse_map, seed, NAVIGATION[case][0], **NAVIGATION[case][1]))
    assert fmu.set_scalars(SETTINGS + 1, 1.3, 0.25, 0.6, 0.4) == OK
    size, random = sizes(fmu), np.random.default_rng(seed)
    directions = [size * random.normal(size=len(size)) for _ in range(2)]
    alone = [size * (np.arange(len(size)) == k) for k in range(N_D, N_D + N_SCALARS + N_INPUTS)]
    check_directions(fmu, KNOWNS, directions + [one for one in alone if one.any()])


def test_navigation_that_is_dropped(fmu: FlightFmu, inverse_map: InverseMap) -> None:
    sample = sample_of(inverse_map, 1)
    fmu.give(replace(sample, flow=sample.flow | {"static_pressure": 2.0 * sample.flow["static_pressure"]}))
    assert fmu.set_integers([Q_SOURCE], [QSource.INDEPENDENT]) == OK
    assert fmu.step() == OK
    assert fmu.all_outputs()[-4:-1].tolist() == [1.0, 0.0, 1.0]
    assert np.all(fmu.derivative(UNKNOWNS, [FIRST + 1], [1.0]) == 0.0)
    check_directions(fmu, KNOWNS, [sizes(fmu)])


@pytest.mark.parametrize("case", ["deviations", "static pressure"])
def test_section_loads(inverse_map: InverseMap, tmp_path: Path, case: str) -> None:
    fmu = FlightFmu(write_resource(with_further_tables(inverse_map), tmp_path).as_uri(), N_D)
    fmu.start()
    fmu.give(sample_of(inverse_map, 1, NAVIGATION[case][0], **NAVIGATION[case][1]))
    assert fmu.set_scalars(SETTINGS + 1, 1.3, 0.25, 0.6, 0.4) == OK
    first, sections = FILTER + 1, range(FILTER + 5, FILTER + 5 + 6 * len(STATIONS))
    further = [first, first + 2, *sections]
    size, random = sizes(fmu), np.random.default_rng(4)
    directions = [size * random.normal(size=len(size)) for _ in range(2)]
    alone = [size * (np.arange(len(size)) == k) for k in range(N_D, N_D + N_SCALARS + N_INPUTS)]
    check_directions(fmu, KNOWNS, directions + [one for one in alone if one.any()], further, of_further)
    assert np.all(fmu.derivative(further, KNOWNS, directions[0])[2:] != 0.0)
    fmu.free()


def test_along_temperatures(inverse_map: InverseMap, tmp_path: Path) -> None:
    noise = float(np.sqrt(np.median(np.diag(inverse_map.gauge_covariance))))
    strain = 0.1 * noise * np.random.default_rng(3).normal(size=(N_D, 6))
    sheet = noise * np.array([2e-2, -1e-4])
    held = with_temperature(inverse_map, mode_strain=strain, apparent_strain=sheet)
    fmu = FlightFmu(write_resource(held, tmp_path).as_uri(), N_D)
    fmu.start()
    fmu.give(sample_of(inverse_map, 1))
    sensors = list(range(ZEROS + 2 * N_D + 1, ZEROS + 2 * N_D + 1 + 4))
    assert fmu.set_reals(sensors, REFERENCE + np.array([0.5, -0.2, 0.3, 0.4])) == OK
    check_directions(fmu, [*KNOWNS, *sensors], [np.append(np.zeros(len(KNOWNS)), [0.2, 0.1, -0.3, 0.2])])
    fmu.free()


def test_fmi_3_directional_and_adjoint(fmu: FlightFmu, resources: Path, inverse_map: InverseMap) -> None:
    sample = sample_of(inverse_map, 1)
    fmu.give(sample)
    third = Fmu3(str(resources), N_D).start()
    knowns = [third.STRAIN, *third.SCALARS, *range(24, 24 + N_INPUTS), ZERO_ARRAY]
    unknowns = [0, 2, 3, *range(24 + N_INPUTS, 24 + N_INPUTS + 7)]
    values = fmu.get_reals(KNOWNS)
    assert third.set("Float64", ctypes.c_double, knowns, values) == OK
    assert third.set("Boolean", ctypes.c_bool, [third.VALID], sample.valid.tolist()) == OK
    random = np.random.default_rng(7)
    direction, weight = sizes(fmu) * random.normal(size=len(KNOWNS)), random.normal(size=len(UNKNOWNS))
    status, forward = third.differentiate("Directional", unknowns, knowns, direction, len(UNKNOWNS))
    assert status == OK, third.messages
    assert forward.tobytes() == fmu.derivative(UNKNOWNS, KNOWNS, direction).tobytes()
    status, backward = third.differentiate("Adjoint", unknowns, knowns, weight, len(KNOWNS))
    assert status == OK, third.messages
    assert abs(weight @ forward - backward @ direction) <= 1e-6 * np.abs(backward * direction).sum()
    for kind, seed in (("Directional", direction), ("Adjoint", weight)):
        wrong = third.differentiate(kind, [*unknowns[:-1], third.STRAIN], knowns, seed, len(KNOWNS))
        assert wrong[0] == ERROR
    third.free()


def refused(fmu: FlightFmu) -> str:
    """What the library says where it has no derivatives."""
    fmu.messages.clear()
    status = fmu.call(
        "GetDirectionalDerivative",
        *(fmu.references([0]), ctypes.c_size_t(1), fmu.references([N_OUTPUTS]), ctypes.c_size_t(1)),
        *((ctypes.c_double * 1)(1.0), (ctypes.c_double * 1)(0.0)),
    )
    assert status == DISCARD
    return fmu.messages[-1][2]


@pytest.mark.parametrize("time_constant", [0.0, 0.5])
def test_the_estimator_is_left_as_it_was(fmu: FlightFmu, inverse_map: InverseMap, time_constant: float) -> None:
    samples = random_flight(inverse_map, 4, seed=2)
    assert fmu.filter(time_constant) == OK
    for k, sample in enumerate(samples):
        fmu.advance(sample, 0.01 * k, 0.01)
    for navigation in ({"mach_number": 0.0}, {}):
        fmu.give(replace(samples[-1], flow=samples[-1].flow | navigation))
        before, state = fmu.all_outputs().tobytes(), fmu.serialise(fmu.get_state())
        fmu.derivative(UNKNOWNS, KNOWNS, sizes(fmu))
        assert fmu.serialise(fmu.get_state()) == state
        assert fmu.all_outputs().tobytes() == before


def test_with_the_filter_on_they_are_those_of_the_step(fmu: FlightFmu, inverse_map: InverseMap) -> None:
    """What the steps before left is held; other references and moment points would begin again."""
    sample = random_flight(inverse_map, 1, seed=2)[0]
    assert fmu.filter(0.5) == OK
    for k in range(6):
        fmu.advance(sample, 0.01 * k, 0.01)
    state = fmu.get_state()
    fmu.give(sample)
    centre, direction = fmu.get_reals(KNOWNS), sizes(fmu) * np.random.default_rng(1).normal(size=len(KNOWNS))
    direction[OF_REFERENCES] = 0.0
    found, sides = fmu.derivative(UNKNOWNS, KNOWNS, direction), []
    for h in (0.01, -0.01):
        assert fmu.call("SetFMUstate", state) == OK
        assert fmu.set_reals(KNOWNS, np.where(direction == 0.0, centre, centre + h * direction)) == OK
        sides.append(fmu.get_reals(UNKNOWNS))
    for ours, one, other in zip(*map(by_group, (found, *sides)), strict=True):
        difference = (one - other) / 0.02
        assert np.abs(ours - difference).max() <= 1e-5 * np.linalg.norm(difference)


def test_of_the_linear_map_where_strain_fits_no_tables(fmu: FlightFmu, inverse_map: InverseMap) -> None:
    sample = sample_of(inverse_map, 1)
    fmu.give(replace(sample, strain=sample.strain + 1e-5 * (np.arange(N_D) == 5)))
    assert fmu.step() == OK
    assert fmu.all_outputs()[-1] == 1.0
    gauges = range(N_OUTPUTS, N_OUTPUTS + N_D)
    direction = 1e-7 * np.random.default_rng(1).normal(size=N_D)
    centre = fmu.get_reals(gauges)
    found, sides = fmu.derivative(VALUES, gauges, direction), []
    for h in (1.0, -1.0):
        assert fmu.set_reals(gauges, centre + h * direction) == OK
        sides.append(fmu.get_reals(VALUES))
    for first, end in UNITS[:4]:
        difference = 0.5 * (sides[0] - sides[1])[first:end]
        assert np.abs(found[first:end] - difference).max() <= 1e-6 * np.linalg.norm(difference)


def test_refused_where_the_iterations_do_not_end(fmu: FlightFmu, inverse_map: InverseMap) -> None:
    sample = sample_of(inverse_map, 1)
    assert fmu.set_scalars(SETTINGS + 1, 1e9) == OK
    fmu.give(replace(sample, strain=-100.0 * sample.strain, flow={"static_pressure": 1e6}))
    assert "iterations do not end" in refused(fmu)


def test_nothing_known(fmu: FlightFmu, inverse_map: InverseMap) -> None:
    fmu.give(replace(sample_of(inverse_map, 1), valid=np.zeros(N_D, dtype=bool)))
    assert np.isnan(fmu.derivative(UNKNOWNS, KNOWNS, np.ones(len(KNOWNS)))).all()


def test_variables_without_derivative(fmu: FlightFmu) -> None:
    flag = FIRST + N_INPUTS + N_REALS
    for unknown, known in (
        *((k, N_OUTPUTS) for k in (5, 15, 20, 21, 26, FIRST + N_INPUTS + 7, flag)),
        (0, FILTER),
        (0, ZEROS + N_D),
        (0, N_OUTPUTS + N_D),
    ):
        with pytest.raises(AssertionError):
            fmu.derivative([unknown], [known], [1.0])
        assert "GetDirectionalDerivative" in fmu.messages[-1][2]
