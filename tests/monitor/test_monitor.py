"""The live view: datagrams that never block, a server on loopback, a page that a browser shows."""

import http.client
import json
import re
import signal
import socket
import subprocess
import sys
import time
import tracemalloc
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from page_results import OUTSIDE, publisher, result
from synthetic_vehicle import N_GAUGES, SyntheticFiles

from strainfmu.can.options import PUBLISH_RATE
from strainfmu.can.page_message import GaugePosition, gauge_positions, result_message
from strainfmu.can.publisher import CHANGES_AT_ONCE, Publisher, parsed_address
from strainfmu.can.quality import Cause, FrameAccount, Quality
from strainfmu.errors import InputError, StrainfmuError
from strainfmu.monitor.server import PAGE_FILES, PUSH_PERIOD, Monitor, page_file
from strainfmu.monitor.state import MonitorState


def get(monitor: Monitor, path: str, host: str | None = None) -> tuple[int, bytes]:
    address = monitor.url.removeprefix("http://").rstrip("/")
    connection = http.client.HTTPConnection(address, timeout=60)
    connection.request("GET", path, headers={} if host is None else {"Host": host})
    answer = connection.getresponse()
    content = answer.read()
    connection.close()
    return answer.status, content


def until(condition: Callable[[], bool], seconds: float = 60.0) -> None:
    end = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < end
        time.sleep(0.01)


@pytest.mark.fast
def test_datagrams_are_plain_json() -> None:
    """What PlotJuggler's UDP server reads: one object per datagram, numbers under names, a time stamp."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as ears:
        ears.bind(("127.0.0.1", 0))
        ears.settimeout(60.0)
        mouth = publisher(ears.getsockname()[1])
        mouth.result(result())
        layout, content = json.loads(ears.recv(1 << 16)), json.loads(ears.recv(1 << 16))
        mouth.close()
    assert [gauge["roll_angle"] for gauge in layout["layout"]["gauges"]] == [0.0, 90.0, 180.0]
    assert content["strain_um_per_m"] == {"a": 1.0, "b": None, "c": -3.0}
    assert content["coefficients"]["M_Y"] == 0.5
    assert content["sigma"]["C_A"] is None  # NaN is no JSON
    assert (content["quality_name"], content["causes"]) == ("VALID", ["PARTIAL_CYCLE"])
    assert content["timestamp"] == pytest.approx(time.time(), abs=10.0)
    assert content["account"]["not accounted for"] == 0


@pytest.mark.fast
def test_the_state_outside_comes_with_its_cause(monitor: Monitor) -> None:
    mouth = publisher(monitor.listens_at[1], score_limit=3.0)
    mouth.result(result(Quality.SUSPECT, **OUTSIDE))
    until(lambda: monitor.state.datagrams == 2)
    latest = json.loads(get(monitor, "/state")[1])["latest"]
    assert latest["health_name"] == "OUTSIDE"
    assert latest["health_text"] == "the coefficients are outside what the map covers"
    assert (latest["envelope_score"], latest["envelope_score_limit"]) == (4.26, 3.0)
    assert (latest["mach_number"], latest["altitude_m"]) == (6.02, 20_100.0)
    mouth.result(result())
    until(lambda: monitor.state.datagrams == 3)
    latest = json.loads(get(monitor, "/state")[1])["latest"]
    keys = ("health_text", "envelope_score", "mach_number", "altitude_m")
    assert [latest[key] for key in keys] == [None] * 4
    mouth.close()


@pytest.mark.fast
def test_a_bridge_of_an_earlier_version_is_shown(monitor: Monitor) -> None:
    mouth = publisher(monitor.listens_at[1])
    new = ("health_text", "envelope_score", "envelope_score_limit", "mach_number", "altitude_m")
    newer = ("sequence", "uptime_s", "chi_square_limit", "gauges_used", "suspects", "suspect_gauge", "recording")
    objects = ("causes_since", "loads", "loads_sigma", "not_used", "results", "bus")
    sent = answer_of(mouth).items()
    content = {name: value for name, value in sent if name not in (*new, *newer, *objects)}
    monitor.state.take(json.dumps(content).encode(), 0.0)
    assert (monitor.state.datagrams, monitor.state.refused) == (1, 0)
    latest = json.loads(get(monitor, "/state")[1])["latest"]
    assert [latest[name] for name in (*new, *newer)] == [None] * 12
    assert latest["not_used"] == {"b": "not used"}
    assert latest["bus"] == {"name": None, "last_fault": None, "reconnects": None}
    mouth.close()


@pytest.mark.fast
def test_a_publisher_without_a_listener_never_blocks() -> None:
    mouth = publisher(9)  # nobody there; on loopback a full receive buffer drops, it does not block
    begin = time.monotonic()
    for _ in range(2000):
        mouth._next = 0.0
        mouth.result(result())
    assert time.monotonic() - begin < 30.0  # a block would be for ever
    mouth.close()
    mouth.result(result(Quality.STALE))  # a closed socket is one more thing that cannot be sent to
    assert mouth.dropped >= 1


@pytest.mark.fast
def test_the_rate_is_limited_but_for_a_change_of_quality() -> None:
    mouth = publisher(9, rate=0.01)
    for _ in range(10):
        mouth.result(result())
    until(lambda: mouth.sent + mouth.dropped == 2)  # layout and result
    mouth.result(result(Quality.STALE))
    until(lambda: mouth.sent + mouth.dropped == 3)
    mouth.close()
    assert mouth.sent + mouth.dropped == 3


@pytest.mark.fast
def test_a_flapping_quality_costs_no_more_than_the_rate_and_loses_nothing() -> None:
    """A thousand changes a second: five at once, then as many as the rate; all causes and counts."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as ears:
        ears.bind(("127.0.0.1", 0))
        ears.settimeout(60.0)
        mouth = publisher(ears.getsockname()[1], rate=PUBLISH_RATE)
        begin, n_results = time.monotonic(), 0
        while time.monotonic() < begin + 1.0:
            mouth.result(result((Quality.VALID, Quality.STALE)[n_results % 2]))
            n_results += 1
            time.sleep(1e-3)
        took = time.monotonic() - begin
        rare = result(Quality.STALE)
        rare.causes = Cause.FROZEN
        mouth.result(rare)  # whether it is sent by itself or not
        time.sleep(2.0 / PUBLISH_RATE)
        mouth.result(result(Quality.DEGRADED))
        mouth.close()
        received = [json.loads(ears.recv(1 << 16)) for _ in range(mouth.sent)]
    messages = [content for content in received if "layout" not in content]
    during = len(messages) - 2
    assert CHANGES_AT_ONCE <= during <= CHANGES_AT_ONCE + 1 + PUBLISH_RATE * took
    last = messages[-1]
    assert last["quality_name"] == "DEGRADED", "what lasts is sent"
    assert sum(last["results"].values()) == n_results + 2
    assert any("FROZEN" in content["causes_since"] for content in messages)
    assert mouth.dropped == 0


