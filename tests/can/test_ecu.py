"""The estimator as an ECU (FMI-LS-BUS 1.0): frames in, frames out, as the bridge in Python has them."""

from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from composed_frames import BridgeStatus, ResultFrames
from fmpy.validation import validate_fmu
from synthetic_vehicle import SyntheticFiles
from virtual_bus import (
    CAN_FD,
    CONFIGURATION,
    FORMAT_ERROR,
    FmuNode,
    Master,
    Sender,
    frames_in,
    operation,
    operations,
)

from strainfmu.can.bus_file import read_bus
from strainfmu.can.encoder import StrainEncoder
from strainfmu.can.frame import Frame
from strainfmu.can.options import BridgeOptions
from strainfmu.can.profiles import profile_layout
from strainfmu.can.quality import BusState, Cause, FrameClass, Quality
from strainfmu.can.result_frames import STATUS_PERIOD
from strainfmu.can.setup import make_machine
from strainfmu.can.signals import SignalPlan
from strainfmu.cosim.estimators.source import open_step
from strainfmu.errors import InputError
from strainfmu.estimator.map.inverse_map import load_inverse_map
from strainfmu.fmu.export import ExportOptions
from strainfmu.packaging.ecu import export_ecu

CYCLE, RESPONSE = 0.01, 5e-4
BUS = """[trust]
restart = "accept"
[virtual]
tx_clock = "{clock}"
"""


@pytest.fixture(scope="module", params=["countdown", "triggered"])
def ecu(
    request: pytest.FixtureRequest, synthetic: SyntheticFiles, tmp_path_factory: pytest.TempPathFactory
) -> Path:
    """The folder of an ECU FMU and its bus file."""
    folder = tmp_path_factory.mktemp("ecu")
    (folder / "bus.toml").write_text(BUS.format(clock=request.param))
    export_ecu(synthetic.map_1, folder / "ecu.fmu", folder / "bus.toml")
    return folder


class Reference:
    """The bridge in Python: the same machine and frames, stepped by the events of the ECU."""

    def __init__(self, map_path: Path, bus: Path) -> None:
        options = read_bus(bus).options(BridgeOptions(interface="", channel=""))
        self._open = open_step(map_path)
        ready = self._open.__enter__()
        self._now = 0.0
        self.machine, self.results_layouts, configuration, _ = make_machine(
            ready.step, options, ready.gauge_names, start=0.0, now=lambda: self._now
        )
        self.layout, self._frames = self.machine.layout, ResultFrames(self.results_layouts, configuration)
        self._waiting: list[Any] = []
        self._next_status, self._last, self._last_valid, self._cycles = 0.0, None, None, 0
        self.results: list[Any] = []

    def close(self) -> None:
        self._open.__exit__(None, None, None)

    def _take(self, results: Sequence[Any]) -> None:
        for result in results:
            self._cycles += 1
            self._last = result
            self.results.append(result)
            if result.quality in (Quality.VALID, Quality.UNPROTECTED):
                self._last_valid = result
            self._waiting.append(result)

    def event(self, time: float, frames: Sequence[Frame], ticks: bool) -> list[Frame]:
        """The frames that go in an event at ``time`` [s]."""
        sent: list[Frame] = []
        self._now = time + RESPONSE
        if ticks:
            self._take(self.machine.advance(time + 1e-12))
            while self._waiting and self._waiting[0].time <= time + 1e-9:
                result = self._waiting.pop(0)
                result.age += max(time - result.time, 0.0)
                sent += self._frames.of_result(result)
                result.age -= max(time - result.time, 0.0)
            if self._next_status <= time + 1e-9:
                sent += self._frames.of_status(self._status(time))
                self._next_status = max(self._next_status + STATUS_PERIOD, time)
        for frame in frames:
            frame.time = time
            self._take(self.machine.receive(frame))
        return sent

    def _status(self, time: float) -> BridgeStatus:
        return BridgeStatus(
            time=time,
            bus_state=BusState.ERROR_ACTIVE,
            last=self._last,
            last_valid=self._last_valid,
            account=self.machine.account,
            cycles=self._cycles,
            send_failures=0,
            reconnects=0,
        )


def sender_for(
    reference: Reference, map_path: Path, cycles: int, row: Callable[[int], int] = int, layout: Any = None
) -> Sender:
    """Strains with noise about the map's mean, ``row`` of each cycle, by the encoder of the project."""
    inverse_map, random = load_inverse_map(map_path), np.random.default_rng(4)
    encoder = StrainEncoder(layout or reference.layout, session=7)
    noise = inverse_map.noise_std * random.normal(size=(cycles, inverse_map.n_strain_gauges))
    strain = inverse_map.mean_strain + noise

    def frames(cycle: int, time: float) -> list[Frame]:
        return encoder.encode(strain[row(cycle)], 9e4, cycle, time, mach_number=6.0, altitude=20e3)

    return Sender(frames, cycles, CYCLE)


