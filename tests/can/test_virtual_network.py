"""Sender, CAN FD bus and ECU as FMUs of FMI-LS-BUS 1.0: what is sent arrives; results are those of the bridge."""

from binascii import crc_hqx
from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from typing import Any
from zipfile import ZipFile

import cantools
import numpy as np
import pytest
from fmpy.validation import validate_fmu
from synthetic_vehicle import SyntheticFiles
from virtual_bus import (
    BUS_ERROR,
    CAN_FD,
    CONFIGURATION,
    CONFIRM,
    FmuNode,
    Network,
    frames_in,
    operation,
    operations,
    transmit,
)

from strainfmu.can.dbc_files import E2E_DATA_ID
from strainfmu.can.encoder import StrainEncoder
from strainfmu.can.frame import Frame
from strainfmu.can.options import BridgeOptions
from strainfmu.can.profiles import profile_layout
from strainfmu.can.quality import FrameClass
from strainfmu.can.replay import estimate_log
from strainfmu.can.signals import SignalPlan
from strainfmu.errors import InputError
from strainfmu.fmu.export import ExportOptions
from strainfmu.fmu.plant_export import export_can_bus
from strainfmu.packaging.ecu import export_ecu
from strainfmu.packaging.packages import plant
from tests.can.test_ecu import CYCLE, Reference, bytes_of, replies_to_rubbish

HERE = ["linux64"]
ESTIMATE = 0x380
"""Identifier of the frame of loads."""
SENDER, ECU = ("plant", "CAN"), ("ecu", "CAN")
OVER_BUS = [(SENDER, ("can", "Node1")), (ECU, ("can", "Node2"))]
FLIGHT = """time_s,mach_number,angle_of_attack_deg,sideslip_angle_deg,altitude_km
0,5.5,0,0,20
5,6,4,1,20
10,6.2,1,-2,20.5
20,6,3,0,21
"""
BUS = '[virtual]\ntx_clock = "{clock}"\n'


def export_nodes(folder: Path, map_path: Path, flight_model: Path, trajectory: Path, clock: str) -> Path:
    """The three FMUs and their bus file, in a folder."""
    bus = folder / "bus.toml"
    bus.write_text(BUS.format(clock=clock))
    export_ecu(map_path, folder / "ecu.fmu", bus, ExportOptions(fmi_version="3", platforms=HERE))
    options: dict[str, Any] = {"motion": "trajectory", "trajectory": trajectory}
    plant(flight_model, folder / "plant.fmu", fmi=3, bus=bus, **options)
    export_can_bus(folder / "can.fmu", "Node", 2, HERE)
    return folder


@pytest.fixture(scope="module", params=["countdown", "triggered"])
def fmus(
    request: pytest.FixtureRequest, synthetic: SyntheticFiles, tmp_path_factory: pytest.TempPathFactory
) -> Path:
    folder = tmp_path_factory.mktemp("nodes")
    return export_nodes(folder, synthetic.map_1, synthetic.flight_model, synthetic.trajectory, request.param)


def network_of(fmus: Path, folder: Path, direct: bool = False) -> Network:
    names = ("plant", "ecu") if direct else ("plant", "ecu", "can")
    nodes = {name: FmuNode(fmus / f"{name}.fmu", folder / name) for name in names}
    return Network(nodes, [(SENDER, ECU)] if direct else OVER_BUS, 1e-3 if nodes["ecu"].is_triggered else CYCLE)


def expected_results(network: Network, reference: Reference) -> list[tuple[int, bytes]]:
    """What the bridge in Python sends in the events of the ECU."""
    heard: dict[float, list[Frame]] = {}
    for frame in network.heard_by(ECU):
        heard.setdefault(frame.time, []).append(frame)
    events = [(time, ticks) for time, name, ticks in network.events if name == "ecu"]
    return [one for time, ticks in events for one in bytes_of(reference.event(time, heard.get(time, []), ticks))]


def dbc_in(fmu: Path) -> cantools.database.Database:
    with ZipFile(fmu) as archive:
        return cantools.database.load_string(
            archive.read("extra/org.fmi-standard.fmi-ls-bus/CAN.dbc").decode("cp1252")
        )


