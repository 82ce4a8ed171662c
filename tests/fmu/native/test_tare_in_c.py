"""A tare by its input in the native library: the zeros of a window at once, what is refused, and its state."""

import zlib
from collections.abc import Sequence
from ctypes import byref, c_bool, c_double, c_int, c_int64, c_size_t
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from agreement import assert_same, estimated, random_samples, strain_at
from flight_fmu import FIRST, N_D, FlightFmu, random_flight, whole_map
from native_case import NativeCase
from raw_fmu import ERROR, OK, VALUES, Fmu2, Fmu3, first_zero, of_filter, write_resource

from strainfmu.estimator.estimator import Estimator
from strainfmu.estimator.gauge_zeros import GaugeZeros
from strainfmu.estimator.map.inverse_map import InverseMap
from strainfmu.estimator.tare import TareState

pytestmark = pytest.mark.fast

AGREED = 1e-12

RENEWAL = 80
"""Steps in which the matrices for the zeros of a tare are made."""


def readings(held: InverseMap, n: int, seed: int = 0) -> np.ndarray:
    """(n, n_d) of random zeros; noise in common, readings missing, one gauge slow, one that does not read."""
    random, noise = np.random.default_rng(seed), held.noise_std
    strain = 1e-4 * random.normal(size=held.n_gauges) + noise * random.normal(size=(n, held.n_gauges))
    strain += np.median(noise) * random.normal(size=(n, 1))
    for k in range(1, n):
        strain[k, 1] += 0.5 * (strain[k - 1, 1] - strain[0, 1])
    strain[random.random(strain.shape) < 0.01] = np.nan
    strain[:, 4] = random.choice([np.nan, 1e3], size=n)
    return strain


def first_tare(held: InverseMap) -> int:
    """Value reference of the input of a map without tables, sensors and other loads."""
    return first_zero(held.n_gauges) + 2 * held.n_gauges + 1 + of_filter(held)


class Tared:
    """An instance of FMI 2.0, and the readings of the window that it sees."""

    def __init__(self, fmu: Fmu2, held: InverseMap, at: int) -> None:
        self.fmu, self.held, self.at, self.window = fmu, held, at, list[np.ndarray]()

    def ask(self, value: bool) -> None:
        content = (c_int * 1)(value)
        assert self.fmu.call("SetBoolean", self.fmu.references([self.at]), c_size_t(1), content) == OK

    @property
    def state(self) -> TareState:
        return TareState(int(self.fmu.get_integers([self.at + 1])[0]))

    @property
    def zeros(self) -> np.ndarray:
        return self.fmu.get_reals(range(self.at + 2, self.at + 2 + 2 * self.held.n_gauges + 1))

    def step(self, strain: np.ndarray, pressure: float = 0.0, *, asked: bool = True) -> None:
        """One step with these inputs."""
        self.ask(asked)
        self.fmu.set_strain(strain)
        assert self.fmu.set_scalars(0, pressure) == OK
        assert self.fmu.step() == OK
        if asked:
            self.window.append(np.where(np.abs(strain) <= 0.05, strain, np.nan))

    def take(self, strain: np.ndarray, pressure: float = 0.0) -> None:
        """A window, or the rest of one, and the step behind it."""
        if self.state != TareState.AVERAGING:
            self.window = []
        for row in strain:
            self.step(row, pressure)
        self.step(strain[-1], pressure, asked=False)
        self.settle(strain[-1], pressure)

    def settle(self, strain: np.ndarray, pressure: float = 0.0) -> None:
        """Steps until the zeros are in use."""
        for _ in range(RENEWAL):
            self.step(strain, pressure, asked=False)

    def check(self) -> GaugeZeros:
        """The zeros are those of the window; the latter."""
        zeros = Estimator(self.held).tare(np.array(self.window), 0.0).zeros
        n, ours = self.held.n_gauges, self.zeros
        for part, expected in ((ours[:n], zeros.value), (ours[n : 2 * n], zeros.std)):
            np.testing.assert_allclose(part, expected, rtol=AGREED, atol=AGREED * np.median(self.held.noise_std))
        assert ours[2 * n] == pytest.approx(zeros.common_std, rel=1e-10)
        return zeros

    def used(self) -> GaugeZeros:
        """The zeros of the FMU."""
        n = self.held.n_gauges
        return GaugeZeros(value=self.zeros[:n], std=self.zeros[n : 2 * n], common_std=float(self.zeros[2 * n]))


def tared(case: NativeCase, **options: bool) -> Tared:
    return Tared(Fmu2(case.uri, case.n, **options).start(), case.inverse_map, first_tare(case.inverse_map))