def bytes_of(frames: Sequence[Frame]) -> list[tuple[int, bytes]]:
    return [(frame.identifier, bytes(frame.data)) for frame in frames]


def sent_by(sender: Sender) -> list[tuple[int, bytes]]:
    """The frames of the ECU that a sender has heard."""
    return [one for time, content in sender.heard for one in bytes_of(frames_in(content, time))]


def expected_of(reference: Reference, master: Master) -> list[tuple[int, bytes]]:
    """What the bridge sends in the events of a run."""
    sender, found = master.sender, list[tuple[int, bytes]]()
    sent = {time: [one for at, one in sender.sent if at == time] for time, _ in sender.sent}
    for time, ticks in master.events:
        found += bytes_of(reference.event(time, sent.get(time, []), ticks))
    return found


@pytest.fixture
def reference(ecu: Path, synthetic: SyntheticFiles) -> Iterator[Reference]:
    made = Reference(synthetic.map_1, ecu / "bus.toml")
    yield made
    made.close()


def master_of(ecu: Path, folder: Path, sender: Sender, **options: Any) -> Master:
    node = FmuNode(ecu / "ecu.fmu", folder / "ecu")
    return Master(node, sender, step=0.001 if node.is_triggered else CYCLE, **options)


def test_frames_are_those_of_the_bridge(
    ecu: Path, reference: Reference, synthetic: SyntheticFiles, tmp_path: Path
) -> None:
    """Two seconds, warm-up included: result and status frames equal byte for byte, counters and CRC too."""
    sender = sender_for(reference, synthetic.map_1, 200)
    master = master_of(ecu, tmp_path, sender, confirms=True)
    master.run(2.0)
    node, found = master.ecu, sent_by(sender)
    assert len(found) > 200
    assert found == expected_of(reference, master)
    codes = [code for _, content in sender.heard for code, _ in operations(content)]
    assert codes[:3] == [CONFIGURATION] * 3
    assert set(codes[3:]) == {CAN_FD}
    assert node.counter("received") == len(sender.sent)
    assert node.counter("used") == reference.machine.account.classes[FrameClass.USED] > 0.98 * len(sender.sent)
    assert node.counter("sent") == len(found)
    assert len(found) - node.counter("confirmed") <= 3  # those of the last tick
    assert (node.counter("format_errors"), node.counter("lost")) == (0, 0)
    assert len(reference.results) == 200
    names = ("coefficients", "sigma.coefficients")
    loads = node.fmu.getFloat64([node.numbers[name] for name in names], nValues=10)
    last = reference.results[-1]
    np.testing.assert_array_equal(loads, [*last.coefficients, *last.coefficients_std])
    assert node.fmu.getBoolean([node.numbers["health.usable"]]) == [last.usable]
    assert validate_fmu(str(ecu / "ecu.fmu")) == [] or node.is_triggered
    node.close()


def test_a_dynamic_pressure_that_the_bus_file_states_is_the_models(
    synthetic: SyntheticFiles, tmp_path: Path
) -> None:
    """On a bus without a frame of it."""
    names = load_inverse_map(synthetic.map_1).gauge_names
    lines = [f'BO_ {256 + k} R{k}: 8 A\n SG_ S : 0|16@1- (0.25,0) [0|0] "um/m" B\n' for k in range(len(names))]
    (tmp_path / "rack.dbc").write_text('VERSION ""\nNS_ :\nBS_:\nBU_: A B\n' + "".join(lines))
    strains = "".join(f'"{name}" = "R{k}.S"\n' for k, name in enumerate(names))
    own = f'dbc = "rack.dbc"\ncycle_time_ms = {1e3 * CYCLE:g}\ngauges = "map.h5"\ndynamic_pressure_pa = 90000.0\n'
    text = f"[input]\n{own}[input.strain]\n{strains}{BUS.format(clock='countdown')}"
    (tmp_path / "bus.toml").write_text(text)
    (tmp_path / "map.h5").write_bytes(synthetic.map_1.read_bytes())
    export_ecu(synthetic.map_1, tmp_path / "ecu.fmu", tmp_path / "bus.toml")
    reference = Reference(synthetic.map_1, tmp_path / "bus.toml")
    sender = sender_for(reference, synthetic.map_1, 30)
    master = master_of(tmp_path, tmp_path, sender)
    master.run(0.3)
    assert sent_by(sender) == expected_of(reference, master)
    node, last = master.ecu, reference.results[-1]
    assert last.dynamic_pressure == 9e4
    np.testing.assert_array_equal(
        node.fmu.getFloat64([node.numbers["coefficients"]], nValues=5), last.coefficients
    )
    node.close()
    reference.close()