def candump(network: Network, path: Path) -> Path:
    """A log of SocketCAN of what the ECU received and sent."""
    ways = [*((one, "R") for one in network.heard_by(ECU)), *((one, "T") for one in network.sent_by(ECU))]
    lines = [
        f"({one.time:.6f}) can0 {one.identifier:03X}##1{one.data.hex().upper()} {way}\n"
        for one, way in sorted(ways, key=lambda row: row[0].time)
    ]
    path.write_text("".join(lines))
    return path


def check_run(network: Network, reference: Reference, dbc: cantools.database.Database) -> None:
    """All that holds of a run: counts, bytes, loads, check sums by the DBC file, and what a replay gives."""
    sender, ecu = network.nodes["plant"], network.nodes["ecu"]
    strains, results = network.heard_by(ECU), network.heard_by(SENDER)
    n_cycle = len({one.identifier for one in strains})
    codes = Counter(
        code for _, place, content in network.taps for code, _ in operations(content) if place[0] == "can"
    )
    if "can" in network.nodes:
        bus = network.nodes["can"]
        assert sender.counter("confirmed") == len(strains) == bus.counter("sent", "Node2")
        assert ecu.counter("confirmed") == len(results) == bus.counter("sent", "Node1")
        assert codes == {CONFIRM: len(strains) + len(results), CAN_FD: len(strains) + len(results)}
        assert bus.counter("lost", "Node1") == bus.counter("lost", "Node2") == 0
    assert sender.counter("sent") == ecu.counter("received") == len(strains)
    assert len(strains) - ecu.counter("used") == 3 * n_cycle  # a sender is trusted from its fourth cycle on
    assert all((one.counter("format_errors"), one.counter("lost")) == (0, 0) for one in (sender, ecu))
    sent = network.sent_by(ECU)
    assert bytes_of(sent) == expected_results(network, reference)
    assert ecu.counter("used") == reference.machine.account.classes[FrameClass.USED]
    estimates = [one for one in sent if one.identifier == ESTIMATE]
    assert len(estimates) == len(reference.results) == len(strains) // n_cycle
    assert {one.data[2] for one in estimates} == {k % 256 for k in range(min(len(estimates), 256))}
    loads = ecu.fmu.getFloat64([ecu.numbers[name] for name in ("coefficients", "sigma.coefficients")], nValues=10)
    last = reference.results[-1]
    np.testing.assert_array_equal(loads, [*last.coefficients, *last.coefficients_std])
    data_ids = {message.frame_id: message.dbc.attributes[E2E_DATA_ID].value for message in dbc.messages}
    for frame in (*strains, *sent):
        crc = crc_hqx(frame.data[2:] + data_ids[frame.identifier].to_bytes(2, "little"), 0xFFFF)
        assert int.from_bytes(frame.data[:2], "little") == crc


@pytest.fixture
def reference(fmus: Path, synthetic: SyntheticFiles) -> Iterator[Reference]:
    made = Reference(synthetic.map_1, fmus / "bus.toml")
    yield made
    made.close()


@pytest.mark.parametrize("direct", [False, True])
def test_what_is_sent_arrives_and_results_are_those_of_the_bridge(
    fmus: Path, reference: Reference, synthetic: SyntheticFiles, tmp_path: Path, direct: bool
) -> None:
    """Two seconds, warm-up included, over the bus and without it."""
    network = network_of(fmus, tmp_path, direct)
    for name, node in network.nodes.items():
        assert node.is_triggered or validate_fmu(str(fmus / f"{name}.fmu")) == []
    network.run(2.005)  # the middle of a cycle: all of it has arrived
    check_run(network, reference, dbc_in(fmus / "ecu.fmu"))
    options, log = BridgeOptions(interface="", channel=""), candump(network, tmp_path / "can.log")
    summary = estimate_log(synthetic.map_1, log, tmp_path / "e.csv", options=lambda _: options)
    assert summary.equal == summary.compared == len(reference.results)


@pytest.mark.slow
@pytest.mark.parametrize("clock", ["countdown", "triggered"])
def test_twenty_seconds_of_flight(ic3x_demo: Path, tmp_path: Path, clock: str) -> None:
    """The demonstration's vehicle over the bus; all results from the fourth cycle on may be used."""
    (tmp_path / "flight.csv").write_text(FLIGHT)
    files = ic3x_demo / "map.h5", ic3x_demo / "flight_model.h5", tmp_path / "flight.csv"
    export_nodes(tmp_path, *files, clock)
    network, reference = network_of(tmp_path, tmp_path), Reference(files[0], tmp_path / "bus.toml")
    network.run(20.005)
    check_run(network, reference, dbc_in(tmp_path / "ecu.fmu"))
    assert all(result.usable for result in reference.results[3:])
    options, log = BridgeOptions(interface="", channel=""), candump(network, tmp_path / "can.log")
    summary = estimate_log(files[0], log, tmp_path / "e.csv", options=lambda _: options)
    assert summary.equal == summary.compared == len(reference.results) == 2001
    reference.close()


