"""The virtual sender: its frames, their times, its faults and its score."""

from collections.abc import Callable
from pathlib import Path

import can
import numpy as np
import pytest
from can_case import ACCEPTING, Projection
from can_faults import SETTLING_CYCLES, planned_faults
from composed_frames import ResultFrames
from fault_injection import FaultySender
from slender_vehicle import make_slender_files
from synthetic_vehicle import N_GAUGES, SyntheticFiles

from strainfmu.can.frame import from_message
from strainfmu.can.machine import Machine, Result
from strainfmu.can.opening import BusSettings, open_bus
from strainfmu.can.options import BridgeSettings
from strainfmu.can.profiles import Identifiers, profile_layout
from strainfmu.can.quality import Cause, Quality
from strainfmu.can.result_frames import result_layouts
from strainfmu.can.sender import score_answers, send_flight
from strainfmu.can.signals import SignalPlan
from strainfmu.can.strain_sources import FlownSample, plant_samples, recorded_samples, scenario_samples
from strainfmu.cosim.estimators.step import StepResult
from strainfmu.cosim.systems.master import simulate
from strainfmu.cosim.systems.system import System
from strainfmu.errors import InputError, StrainfmuError

pytestmark = pytest.mark.fast

Run = Callable[..., tuple[int, str, str]]

CYCLE = 0.01
NAMES = [f"G{i}" for i in range(N_GAUGES)]
LAYOUT = profile_layout("fd64", NAMES, CYCLE)


class Time:
    """A clock that a sleep alone moves."""

    def __init__(self) -> None:
        self.now = 50.0

    def __call__(self) -> float:
        return self.now

    def sleep(self, seconds: float) -> None:
        self.now += seconds


class Bus:
    """Keeps messages with their times by ``clock``, or refuses all."""

    def __init__(self, clock: Time, broken: bool = False) -> None:
        self.sent: list[tuple[float, can.Message]] = []
        self._clock, self._broken = clock, broken

    def send(self, message: can.Message) -> None:
        if self._broken:
            raise can.CanOperationError("no buffer space")
        self.sent.append((self._clock(), message))


def samples(n_cycles: int) -> list[FlownSample]:
    cycle = np.arange(n_cycles)[:, None]
    strain = 100e-6 * np.sin(0.3 * cycle + np.arange(N_GAUGES))
    return [FlownSample(d, 9e4, np.full(5, 0.01 * k)) for k, d in enumerate(strain)]


def test_every_cycle_goes_out_at_its_own_time() -> None:
    clock = Time()
    bus = Bus(clock)
    sent = send_flight(bus, LAYOUT, samples=samples(50), clock=clock, sleep=clock.sleep)
    per_cycle = LAYOUT.cycle_length
    assert (sent.cycles, sent.frames, sent.not_sent) == (50, 50 * per_cycle, 0)
    first = np.array([time for time, _ in bus.sent[::per_cycle]])
    # Delays do not add up over the cycles: a sleep ends at most 0.1 ms early, by _SHORTEST_SLEEP.
    np.testing.assert_allclose(first, 50.0 + CYCLE * np.arange(50), atol=1.01e-4, rtol=0.0)
    assert sent.duration == pytest.approx(50 * CYCLE, abs=1.01e-4)


def test_a_core_trusts_what_is_sent() -> None:
    clock = Time()
    bus = Bus(clock)
    given = samples(30)
    send_flight(bus, LAYOUT, samples=given, clock=clock, sleep=clock.sleep)
    taken: list[np.ndarray] = []

    def step(strain: np.ndarray, pressure: float, step_size: float) -> StepResult:
        taken.append(strain)
        assert pressure == pytest.approx(9e4, rel=1e-7)  # float32
        return StepResult(np.zeros(5), np.ones(5), 0, 1.0)

    core = Machine(LAYOUT, step, ACCEPTING, start=50.0)
    results = [r for time, message in bus.sent for r in core.receive(from_message(message, time))]
    assert [r.quality for r in results[-27:]] == [Quality.VALID] * 27
    # Half of the 0.25 um/m of one bit.
    np.testing.assert_allclose(taken[-1], given[-1].strain, atol=0.1251e-6, rtol=0.0)