@pytest.mark.fast
def test_messages_of_ever_new_numbers_do_not_fill_the_memory() -> None:
    gauges = [GaugePosition(name) for name in "abc"]
    result_message(result(), gauges, None, Cause.NONE)
    tracemalloc.start()
    for number in range(2000):
        result_message(result(value=1e-6 * number, chi_square=1.0 + number), gauges, None, Cause.NONE)
    grown, _ = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert grown < 100_000


@pytest.mark.fast
def test_places_of_the_gauges_come_from_the_fmu(synthetic: SyntheticFiles) -> None:
    positions = gauge_positions(synthetic.estimator_1)
    assert [position.name for position in positions] == [f"G{i}" for i in range(N_GAUGES)]
    # synthetic_vehicle puts them evenly from 0.3 to 3.3 m and around.
    np.testing.assert_allclose([position.x for position in positions], np.linspace(0.3, 3.3, N_GAUGES), atol=1e-3)
    assert len({position.roll_angle for position in positions}) == N_GAUGES


@pytest.mark.fast
def test_addresses() -> None:
    assert parsed_address("127.0.0.1:9870", "--publish") == ("127.0.0.1", 9870)
    assert parsed_address("[::1]:5", "--publish") == ("::1", 5)
    for text in ("9870", "host:", "host:x", "host:70000"):
        with pytest.raises(InputError, match="HOST:PORT such as"):
            parsed_address(text, "--publish")


@pytest.mark.fast
def test_garbage_is_counted_and_changes_nothing(monitor: Monitor) -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as mouth:
        bad = [b"\xff\x00", b"[]", b"{}", b'{"layout":{"gauges":[1]}}', b"[" * 60000, b'{"coefficients":{}}']
        for datagram in bad:
            mouth.sendto(datagram, monitor.listens_at)
    until(lambda: monitor.state.refused == len(bad))
    content = json.loads(get(monitor, "/state")[1])
    assert (content["latest"], content["layout"]["gauges"], content["datagrams"]) == (None, [], 0)


