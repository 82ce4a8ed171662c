"""The listener for programs of one's own: its page word for word, with asyncio, with and without results."""

import asyncio
import re
import time
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import can
import numpy as np
import pytest
from running_bridge import Pace
from scaled_maps import scaled_map

import strainfmu
from strainfmu.can.encoder import StrainEncoder
from strainfmu.can.frame import to_message
from strainfmu.can.machine import Result
from strainfmu.can.profiles import Identifiers, profile_layout
from strainfmu.can.quality import Cause, Quality
from strainfmu.can.result_frames import result_layouts
from strainfmu.can.sender import Answers
from strainfmu.errors import InputError
from strainfmu.estimator.map.inverse_map import save_inverse_map

PAGE = Path(__file__).parents[2] / "docs" / "howto" / "listen_to_a_bus.md"
CYCLE = 0.05
PATIENCE = 600.0


class Rig:
    """A map, a bus file of the virtual interface, and a sender that hears the results on it."""

    def __init__(self, folder: Path, channel: str) -> None:
        self.map, self.bus_file = folder / "map.h5", folder / "bus.toml"
        held = scaled_map(2, seed=4)
        save_inverse_map(held, self.map)
        self.strain = held.mean_strain[: held.n_gauges]
        self.bus_file.write_text(f"[input]\nprofile = 'fd64'\ncycle_time_ms = {1e3 * CYCLE:g}\n")
        self.bus = can.Bus(interface="virtual", channel=channel)
        self.encoder = StrainEncoder(profile_layout("fd64", held.gauge_names[: held.n_gauges], CYCLE))
        self.start, self.number, self.random = time.monotonic(), 0, np.random.default_rng(1)
        self.pace = Pace(CYCLE)
        results = result_layouts("fd", Identifiers(), CYCLE)
        self.ears = can.Bus(interface="virtual", channel=channel)
        self.answers = Answers(self.ears, results, self.hear)

    def hear(self, answered: int, counter: int, sample_time: int | None = None) -> None:
        self.encoder.hear(answered, counter, time.monotonic() - self.start, sample_time)

    def send(self) -> None:
        strain = self.strain + 2e-6 * self.random.normal(size=len(self.strain))
        now = time.monotonic() - self.start
        for frame in self.encoder.encode(strain, 9e4, cycle=self.number, sample_time=now):
            self.bus.send(to_message(frame))
        self.number += 1

    def send_until(self, condition: Callable[[], bool]) -> None:
        end = time.monotonic() + PATIENCE
        while not condition():
            assert time.monotonic() < end, "it did not happen"
            self.send()
            time.sleep(self.pace.wait())


@pytest.fixture
def rig(tmp_path: Path, request: pytest.FixtureRequest) -> Any:
    made = Rig(tmp_path, f"{request.node.name}-{time.monotonic_ns()}")
    yield made
    made.answers.finish()
    made.ears.shutdown()
    made.bus.shutdown()


def is_known(quality: Quality) -> bool:
    return quality in (Quality.VALID, Quality.SUSPECT)


def test_the_page_word_for_word(rig: Rig, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture) -> None:
    """But for the bus, the paths, and the ten seconds, in which a sender sends."""
    text = PAGE.read_text(encoding="utf-8")
    code = re.findall(r"```python\n(.*?)```", text, re.S)[0]
    assert len(code.splitlines()) <= 30
    channel = rig.bus.channel_info.split()[-1]
    for before, after in (
        (
            'interface="udp_multicast", channel="239.74.163.7", fd=True',
            f'interface="virtual", channel="{channel}"',
        ),
        ('"demo/map.h5"', repr(str(rig.map))),
        ('"bus.toml"', repr(str(rig.bus_file))),
        ("import time\n", ""),
    ):
        assert before in code
        code = code.replace(before, after)
    heard = can.Bus(interface="virtual", channel=channel)

    def sleep(_: float) -> None:
        rig.send_until(lambda: capsys_lines(capsys, shown) > 8)

    shown: list[str] = []
    exec(compile(code, str(PAGE), "exec"), {"time": SimpleNamespace(sleep=sleep)})  # the page itself
    shown.append(capsys.readouterr().out)
    output = "".join(shown)
    assert "NO_DATA not usable" in output
    assert re.search(r"^(UNCONFIRMED|SUSPECT|VALID) .* 0\.\d+ s$", output, re.M)
    assert "('received', " in output
    identifiers = set()
    while (message := heard.recv(0.0)) is not None:
        identifiers.add(message.arbitration_id)
    heard.shutdown()
    assert {0x380, 0x381} <= identifiers, "results and status went out"


def capsys_lines(capsys: pytest.CaptureFixture, shown: list[str]) -> int:
    shown.append(capsys.readouterr().out)
    return sum(text.count("\n") for text in shown)


def listener_of(rig: Rig, bus: can.BusABC | None, results: list[Result], **given: Any) -> strainfmu.LoadListener:
    return strainfmu.LoadListener(rig.map, rig.bus_file, on_result=results.append, bus=bus, **given)


def test_results_silence_and_the_account(rig: Rig) -> None:
    results = list[Result]()
    with can.Bus(interface="virtual", channel=rig.bus.channel_info.split()[-1]) as bus:
        listener = listener_of(rig, bus, results)
        notifier = can.Notifier(bus, [listener])
        rig.send_until(lambda: any(is_known(result.quality) for result in results))
        end = time.monotonic() + PATIENCE
        while not results[-1].causes & Cause.SILENT:
            assert time.monotonic() < end, "a thread looks at the time"
            time.sleep(0.01)
        notifier.stop()
        n_results = len(results)
        time.sleep(0.3)
        assert len(results) == n_results, "no result comes after the end"
    assert listener.last is results[-1]
    assert listener.account.unaccounted == listener.account.pending == 0


def test_a_listener_that_sends_nothing_confirms_by_hand(rig: Rig) -> None:
    results = list[Result]()
    with can.Bus(interface="virtual", channel=rig.bus.channel_info.split()[-1]) as bus:
        listener = listener_of(rig, None, results)
        notifier = can.Notifier(bus, [listener])
        rig.send_until(lambda: any(is_known(result.quality) for result in results))
        rig.encoder.begin()
        rig.send_until(lambda: bool(results[-1].causes & Cause.UNPROVEN_RESTART))
        listener.confirm()
        rig.send_until(lambda: is_known(results[-1].quality))
        notifier.stop()


def test_with_asyncio(rig: Rig) -> None:
    results = list[Result]()

    async def run() -> None:
        loop = asyncio.get_running_loop()
        with can.Bus(interface="virtual", channel=rig.bus.channel_info.split()[-1]) as bus:
            notifier = can.Notifier(bus, [listener_of(rig, bus, results, loop=loop)], loop=loop)
            end = time.monotonic() + PATIENCE
            while not any(is_known(result.quality) for result in results):
                assert time.monotonic() < end, "it did not happen"
                rig.send()
                await asyncio.sleep(rig.pace.wait())
            notifier.stop()

    asyncio.run(run())


def test_what_does_not_fit_is_refused(rig: Rig) -> None:
    rig.bus_file.write_text("[tare]\nmap = 'map.h5'\n")
    with pytest.raises(InputError, match=r"tare\.map: expected with 'strainfmu bridge' alone"):
        strainfmu.LoadListener(strainfmu.load(rig.map), rig.bus_file)
    with pytest.raises(InputError, match="no such file"):
        strainfmu.LoadListener(rig.map, rig.bus_file.with_name("none.toml"))