def test_the_age_is_that_of_the_tick(
    ecu: Path, reference: Reference, synthetic: SyntheticFiles, tmp_path: Path
) -> None:
    """Within the 0.1 ms of its signal, where the importer ticks 0 or 3 ms late."""
    estimates = next(one for one in reference.results_layouts if one.name == "LoadEstimate")
    plan, names = SignalPlan(estimates), [signal.name for signal in estimates.signals]
    for lag in (0.0, 0.003):
        sender = sender_for(reference, synthetic.map_1, 40)
        master = master_of(ecu, tmp_path / str(lag), sender)
        master.run(0.4, lag)
        found = [one for time, content in sender.heard for one in frames_in(content, time)]
        rows = [(f.time, plan.physical(plan.raw(f.data))) for f in found if f.identifier == estimates.identifier]
        ages = [(1e3 * t - 1e-3 * row[names.index("SampleTime")], row[names.index("Age")]) for t, row in rows]
        ages = [one for one in ages if np.isfinite(one).all()]
        assert len(ages) > 30
        assert max(abs(expected - age) for expected, age in ages) <= 0.1 + 1e-9
        assert max(age for _, age in ages) >= 1e3 * (RESPONSE + lag) - 0.1 or master.ecu.is_triggered
        master.ecu.close()


_MISSED: list[Frame] = []


def late(cycle: int, frames: list[Frame]) -> list[Frame]:
    """The last frame of some cycles comes ahead of the next cycle."""
    missed, _MISSED[:] = [*_MISSED], frames[-1:] if cycle % 7 == 3 else []
    return [*missed, *frames[: len(frames) - len(_MISSED)]]


FAULTS: dict[str, Callable[[int, list[Frame]], list[Frame]]] = {
    "late": late,
    "lost": lambda cycle, frames: frames[:-1] if cycle % 7 == 3 else frames,
    "repeated": lambda cycle, frames: [*frames, *frames] if cycle % 5 == 2 else frames,
    "damaged": lambda cycle, frames: [
        frame.with_data(bytes([*frame.data[:-1], frame.data[-1] ^ 1])) if cycle % 6 == 1 else frame
        for frame in frames
    ],
    "silent": lambda cycle, frames: [] if 40 <= cycle < 80 else frames,
    "unknown": lambda cycle, frames: [*frames, Frame(identifier=0x111, data=b"x")],
    "frozen": lambda cycle, frames: frames,
    "foreign configuration": lambda cycle, frames: frames,
}


CAUSES = {"lost": Cause.PARTIAL_CYCLE, "late": Cause.PARTIAL_CYCLE, "frozen": Cause.FROZEN, "silent": Cause.SILENT}


@pytest.mark.parametrize("fault", FAULTS)
def test_faults_have_the_quality_and_causes_of_the_bridge(
    ecu: Path, reference: Reference, synthetic: SyntheticFiles, tmp_path: Path, fault: str
) -> None:
    row = (lambda cycle: min(cycle, 40)) if fault == "frozen" else int
    whole = sender_for(reference, synthetic.map_1, 120, row)
    foreign = sender_for(reference, synthetic.map_1, 120, layout=profile_layout("fd64", list("ABCDEF"), CYCLE))

    def frames(cycle: int, time: float) -> list[Frame]:
        of_cycle = [*whole.frames(cycle, time)], [*foreign.frames(cycle, time)]
        return FAULTS[fault](cycle, of_cycle[fault == "foreign configuration" and 40 <= cycle < 60])

    sender = Sender(frames, 120, CYCLE)
    master = master_of(ecu, tmp_path, sender)
    master.run(1.2)
    assert sent_by(sender) == expected_of(reference, master)
    assert len({result.quality for result in reference.results}) > 1
    if fault in CAUSES:
        assert any(result.causes & CAUSES[fault] for result in reference.results[20:])
    master.ecu.close()


def test_order_repetition_and_splitting_change_nothing(
    ecu: Path, reference: Reference, synthetic: SyntheticFiles, tmp_path: Path
) -> None:
    """Operations one by one, or all of an event twice."""
    found = []
    for number, split in enumerate((lambda content: [content], one_by_one, lambda content: [content, content])):
        sender = sender_for(reference, synthetic.map_1, 60)
        master = master_of(ecu, tmp_path / str(number), sender)
        master.split = split
        master.run(0.6)
        found.append(sender.heard)
        master.ecu.close()
    assert found[0] == found[1] == found[2]