@pytest.mark.parametrize("n", [64, 300])
def test_zeros_of_the_window_and_outputs_with_them(case: NativeCase, n: int) -> None:
    one, held = tared(case), case.inverse_map
    assert not one.zeros.any()
    one.take(readings(held, n))
    assert one.state == TareState.DONE
    zeros = one.check()
    estimator = Estimator(held).with_zeros(one.used())
    for sample in random_samples(held, 12, seed=5):
        moved = replace(sample, strain=sample.strain + zeros.value)
        one.fmu.set_strain(moved.strain)
        one.fmu.set_valid(sample.valid)
        assert one.fmu.set_scalars(0, *sample.flow) == OK
        assert_same(one.fmu.outputs(), estimated(estimator, moved))


def test_the_nonlinear_estimator_flies_as_with_zeros_of_the_host(tmp_path: Path) -> None:
    held = whole_map()
    location, strain = write_resource(held, tmp_path).as_uri(), readings(held, 100)
    one, other = (Tared(FlightFmu(location, N_D), held, FIRST + 28 + 2 * N_D + 1 + 1) for _ in range(2))
    one.fmu.start()
    one.take(strain)
    one.check()
    other.fmu.start()
    for row in strain:
        other.step(row, asked=False)
    assert other.fmu.set_reals(range(FIRST + 28, FIRST + 28 + 2 * N_D + 1), one.zeros) == OK
    other.step(strain[-1], asked=False)
    other.settle(strain[-1])
    assert other.zeros.tobytes() == one.zeros.tobytes()
    for sample in random_flight(held, 6, seed=3):
        moved = replace(sample, strain=sample.strain + one.zeros[:N_D])
        ours, theirs = (each.fmu.advance(moved) for each in (one, other))
        assert np.isfinite(ours[:20]).all()
        assert ours.tobytes() == theirs.tobytes()


REFUSED = [
    ("no dynamic pressure", lambda strain: (strain, np.nan)),
    ("dynamic pressure is -101 Pa, expected at most 100 Pa", lambda strain: (strain, -101.0)),
    ("window: expected at least 64 steps, got 50", lambda strain: (strain[:50], 0.0)),
    (
        "readings drift: gauge 1 by 49",
        lambda s: (s + np.linspace(0, 5e-5, len(s))[:, None] * np.eye(s.shape[1])[0], 0.0),
    ),
    (
        "readings move: gauge 3 by",
        lambda s: (s + 1e-4 * (np.arange(len(s)) % 3)[:, None] * np.eye(s.shape[1])[2], 0.0),
    ),
    ("no plausible zero: gauge 8 reads 3", lambda s: (s + 3e-3 * np.eye(s.shape[1])[7], 0.0)),
    ("4 of 54 gauges read", lambda s: (np.where(np.arange(s.shape[1]) > 4, np.nan, s), 0.0)),
]


@pytest.mark.parametrize(("text", "change"), REFUSED, ids=[text for text, _ in REFUSED])
def test_refused_zeros_are_as_before(cases: dict[str, NativeCase], text: str, change: object) -> None:
    one = tared(cases["case 1"], logging=True)
    one.take(readings(one.held, 100))
    before = one.zeros
    assert callable(change)
    strain, pressure = change(readings(one.held, 300, seed=1))
    one.take(strain, pressure)
    assert one.state == TareState.REFUSED
    assert one.zeros.tobytes() == before.tobytes()
    said = [line for _, _, line in one.fmu.messages if line.startswith("tare")]
    assert said[0].startswith("tare taken: 53 zeros from 100 steps, rms ")
    assert len(said) == 2
    assert said[1].startswith("tare refused: ")
    assert text in said[1]
    assert said[1].endswith("; zeros as before")


def test_readings_like_a_load_are_refused(cases: dict[str, NativeCase]) -> None:
    one = tared(cases["case 1"], logging=True)
    noise = readings(one.held, 100)
    one.take(noise - np.nanmean(noise, axis=0) + 30.0 * strain_at(one.held, 1e5))
    assert one.state == TareState.REFUSED
    assert "readings look like load" in one.fmu.messages[-1][2]


def test_other_zeros_of_the_host_count_again(small: NativeCase) -> None:
    one = tared(small)
    given, n = range(first_zero(small.n), first_zero(small.n) + 2 * small.n + 1), small.n
    one.take(readings(one.held, 100))
    taken = one.zeros
    assert one.fmu.set_reals(given, np.zeros(2 * n + 1)) == OK  # what they are
    assert one.zeros.tobytes() == taken.tobytes()
    assert not one.fmu.get_reals(given).any()
    assert one.fmu.set_reals(given[:1], [1e-5]) == OK
    assert one.state == TareState.IDLE
    one.settle(np.zeros(n))
    assert one.zeros.tolist() == [1e-5, *[0.0] * (2 * n)]