def test_the_sender_is_the_encoder(fmus: Path, reference: Reference, tmp_path: Path) -> None:
    """Bytes of every frame from the outputs at its tick, with the results that were heard before."""
    network = network_of(fmus, tmp_path, direct=True)
    sender, samples = network.nodes["plant"], list[tuple[float, dict[str, float]]]()
    names = [*(f"strain[{k + 1}]" for k in range(6)), "dynamic_pressure", "mach_number", "altitude"]
    original = sender.sent

    def sent(port: str, ticks: bool) -> bytes:
        content = original(port, ticks)
        if content:
            values = sender.fmu.getFloat64([sender.numbers[name] for name in names])
            samples.append((network.time, dict(zip(names, values, strict=True))))
        return content

    # The method is wrapped on this instance alone.
    sender.sent = sent  # type: ignore[method-assign]
    network.run(0.305)
    encoder, expected, results = (
        StrainEncoder(reference.layout, session=1),
        list[tuple[int, bytes]](),
        network.heard_by(SENDER),
    )
    plans = {one.identifier: SignalPlan(one) for one in reference.results_layouts}
    for cycle, (time, values) in enumerate(samples):
        while results and results[0].time < time:
            frame = results.pop(0)
            named = [signal.name for signal in plans[frame.identifier].signals]
            raw = dict(zip(named, plans[frame.identifier].raw(frame.data).tolist(), strict=True))
            if frame.identifier == ESTIMATE and raw["SampleTime"] != (1 << 32) - 1:
                encoder.hear(raw["AnsweredCounter"], raw["E2E_Counter"], frame.time)
        flow = {name: values[name] for name in ("mach_number", "altitude")}
        strain = [values[name] for name in names[:6]]
        expected += bytes_of(encoder.encode(strain, values["dynamic_pressure"], cycle, time, **flow))
    assert bytes_of(network.sent_by(SENDER)) == expected
    assert network.nodes["plant"].counter("used") > 25


def test_a_recording_is_sent_row_by_row(fmus: Path, synthetic: SyntheticFiles, tmp_path: Path) -> None:
    """Strains, dynamic pressure and navigation of row k in cycle k; what is not known is refused."""
    columns = ["time", *(f"strain[{k + 1}]" for k in range(6)), "dynamic_pressure", "mach_number", "altitude"]
    rows = [[0.01 * k, *(1e-6 * (k + g) for g in range(6)), 1e5 + k, 6.0, 2e4] for k in range(20)]
    lines = [",".join(columns), *(",".join(map(str, row)) for row in rows)]
    (tmp_path / "run.csv").write_text("\n".join(lines))
    plant(
        synthetic.flight_model,
        tmp_path / "plant.fmu",
        fmi=3,
        bus=fmus / "bus.toml",
        recording=tmp_path / "run.csv",
    )
    node = FmuNode(tmp_path / "plant.fmu", tmp_path / "plant")
    layout = profile_layout("fd64", [f"G{k}" for k in range(6)], CYCLE)
    encoder, time, found = StrainEncoder(layout, session=1), 0.0, list[tuple[int, bytes]]()
    expected = list[tuple[int, bytes]]()
    for cycle, row in enumerate(rows):
        due = node.due if not node.is_triggered else max(0.001, 0.01 * cycle)
        node.step(time, due)
        time = due
        found += bytes_of(frames_in(node.event(time, [], ticks=True), time))
        expected += bytes_of(encoder.encode(row[1:7], row[7], cycle, time, mach_number=row[8], altitude=row[9]))
    assert found == expected
    node.close()