def one_by_one(content: bytes) -> list[bytes]:
    return [operation(code, arguments) for code, arguments in operations(content)]


def test_states_go_on_alike_in_any_instance_and_a_reset_begins_again(
    ecu: Path, reference: Reference, synthetic: SyntheticFiles, tmp_path: Path
) -> None:
    """At every tenth event the state goes on in the same instance, later in another one, after bytes of a file."""
    runs = []
    for number in range(2):
        sender = sender_for(reference, synthetic.map_1, 60)
        master = master_of(ecu, tmp_path / str(number), sender)
        while master.time < 0.6 - 1e-9:
            master.run(min(master.time + 0.02, 0.6))
            if number == 1 and len(master.events) % 10 == 0:
                node, state = master.ecu, master.ecu.fmu.getFMUState()
                content = node.fmu.serializeFMUState(state)
                node.fmu.setFMUState(state)
                node.fmu.freeFMUState(state)
                if master.time > 0.3 and number == 1:
                    other = FmuNode(ecu / "ecu.fmu", tmp_path / f"other{len(master.events)}")
                    restored = other.fmu.deserializeFMUState(content)
                    other.fmu.setFMUState(restored)
                    other.fmu.freeFMUState(restored)
                    other.dues, other.needs_event = node.dues, node.needs_event
                    node.close()
                    master.ecu = other
        runs.append((sender.heard, master))
    assert runs[0][0] == runs[1][0]
    master = runs[0][1]
    master.ecu.fmu.reset()
    master.ecu.start(0.0)
    again = sender_for(reference, synthetic.map_1, 60)
    after = Master(master.ecu, again, step=0.001 if master.ecu.is_triggered else CYCLE)
    while after.time < 0.6 - 1e-9:
        after.run(min(after.time + 0.02, 0.6))
    assert again.heard == runs[0][0]
    codes = [code for _, content in again.heard for code, _ in operations(content)]
    assert codes.index(CAN_FD) > max(place for place, code in enumerate(codes) if code == CONFIGURATION)
    master.ecu.close()
    runs[1][1].ecu.close()


@pytest.mark.parametrize("count", [2000, pytest.param(100_000, marks=pytest.mark.slow)])
def test_rubbish_is_answered_with_a_format_error(ecu: Path, tmp_path: Path, count: int) -> None:
    node = FmuNode(ecu / "ecu.fmu", tmp_path / "ecu")
    assert replies_to_rubbish(node, count) > count // 2
    assert node.counter("format_errors") > count // 2
    node.close()


def replies_to_rubbish(node: FmuNode, count: int) -> int:
    """Number of Format Errors of a node that hears rubbish at its first port, every millisecond."""
    random, replies, time = np.random.default_rng(3), 0, 0.0
    lengths = [*range(10), 16, 17, 2**31, 2**32 - 1]
    for k in range(count):
        content = random.integers(0, 256, random.integers(1, 40), dtype=np.uint8).tobytes()
        if k % 3:
            code = int(random.choice([0, 1, 0x10, 0x11, 0x12, 0x20, 0x40, 0x99]))
            content = code.to_bytes(4, "little") + int(random.choice(lengths)).to_bytes(4, "little") + content
        node.step(time, time + 1e-3)
        time += 1e-3
        answer = node.event(time, [content], ticks=True)
        replies += sum(code == FORMAT_ERROR for code, _ in operations(answer))
    return replies


def test_it_needs_event_mode_and_what_hardware_has_is_refused(
    ecu: Path, synthetic: SyntheticFiles, tmp_path: Path
) -> None:
    with pytest.raises(Exception, match="Failed to instantiate"):
        FmuNode(ecu / "ecu.fmu", tmp_path / "ecu", events=False)
    for text, message in (
        ('[bus]\ninterface = "socketcan"\nchannel = "can0"', r"bus\.interface: expected no such entry"),
        ('[record]\nfile = "run.blf"', r"record\.file: expected no such entry"),
        ('[input]\nprofile = "fd64-sec"\nkey = "bus.key"', r"input\.key: expected no such entry"),
    ):
        (tmp_path / "bus.toml").write_text(text)
        with pytest.raises(InputError, match=message):
            export_ecu(synthetic.map_1, tmp_path / "x.fmu", tmp_path / "bus.toml")
    with pytest.raises(InputError, match=r"bus: expected an FMU of kind native and FMI 3\.0"):
        export_ecu(synthetic.map_1, tmp_path / "x.fmu", ecu / "bus.toml", ExportOptions())