@pytest.mark.parametrize("profile", ["fd64", "classic-le"])
def test_a_flight_that_is_sent_three_times_is_valid_three_times_if_restarts_are_accepted(profile: str) -> None:
    layout, clock = profile_layout(profile, NAMES, CYCLE), Time()
    core = Machine(layout, Projection(N_GAUGES), BridgeSettings(restart="accept"), start=50.0)
    given = samples(60)
    for _ in range(3):
        bus = Bus(clock)
        send_flight(bus, layout, samples=given, clock=clock, sleep=clock.sleep)
        results = [r for time, message in bus.sent for r in core.receive(from_message(message, time))]
        assert [r.quality for r in results[-45:]] == [Quality.VALID] * 45
        clock.sleep(0.5)


def test_the_same_seed_gives_the_same_faults() -> None:
    def frames(seed: int) -> list[tuple[float, int, bytes]]:
        clock = Time()
        bus = Bus(clock)
        faults = planned_faults((), 8, seed=seed, n_cycles=400)
        sender = FaultySender(LAYOUT, faults)
        send_flight(bus, LAYOUT, samples=samples(400), sender=sender, clock=clock, sleep=clock.sleep)
        return [(time, message.arbitration_id, bytes(message.data)) for time, message in bus.sent]

    assert frames(3) == frames(3)
    assert frames(3) != frames(4)


def test_planned_faults_leave_the_start_alone_and_fit() -> None:
    faults = planned_faults(("loss", "freeze"), 10, seed=1, n_cycles=500)
    assert {fault.kind.value for fault in faults} == {"loss", "freeze"}
    assert min(fault.start for fault in faults) >= SETTLING_CYCLES
    assert max(fault.start + fault.cycles for fault in faults) <= 500
    with pytest.raises(InputError, match=r"expected one of loss, .*, got 'rust'"):
        planned_faults(("rust",), 1, seed=1, n_cycles=500)
    with pytest.raises(InputError, match=r"for 40 of them, got 100$"):
        planned_faults((), 40, seed=1, n_cycles=100)


def test_a_bus_that_takes_nothing_ends_the_sender() -> None:
    clock = Time()
    with pytest.raises(StrainfmuError, match="accepts no frames: no buffer space"):
        send_flight(Bus(clock, broken=True), LAYOUT, samples=samples(200), clock=clock, sleep=clock.sleep)


def test_plant_samples_are_those_of_a_simulation(synthetic: SyntheticFiles) -> None:
    """The co-simulation master is the reference: same FMU, same steps, so the same bits."""
    with plant_samples(synthetic.plant, N_GAUGES, cycle_time=CYCLE, duration=0.2) as opened:
        given = list(opened)
    reference = simulate(System({"plant": synthetic.plant}), 0.19, CYCLE)
    assert len(given) == 20
    strain = np.column_stack([reference[f"plant.strain[{i + 1}]"] for i in range(N_GAUGES)])
    np.testing.assert_array_equal(np.array([sample.strain for sample in given]), strain)
    np.testing.assert_array_equal([s.dynamic_pressure for s in given], reference["plant.dynamic_pressure"])
    np.testing.assert_array_equal([s.truth[3] for s in given], reference["plant.M_P"])
    np.testing.assert_array_equal([s.mach_number for s in given], reference["plant.mach_number"])
    np.testing.assert_array_equal([s.altitude for s in given], reference["plant.altitude"])
    assert given[0].mach_number == 5.0


def test_a_plant_of_other_gauges_is_refused(synthetic: SyntheticFiles) -> None:
    for n_gauges, found in (
        (N_GAUGES + 1, r"no output 'strain\[7\]' found"),
        (N_GAUGES - 1, r"got output 'strain\[6\]'"),
    ):
        with (
            pytest.raises(InputError, match=found),
            plant_samples(synthetic.plant, n_gauges, cycle_time=CYCLE, duration=0.2) as opened,
        ):
            next(opened)


def test_a_scenario_is_flown_at_the_rate_of_the_bus(tmp_path: Path) -> None:
    files = make_slender_files(tmp_path, stop_time=1.0)
    with scenario_samples(files.scenario, None, 0.02) as opened:
        given = list(opened)
    assert len(given) == 51
    assert all(np.isfinite(sample.truth).all() and np.isfinite(sample.strain).all() for sample in given)
    assert {(sample.mach_number, sample.altitude) for sample in given} == {(6.0, 20e3)}
    # The angle of attack is commanded away from where it starts, so that strains move.
    assert np.ptp([sample.strain for sample in given], axis=0).max() > 0.0