def test_arbitration_confirmation_and_bit_rates(fmus: Path, tmp_path: Path) -> None:
    """The lowest identifier goes first, in the time of its bits; other bit rates are a Bus Error."""
    export_can_bus(tmp_path / "three.fmu", "N", 3, HERE)
    bus = FmuNode(tmp_path / "three.fmu", tmp_path / "three")
    assert validate_fmu(str(tmp_path / "three.fmu")) == []
    rates = operation(CONFIGURATION, b"\x01" + (500_000).to_bytes(4, "little"))
    rates += operation(CONFIGURATION, b"\x02" + (2_000_000).to_bytes(4, "little"))
    first = Frame(identifier=0x200, data=bytes(64), is_fd=True, bitrate_switch=True)
    second = Frame(identifier=0x201 << 18, data=bytes(8), is_extended=True)
    bus.fmu.enterEventMode()
    bus.hear("N1", rates + transmit(second))
    bus.hear("N2", rates + transmit(first))
    bus.end_event(0.0)
    on_wire = (17 + 13) / 500e3 + (5 + 8 * 64 + 31) / 2e6, (47 + 20 + 8 * 8) / 500e3
    time = 0.0
    for frame, wire, sender in ((first, on_wire[0], "N2"), (second, on_wire[1], "N1")):
        assert bus.due - time == pytest.approx(wire, abs=1e-12)
        bus.step(time, bus.due)
        time = bus.due
        bus.fmu.enterEventMode()
        heard = {port: bus.sent(port, ticks=True) for port in bus.ports}
        bus.end_event(time)
        confirm = operation(CONFIRM, frame.identifier.to_bytes(4, "little"))
        assert heard == {port: confirm if port == sender else transmit(frame) for port in bus.ports}
    assert bus.due == np.inf
    bus.fmu.enterEventMode()
    bus.hear("N3", operation(CONFIGURATION, b"\x02" + (8_000_000).to_bytes(4, "little")) + transmit(first))
    bus.end_event(time)
    bus.step(time, bus.due)
    bus.fmu.enterEventMode()
    answer = [*operations(bus.sent("N3", ticks=True))]
    bus.end_event(bus.due)
    assert [(code, a[:4]) for code, a in answer] == [(BUS_ERROR, (0x200).to_bytes(4, "little"))]
    assert bus.counter("lost", "N3") == 1
    bus.close()


@pytest.mark.parametrize("name", ["plant", "can"])
def test_rubbish_is_answered_with_a_format_error(fmus: Path, tmp_path: Path, name: str) -> None:
    node = FmuNode(fmus / f"{name}.fmu", tmp_path / name)
    assert replies_to_rubbish(node, 1000) > 500
    assert node.counter("format_errors") > 500
    node.close()


def test_states_go_on_alike(fmus: Path, tmp_path: Path) -> None:
    """States of all three in the middle of a frame, set in new instances: the same operations follow."""
    taps = []
    for number in range(2):
        network = network_of(fmus, tmp_path / str(number))
        network.run(0.1005)
        if number == 1:
            later = network_of(fmus, tmp_path / "later")
            for name, node in network.nodes.items():
                other, state = later.nodes[name], node.fmu.getFMUState()
                restored = other.fmu.deserializeFMUState(node.fmu.serializeFMUState(state))
                other.fmu.setFMUState(restored)
                other.dues, other.needs_event = node.dues, node.needs_event
            later.time, later.taps = network.time, network.taps
            network = later
        network.run(0.205)
        taps.append(network.taps)
    assert taps[0] == taps[1]


def test_what_an_fmu_cannot_send_is_refused(fmus: Path, synthetic: SyntheticFiles, tmp_path: Path) -> None:
    for text, message in (
        ('[input]\nprofile = "classic-le"', r"input\.profile: expected fd64"),
        ('[bus]\ninterface = "socketcan"', r"bus\.interface: expected no such entry"),
    ):
        (tmp_path / "bus.toml").write_text(text)
        with pytest.raises(InputError, match=message):
            plant(synthetic.flight_model, tmp_path / "x.fmu", fmi=3, bus=tmp_path / "bus.toml")
    with pytest.raises(InputError, match=r"--bus: expected with --fmi 3"):
        plant(synthetic.flight_model, tmp_path / "x.fmu", bus=fmus / "bus.toml")
    with pytest.raises(InputError, match=r"--recording: expected with --bus"):
        plant(synthetic.flight_model, tmp_path / "x.fmu", fmi=3, recording=tmp_path / "run.csv")
    with pytest.raises(InputError, match=r"nodes: expected 1 to 8, got 9"):
        export_can_bus(tmp_path / "x.fmu", n_nodes=9)