def answer_of(mouth: Publisher) -> dict[str, Any]:
    answer: dict[str, Any] = json.loads(json.dumps(mouth._message(result(), Cause.NONE, time.time())))
    return answer


@pytest.mark.fast
@pytest.mark.parametrize(("digits", "good"), [(0, True), (20, True), (True, False), (21, False), (1.0, False)])
def test_decimals_of_a_table_are_whole_numbers_to_20(digits: Any, good: bool) -> None:
    state = MonitorState()
    column = {"text": "M", "unit": "N m", "factor": 1.0, "digits": digits}
    table = {"title": "x", "place": "y", "rows": [], "columns": [column]}
    state.take(json.dumps({"layout": {"gauges": [], "load_tables": [table]}}).encode(), 0.0)
    assert (state.datagrams, state.refused) == ((1, 0) if good else (0, 1))


@pytest.mark.fast
def test_what_no_page_can_read_is_counted_and_changes_nothing(monitor: Monitor) -> None:
    """Numbers that JSON does not have, or that no double holds; keys of others are not passed on, however deep."""
    mouth = publisher(monitor.listens_at[1])
    good = answer_of(mouth)
    bad: list[tuple[str, Any]] = [
        ("timestamp", 10**400),
        ("timestamp", float("nan")),
        ("timestamp", None),
        ("timestamp", True),
        ("chi_square", float("inf")),
        ("age_ms", "<b>1</b>"),
        ("quality_name", 5),
        ("causes", [{}]),
        ("account", {"received": [1]}),
        ("coefficients", dict.fromkeys(good["coefficients"], float("-inf"))),
        ("strain_um_per_m", {"a": 10**400}),
    ]
    for name, value in bad:
        monitor.state.take(json.dumps({**good, name: value}).encode(), 0.0)
    monitor.state.take(json.dumps(good).replace('"age_ms": 2.0', '"age_ms": 1e400').encode(), 0.0)
    assert '"age_ms": 2.0' in json.dumps(good)
    assert (monitor.state.refused, monitor.state.datagrams) == (len(bad) + 1, 0)
    deep = json.dumps(good)[:-1] + ', "more": ' + "[" * 900 + "]" * 900 + "}"
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sender:
        sender.sendto(json.dumps({**good, "timestamp": 10**400}).encode(), monitor.listens_at)
        sender.sendto(deep.encode(), monitor.listens_at)  # the thread lives on
    until(lambda: monitor.state.datagrams + monitor.state.refused == len(bad) + 3)
    assert monitor.state.datagrams == 1
    latest = json.loads(get(monitor, "/state")[1])["latest"]
    del good["datagrams"]
    good["bus"] = {"name": None, "last_fault": None, "reconnects": None}
    assert latest == good
    mouth.close()


@pytest.mark.fast
@pytest.mark.parametrize("host", ["127.0.0.2", "::1"])
def test_all_of_loopback_is_loopback(host: str) -> None:
    try:
        running = Monitor(("127.0.0.1", 0), (host, 0))
    except StrainfmuError:
        pytest.skip(f"{host} is not an address of this host")
    try:
        shown = f"[{host}]" if ":" in host else host
        assert running.url.startswith(f"http://{shown}:")
        assert get(running, "/") == (200, page_file("/"))
        for name in ("localhost", "LOCALHOST:1", "127.9.9.9:80", "[::1]", "[::ffff:127.0.0.1]:5"):
            assert get(running, "/state", name)[0] == 200, name
        for name in (
            "evil.example",
            "evil.example:80",
            "localhost.evil.example",
            "127.0.0.1.evil.example",
            "::",
            "",
        ):
            assert get(running, "/state", name)[0] == 403, name
    finally:
        running.close()


@pytest.mark.fast
def test_the_server_is_on_loopback_and_answers_nobody_else(monitor: Monitor) -> None:
    assert monitor.url.startswith("http://127.0.0.1:")
    assert monitor.listens_at[0] == "127.0.0.1"
    assert get(monitor, "/") == (200, page_file("/"))
    assert get(monitor, "/etc/passwd")[0] == 404
    # A foreign name that was made to point here, as in DNS rebinding.
    assert get(monitor, "/state", "evil.example")[0] == 403
    with pytest.raises(StrainfmuError, match=r"datagrams at 127\.0\.0\.1"):
        Monitor(monitor.listens_at, ("127.0.0.1", 0))


