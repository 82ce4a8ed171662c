"""Hosts with a floating-point environment of their own: no exception reaches them, no bit follows them."""

import platform
import subprocess
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest
from c_host import program_by_zig
from flight_fmu import random_flight, whole_map
from other_load_maps import with_further_tables
from platforms import LINUX
from random_map import random_map
from raw_fmu import GUID, write_resource
from scaled_maps import NOMINAL, whole_scaled_map
from thermal_maps import REFERENCE, with_temperature

from strainfmu.estimator.health import HealthState
from strainfmu.estimator.map.inverse_map import InverseMap
from strainfmu.estimator.signal_names import FILTER_TIME_CONSTANT
from strainfmu.estimator.tare import TareState
from strainfmu.fmu.native.build import library_file
from strainfmu.interface.estimator_variables import estimator_interface
from strainfmu.interface.fmi_variables import Variable

pytest.importorskip("ziglang", reason="needs zig: pip install 'strainfmu[native]'")
pytestmark = [
    pytest.mark.fast,
    pytest.mark.skipif(
        (platform.system(), platform.machine()) != ("Linux", "x86_64"), reason="needs glibc and Linux on x86-64"
    ),
]

HOST = Path(__file__).parent / "traps.c"
STEPS, WINDOW = 420, range(120, 200)
"""Steps, and those in which a tare is asked for, at rest."""

HOSTILE = np.array(
    [
        np.nan,
        0.0,
        -0.0,
        5e-324,
        -5e-324,
        2.3e-308,
        1e-300,
        1e300,
        -1e300,
        1.7e308,
        -1.7e308,
        1e154,
        -1e154,
        1.0,
        -1.0,
    ]
)


def warm(held: InverseMap) -> InverseMap:
    """``held`` with temperature modes that strain little."""
    small = {"mode_strain": 1e-9 * np.ones((held.n_gauges, 3)), "apparent_strain": np.array([1e-9, -1e-12])}
    return with_temperature(held, k=3, n_t=2, **small)


MAPS: dict[str, Callable[[], InverseMap]] = {
    "absolute": random_map,
    "scaled": lambda: warm(whole_scaled_map(1, seed=3, n=12, n_states=3)),
    "nonlinear": lambda: warm(with_further_tables(whole_map())),
}


def plausible(held: InverseMap, inputs: list[Variable], random: np.random.Generator) -> np.ndarray:
    """(STEPS, n) values of real inputs and settings as a host gives them in a flight."""
    rows = np.array([[float(one.start or 0.0) for one in inputs]] * STEPS)
    place = {one.name: k for k, one in enumerate(inputs)}
    n = held.n_gauges
    if held.manifold is None:
        rows[:, :n] = held.mean_strain + held.noise_std * random.normal(size=(STEPS, n))
        flow = {
            "dynamic_pressure": np.full(STEPS, NOMINAL),
            "mach_number": 6.0 * (np.arange(STEPS) % 8 > 4),
            "altitude": 20e3,
        }
    else:
        flight = random_flight(held, STEPS, seed=1)
        rows[:, :n] = [one.strain for one in flight]
        flow = {name: np.array([one.flow[name] for one in flight]) for name in flight[0].flow}
    for name, values in flow.items():
        rows[:, place[name]] = values
    for name in place.keys() & {"temperature[1]", "temperature[2]"}:
        rows[:, place[name]] = REFERENCE + random.normal(size=STEPS)
    if FILTER_TIME_CONSTANT in place:
        rows[210:300, place[FILTER_TIME_CONSTANT]] = 0.5
    rows[40:60, :n] = np.repeat([0.0, np.nan], 10)[:, None]
    rows[WINDOW, :n] = 1e-5 * random.normal(size=n) + 1e-8 * random.normal(size=(len(WINDOW), n))
    rows[WINDOW, place["dynamic_pressure"]] = 0.0
    return rows


def spoiled(rows: np.ndarray, random: np.random.Generator) -> np.ndarray:
    """Some steps with one value that no host should give, some with many, some with nothing else."""
    for k in range(len(rows)):
        part = (0.0, 1.0 / rows.shape[1], 0.3, 1.0)[k % 4]
        if k not in WINDOW:
            where = random.random(rows.shape[1]) < part
            rows[k, where] = random.choice(HOSTILE, np.count_nonzero(where))
    return rows


@dataclass(frozen=True, eq=False)
class Case:
    """A map's resources, and the file of inputs for the host."""

    uri: str
    inputs: Path
    outputs: list[str]
    whole: list[str]


@pytest.fixture(params=MAPS)
def case(request: pytest.FixtureRequest, tmp_path: Path) -> Case:
    held, random = MAPS[request.param](), np.random.default_rng(7)
    variables = list(enumerate(estimator_interface(held)))
    settable = [(k, one) for k, one in variables if one.causality in ("input", "parameter")]
    reals = [(k, one) for k, one in settable if one.fmi_type == "Real"]
    flags = [(k, one) for k, one in settable if one.fmi_type == "Boolean"]
    read = [(k, one) for k, one in variables if one.causality in ("output", "local")]
    none = ("zero_std", "zero_common_std", FILTER_TIME_CONSTANT)
    lists = (
        [k for k, _ in reals],
        [k for k, one in reals if not one.name.startswith(none)],
        [k for k, _ in flags],
        [k for k, one in read if one.fmi_type == "Real"],
        [k for k, one in read if one.fmi_type in ("Integer", "Enumeration")],
        [k for k, one in read if one.fmi_type == "Boolean"],
    )
    values = spoiled(plausible(held, [one for _, one in reals], random), random)
    given = np.ones((STEPS, len(flags)))
    given[::3] = random.random((len(given[::3]), len(flags))) > 0.1
    tare = [one.name for _, one in flags].index("tare")
    given[:, tare] = np.isin(np.arange(STEPS), WINDOW)
    head = [*map(len, lists), STEPS, *(k for one in lists for k in one)]
    path = tmp_path / "inputs.bin"
    path.write_bytes(np.array(head, dtype="<f8").tobytes() + np.hstack([values, given]).astype("<f8").tobytes())
    names = [[variables[k][1].name for k in one] for one in lists[3:5]]
    return Case(write_resource(held, tmp_path).as_uri(), path, *names)


@pytest.fixture(scope="module")
def host(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return program_by_zig(
        LINUX, tmp_path_factory.mktemp("traps") / "traps", [HOST], "-frounding-math", "-lm", "-ldl"
    )


def replayed(host: Path, case: Case, mode: str) -> bytes:
    """What the host writes in an environment."""
    command = [str(host), str(library_file("linux64")), GUID, case.uri, mode, str(case.inputs)]
    done = subprocess.run(command, capture_output=True, check=False)
    assert done.returncode == 0, (done.returncode, done.stderr.decode()[-1000:])
    return done.stdout


def test_no_exception_reaches_the_host_and_no_bit_follows_it(host: Path, case: Case) -> None:
    """Traps of invalid operations, divisions by zero, overflows; rounding upwards, subnormal numbers as zero."""
    plain = replayed(host, case, "plain")
    assert replayed(host, case, "traps") == plain
    assert replayed(host, case, "other") == plain
    found = np.frombuffer(plain).reshape(STEPS, -1)
    whole = dict(zip(case.whole, found[:, len(case.outputs) :].T, strict=False))
    seen = {HealthState(int(one)) for one in np.unique(whole["health.state"])}
    assert {HealthState.OK, HealthState.INVALID, HealthState.INCONSISTENT, HealthState.DEGRADED} <= seen
    assert TareState.DONE in whole["tare_state"]
