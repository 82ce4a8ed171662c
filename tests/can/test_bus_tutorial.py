"""The tutorial of the bus with the DBC file of a multiplexed rack: its file and commands, three flights sent."""

import shlex
import shutil
import signal
import socket
import subprocess
import sys
import time
import urllib.error
import urllib.request
from dataclasses import replace
from pathlib import Path
from typing import Any

import can
import numpy as np
import pytest
from bridge_table import is_late
from recorded_case import write_csv
from snippets import ROOT, snippets
from synthetic_vehicle import synthetic_inverse_map

from builder.pipeline.demonstration.bus_flight import private_port
from strainfmu.can.dbc_files import database_of
from strainfmu.cosim.estimators.description import gauge_names_of
from strainfmu.estimator.map.inverse_map import save_inverse_map
from strainfmu.fmu.export import export_estimator

SECTION = "## Your own DBC file"
STRAINFMU = [sys.executable, "-c", "from strainfmu.cli.main import main; main()"]
PATIENCE = 600.0
"""Time that a command may take on a busy host [s]."""
GROUP, ESTIMATE = "239.74.163.78", 0x380


def free_port(kind: int) -> int:
    with socket.socket(socket.AF_INET, kind) as one:
        one.bind(("127.0.0.1", 0))
        return int(one.getsockname()[1])


@pytest.fixture
def bench(tmp_path: Path) -> tuple[Path, list[str], str, str]:
    """Return a folder with all that the tutorial needs, its commands, its program, and the address of the page."""
    page = ROOT / "docs/tutorials/bus.md"
    text = page.read_text("utf-8")
    first = text[: text.index(SECTION)].count("\n")
    own = [one for one in snippets(page) if one.line > first]
    files = [one for one in own if one.kind == "file"]
    commands = [one.text.strip() for one in own if one.language == "sh"]
    (program,) = [one.text for one in own if one.language == "python"]
    assert [one.value for one in files] == ["bus.toml"]
    http = f"127.0.0.1:{free_port(socket.SOCK_STREAM)}"
    # A port of its own: another run of this test on the machine would be a second bridge on the bus.
    bus = files[0].text.replace("127.0.0.1:8780", http)
    bus = bus.replace('"239.74.163.7"\n', f'"{GROUP}"\noptions = {{ port = {private_port()} }}\n')
    bus = bus.replace("127.0.0.1:9870", f"127.0.0.1:{free_port(socket.SOCK_DGRAM)}")
    (tmp_path / "bus.toml").write_text(bus, encoding="utf-8")
    demo = tmp_path / "demo"
    demo.mkdir()
    rack = page.with_name("rack.dbc")
    shutil.copy(rack, tmp_path)
    gauges = tuple(s.name for s in database_of(rack.read_text("utf-8"), "rack").messages[0].signals[1:])
    inverse_map = replace(synthetic_inverse_map(1, 54), gauge_names=gauges)
    save_inverse_map(inverse_map, demo / "map.h5")
    export_estimator(demo / "map.h5", demo / "estimator.fmu")
    cycle = np.arange(150)[:, None]
    strain = inverse_map.mean_strain + 1e5 * np.sin(0.05 * cycle + np.arange(3.0)) @ inverse_map.state_operator.T
    names = list(gauge_names_of(demo / "estimator.fmu"))
    write_csv(
        demo / "flight.csv",
        ["time [s]", *(f"{name} [m/m]" for name in names), "dynamic_pressure [Pa]"],
        0.01 * cycle,
        strain,
        9e4 + 5.0 * cycle,
    )
    return tmp_path, commands, program, http


def started(command: str, folder: Path) -> subprocess.Popen[str]:
    return subprocess.Popen(
        [*STRAINFMU, *shlex.split(command)[1:]],
        cwd=folder,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
    )


def wait_for_page(http: str) -> str:
    for _ in range(round(10.0 * PATIENCE)):
        try:
            with urllib.request.urlopen(f"http://{http}/", timeout=5.0) as answer:
                return answer.read().decode()
        except (urllib.error.URLError, ConnectionError):
            time.sleep(0.1)
    raise AssertionError("no page")


@pytest.mark.slow
def test_one_file_and_four_commands_and_three_times_usable(
    bench: tuple[Path, list[str], str, str], monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    folder, commands, program, http = bench
    assert len(commands) == 4, commands
    bridge, page, send, dbc = commands
    running = [started(bridge, folder), started(page, folder)]
    try:
        assert running[0].stdout is not None
        assert "54 gauges, bus.toml" in running[0].stdout.readline()
        assert "<html" in wait_for_page(http).lower()
        flights = []
        for _ in range(3):
            begin, sent = time.time(), started(send, folder)
            printed, _ = sent.communicate(timeout=PATIENCE)
            assert sent.returncode == 0, printed
            flights.append((begin, time.time(), printed))
    finally:
        for one in running:
            one.send_signal(signal.SIGINT)
        ends = [one.communicate(timeout=PATIENCE)[0] for one in running]
    assert [one.returncode for one in running] == [0, 0], ends
    written = started(dbc, folder)
    printed, _ = written.communicate(timeout=PATIENCE)
    assert written.returncode == 0, printed
    monkeypatch.chdir(folder)
    names: dict[str, Any] = {}
    exec(compile(program, "bus.md", "exec"), names)
    quality = np.array([str(result["Quality"]) for result in names["decoded"]])
    assert f"'Unprotected': {(quality == 'Unprotected').sum()}" in capsys.readouterr().out
    with can.LogReader(folder / "own.blf") as log:
        when = np.array([message.timestamp for message in log if message.arbitration_id == ESTIMATE])
    for begin, end, printed in flights:
        usable = (quality[(begin < when) & (when < end)] == "Unprotected").sum()
        assert is_late(ends[0], printed, 0.01) or usable > 75, "none is confirmed by hand"