@pytest.mark.fast
def test_the_page_needs_nothing_from_elsewhere() -> None:
    """No address of another host in any of its files; the names of SVG's elements are none."""
    for address in PAGE_FILES:
        text = page_file(address).decode()
        found = re.findall(r"(?:https?:)?//[\w.]+\.\w+[^\s\"')]*", text)
        assert set(found) <= {"http://www.w3.org/2000/svg"}, address


@pytest.mark.fast
def test_every_file_of_the_page_is_served_and_nothing_else_is_fetched(monitor: Monitor) -> None:
    asked = set(re.findall(r'(?:href|src)="(page/[^"]+)"', page_file("/").decode()))
    for address in PAGE_FILES:
        asked |= {f"page/{name}" for name in re.findall(r'from "\./([^"]+)"', page_file(address).decode())}
        assert get(monitor, address) == (200, page_file(address))
    assert {f"/{name}" for name in asked} | {"/"} == set(PAGE_FILES)
    assert get(monitor, "/page/../state.py")[0] == 404


@pytest.mark.fast
def test_events_carry_what_is_newest(monitor: Monitor) -> None:
    address = monitor.url.removeprefix("http://").rstrip("/")
    connection = http.client.HTTPConnection(address, timeout=60)
    connection.request("GET", "/events")
    stream = connection.getresponse()
    first = json.loads(stream.readline().removeprefix(b"data: "))
    assert (first["latest"], first["points"], first["events"]) == (None, [], [])
    mouth = publisher(monitor.listens_at[1])
    begin = time.monotonic()
    for k in range(100):
        mouth.result(result(value=float(k)))
        mouth._next = 0.0
        until(lambda: not mouth._waiting)

    def is_last() -> bool:
        mouth._next = 0.0
        mouth.result(result(value=500.0))
        latest = json.loads(monitor.state.snapshot(time.monotonic()))["latest"]
        return latest is not None and latest["coefficients"]["C_A"] == 500.0

    until(is_last)
    seen = []
    while not seen or seen[-1] != 500.0:
        line = stream.readline()
        if line.startswith(b"data: ") and (latest := json.loads(line.removeprefix(b"data: "))["latest"]):
            seen.append(latest["coefficients"]["C_A"])
    # Newest only: far fewer events than datagrams.
    assert len(seen) <= (time.monotonic() - begin) / PUSH_PERIOD + 5.0
    mouth.close()
    connection.close()


@pytest.mark.fast
def test_monitor_as_a_command(tmp_path: Path) -> None:
    process = subprocess.Popen(
        [
            *(sys.executable, "-c", "from strainfmu.cli.main import main; main()", "monitor"),
            *("--listen", "127.0.0.1:0", "--http", "127.0.0.1:0"),
        ],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    assert process.stdout is not None
    assert process.stdout.readline().startswith("http://127.0.0.1:")
    process.send_signal(signal.SIGTERM)
    out, errors = process.communicate(timeout=60)
    assert (process.returncode, out, errors) == (0, "0 datagrams, 0 refused\n", "")


def test_a_token_limits_who_may_publish() -> None:
    monitor = Monitor(("127.0.0.1", 0), ("127.0.0.1", 0), token="secret of the rack")
    foreign = publisher(monitor.listens_at[1])
    foreign.result(result())
    until(lambda: monitor.state.refused == 2)
    wrong = Publisher(
        monitor.listens_at,
        [GaugePosition(name, 0.5, 0.0) for name in "abc"],
        rate=1e4,
        account=FrameAccount,
        token="another",
    )
    wrong.result(result())
    until(lambda: monitor.state.refused == 4)
    assert monitor.state.datagrams == 0
    own = Publisher(
        monitor.listens_at,
        [GaugePosition(name, 0.5, 0.0) for name in "abc"],
        rate=1e4,
        account=FrameAccount,
        token="secret of the rack",
    )
    own.result(result())
    until(lambda: monitor.state.datagrams == 2)
    assert "secret" not in get(monitor, "/state")[1].decode()
    for one in (foreign, wrong, own):
        one.close()
    monitor.close()


@pytest.mark.fast
def test_who_publishes_is_shown_and_forgotten_when_silent() -> None:
    state, content = MonitorState(), json.dumps({"layout": {"gauges": []}}).encode()
    state.take(content, 0.0, "127.0.0.1:5000")
    state.take(content, 1.0, "127.0.0.1:5001")
    assert json.loads(state.snapshot(1.2))["publishers"] == ["127.0.0.1:5000", "127.0.0.1:5001"]
    assert json.loads(state.snapshot(2.0))["publishers"] == ["127.0.0.1:5001"]