def test_derivatives_by_zeros_are_those_of_zeros_in_use(small: NativeCase) -> None:
    one = tared(small)
    zeros, direction = range(first_zero(small.n), first_zero(small.n) + small.n), np.ones(small.n)
    one.fmu.set_strain(one.held.mean_strain)
    assert one.fmu.set_scalars(0, 1e5) == OK
    assert one.fmu.derivative(VALUES, zeros, direction).any()
    one.take(readings(one.held, 100))
    assert one.fmu.set_scalars(0, 1e5) == OK
    assert not one.fmu.derivative(VALUES, zeros, direction).any()


def test_a_state_within_a_window_goes_on_in_another_instance(small: NativeCase) -> None:
    one, other = tared(small), tared(small)
    strain = readings(one.held, 200)
    for row in strain[:90]:
        one.step(row)
    status, state = other.fmu.deserialise(one.fmu.serialise(one.fmu.get_state()))
    assert status == OK
    assert other.fmu.call("SetFMUstate", state) == OK
    assert other.state == TareState.AVERAGING
    other.window = [*one.window]
    for each in (one, other):
        each.take(strain[90:])
        each.check()
    assert one.zeros.tobytes() == other.zeros.tobytes()
    assert one.fmu.outputs().tobytes() == other.fmu.outputs().tobytes()


@pytest.mark.parametrize(
    "wrong", [(0, 4.0), (1, 0.5), (2, 2.0), (3, -1.0), (4, 1.0), (5, 0.0), (6, 32.0), (7, 1.0), (8, 0.06)]
)
def test_a_state_that_cannot_be_is_refused(small: NativeCase, wrong: tuple[int, float]) -> None:
    one = tared(small)
    one.take(readings(one.held, 64))
    content = bytearray(one.fmu.serialise(one.fmu.get_state()))
    begin = content.index(one.zeros[: small.n].tobytes()) - 8 * 8  # flags, then zeros
    place, value = wrong
    content[begin + 8 * place : begin + 8 * place + 8] = np.float64(value).tobytes()
    content[12:16] = np.uint32(zlib.crc32(content[16:])).tobytes()
    assert one.fmu.deserialise(bytes(content))[0] == ERROR
    assert "holds a tare that cannot be" in one.fmu.messages[-1][2]


def test_arrays_of_fmi_3(small: NativeCase) -> None:
    two, three = tared(small), Fmu3(str(small.resources), small.n).start()
    strain, tare = readings(small.inverse_map, 80), Fmu3.TARE + of_filter(small.inverse_map)
    flags, reached = [c_bool(True) for _ in range(3)], c_double(0.0)
    two.take(strain)
    for row, asked in [*((row, True) for row in strain), *[(strain[-1], False)] * (1 + RENEWAL)]:
        assert three.set("Boolean", c_bool, [tare], [asked]) == OK
        assert three.get("Boolean", c_bool, [tare], 1)[1].tolist() == [asked]
        assert three.set("Float64", c_double, [Fmu3.STRAIN, 15], [*row, 0.0]) == OK
        assert (
            three.call("DoStep", c_double(0.0), c_double(0.1), c_bool(True), *map(byref, flags), byref(reached))
            == OK
        )
    assert three.get("Int64", c_int64, [tare + 1], 1)[1].tolist() == [TareState.DONE]
    references = [tare + 2, tare + 3, tare + 4]
    assert three.get("Float64", c_double, references, 2 * small.n + 1)[1].tobytes() == two.zeros.tobytes()


def solver_step(fmu: Fmu2, tare: Tared, strain: Sequence[float]) -> bool:
    """A step of a solver with these strains; whether an event follows."""
    event, end = c_int(0), c_int(0)
    fmu.set_strain(np.asarray(strain))
    assert fmu.call("CompletedIntegratorStep", c_int(1), byref(event), byref(end)) == OK
    return bool(event.value)


def test_model_exchange_takes_it_by_events(small: NativeCase) -> None:
    other = tared(small)
    strain = readings(small.inverse_map, 80)
    other.take(strain)
    one = tared(small, co_simulation=False)
    info = (c_int * 16)()

    def event(asked: bool) -> None:
        one.ask(asked)
        assert one.fmu.call("NewDiscreteStates", info) == OK
        assert one.fmu.call("EnterContinuousTimeMode") == OK

    assert one.fmu.set_scalars(0, 0.0) == OK
    event(True)
    assert one.state == TareState.AVERAGING
    for row in strain:
        solver_step(one.fmu, one, row)
    assert one.fmu.call("EnterEventMode") == OK
    event(False)
    assert one.state == TareState.DONE
    assert one.zeros.tobytes() == other.zeros.tobytes()
    assert one.fmu.call("EnterEventMode") == OK
    event(True)
    assert one.fmu.set_scalars(0, 1e5) == OK
    assert solver_step(one.fmu, one, strain[0])  # refused: the state wants an event
    assert one.state == TareState.AVERAGING
    assert one.fmu.call("EnterEventMode") == OK
    event(True)
    assert one.state == TareState.REFUSED