def test_recorded_rows_are_sent_one_per_cycle(tmp_path: Path) -> None:
    path = tmp_path / "rows.csv"
    path.write_text("time,G0 [um/m],G1\n0,100,1e-6\n7,200,\n")
    with recorded_samples(path, ["G0", "G1"], 9e4) as opened:
        given = list(opened)
    np.testing.assert_allclose([s.strain for s in given], [[100e-6, 1e-6], [200e-6, np.nan]])
    assert [s.dynamic_pressure for s in given] == [9e4, 9e4]
    assert np.isnan(given[0].truth).all()
    assert np.isnan([given[0].mach_number, given[0].altitude]).all()


def test_navigation_of_recorded_rows_is_sent(tmp_path: Path) -> None:
    path = tmp_path / "rows.csv"
    path.write_text(
        "time,G0,G1,dynamic_pressure,mach_number,altitude [km]\n0,1e-4,1e-6,9e4,6,20\n1,1e-4,2e-6,9e4,,21\n"
    )
    with recorded_samples(path, ["G0", "G1"], None) as opened:
        given = list(opened)
    np.testing.assert_array_equal([s.mach_number for s in given], [6.0, np.nan])
    np.testing.assert_allclose([s.altitude for s in given], [20e3, 21e3])


def test_score_by_hand() -> None:
    """Two answers of known error against a truth that runs from 0 to 0.1."""
    layout = result_layouts("fd", Identifiers(), CYCLE)[0]
    frames, plan = ResultFrames((layout,), 1), SignalPlan(layout)
    truth = [np.full(5, 0.1 * k) for k in range(2)]

    def result(cycle: int, value: float, quality: Quality) -> dict[str, float]:
        full = np.full(5, value)
        valid, strain = np.ones(2, bool), np.zeros(2)
        ticks = round(cycle * CYCLE * 1e6)
        found = Result(
            time=0.0,
            quality=quality,
            causes=Cause.NONE,
            valid=valid,
            strain=strain,
            dynamic_pressure=9e4,
            age=0.0,
            sample_time=ticks,
            counter=cycle,
            coefficients=full,
            coefficients_std=np.full(5, 0.001),
            chi_square=1.0,
            health=0,
        )
        values = plan.physical(plan.raw(frames.of_result(found)[0].data)).tolist()
        return dict(zip((signal.name for signal in plan.signals), values, strict=True))

    received = [result(0, 0.002, Quality.VALID), result(1, 0.104, Quality.DEGRADED), result(9, 5.0, Quality.VALID)]
    score = score_answers(received, truth)
    assert (score.cycles, score.answered, score.published) == (2, 2, 2)
    # Errors 0.002 and 0.004: the first within 3 sigma of 0.001, the second not. float32 in the frames.
    np.testing.assert_allclose(score.rms_error, np.sqrt((0.002**2 + 0.004**2) / 2), rtol=1e-5)
    np.testing.assert_allclose(score.rms_error_of_range, np.array(score.rms_error) / 0.1, rtol=1e-6)
    assert score.coverage == [0.5] * 5
    assert score.qualities == {"VALID": 2, "DEGRADED": 1}
    unknown = score_answers(received, [np.full(5, np.nan)] * 2)
    assert (unknown.published, unknown.has_errors, score.has_errors) == (2, False, True)
    assert np.isnan(unknown.coverage).all(), "no truth is not a truth outside"


def test_send_needs_exactly_one_source(run: Run, synthetic: SyntheticFiles) -> None:
    code, _, errors = run("send", "--map", synthetic.map_1, "--interface", "virtual", "--channel", "s1")
    assert (code, "DATA, --plant: expected one of them, got none" in errors) == (2, True)


def test_send_over_a_virtual_bus(run: Run, synthetic: SyntheticFiles) -> None:
    ears = open_bus(BusSettings(interface="virtual", channel="s2"))
    code, out, errors = run(
        *(
            "send",
            "--map",
            synthetic.map_1,
            "--plant",
            synthetic.plant,
            "--interface",
            "virtual",
            "--channel",
            "s2",
        ),
        *("--duration", "0.1", "--profile", "classic-le"),
    )
    assert (code, errors) == (0, "")
    assert "10 in " in out
    heard = []
    while (message := ears.recv(0.0)) is not None:
        heard.append(message.arbitration_id)
    ears.shutdown()
    # The state, q_inf, navigation of the plant, two frames of 4 and 2 gauges, the trailer.
    assert heard == [0x2FF, 0x300, 0x304, 0x301, 0x302, 0x303] * 10
