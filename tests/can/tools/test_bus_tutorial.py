"""The tutorial of the bus with one's own DBC file: its file and commands, and a flight sent three times."""

from __future__ import annotations

import re
import shlex
import signal
import socket
import subprocess
import sys
import time
import urllib.error
import urllib.request
from pathlib import Path

import numpy as np
import pytest
from recorded_case import read_csv, write_csv
from snippets import ROOT, snippets
from synthetic_vehicle import synthetic_inverse_map

from strainfmu.can.cycle.states.quality import Quality
from strainfmu.can.tools.two_processes import private_port
from strainfmu.cosim.estimators.description import gauge_names_of
from strainfmu.estimator.map.inverse_map import save_inverse_map
from strainfmu.fmu.export import export_estimator

SECTION = "## Your own DBC file"
STRAINFMU = [sys.executable, "-c", "from strainfmu.cli.main import main; main()"]
GROUP = "239.74.163.78"


def free_port(kind: int) -> int:
    with socket.socket(socket.AF_INET, kind) as one:
        one.bind(("127.0.0.1", 0))
        return int(one.getsockname()[1])


@pytest.fixture
def bench(tmp_path: Path) -> tuple[Path, list[str], str]:
    """Return a folder with the bus file and what the tutorial needs, its commands, and the address of the page."""
    page = ROOT / "docs/tutorials/bus.md"
    text = page.read_text("utf-8")
    first, last = (text[: text.index(mark)].count("\n") for mark in (SECTION, "## Send it again"))
    own = [one for one in snippets(page) if first < one.line < last]
    files = [one for one in own if one.kind == "file"]
    commands = [one.text.strip() for one in own if one.kind in ("slow", "background")]
    commands += re.findall(r"`(strainfmu replay [^`]*)`", text[text.index(SECTION) :])
    assert [one.value for one in files] == ["bus.toml"]
    http = f"127.0.0.1:{free_port(socket.SOCK_STREAM)}"
    # A port of its own: another run of this test on the machine would be a second bridge on the bus.
    bus = files[0].text.replace("127.0.0.1:8780", http)
    bus = bus.replace('"239.74.163.7"\n', f'"{GROUP}"\noptions = {{ port = {private_port()} }}\n')
    bus = bus.replace("127.0.0.1:9870", f"127.0.0.1:{free_port(socket.SOCK_DGRAM)}")
    (tmp_path / "bus.toml").write_text(bus, encoding="utf-8")
    demo = tmp_path / "demo"
    demo.mkdir()
    inverse_map = synthetic_inverse_map(1, 54)
    save_inverse_map(inverse_map, demo / "map.h5")
    export_estimator(demo / "map.h5", demo / "estimator.fmu")
    cycle = np.arange(300)[:, None]
    strain = inverse_map.mean_strain + 1e5 * np.sin(0.05 * cycle + np.arange(3.0)) @ inverse_map.state_operator.T
    names = list(gauge_names_of(demo / "estimator.fmu"))
    write_csv(
        demo / "flight.csv",
        ["time [s]", *(f"{name} [m/m]" for name in names), "dynamic_pressure [Pa]"],
        0.01 * cycle,
        strain,
        9e4 + 5.0 * cycle,
    )
    ran = subprocess.run(
        [*STRAINFMU, "dbc", "demo/map.h5", "-o", "strains.dbc"], cwd=tmp_path, check=False, capture_output=True
    )
    assert ran.returncode == 0, ran.stderr
    return tmp_path, commands, http


def started(command: str, folder: Path) -> subprocess.Popen[str]:
    return subprocess.Popen(
        [*STRAINFMU, *shlex.split(command)[1:]],
        cwd=folder,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
    )


def wait_for_page(http: str) -> str:
    for _ in range(600):
        try:
            with urllib.request.urlopen(f"http://{http}/", timeout=5.0) as answer:
                return answer.read().decode()
        except (urllib.error.URLError, ConnectionError):
            time.sleep(0.1)
    raise AssertionError("no page")


def test_one_file_and_four_commands_and_three_times_valid(bench: tuple[Path, list[str], str]) -> None:
    folder, commands, http = bench
    assert len(commands) == 4, commands
    bridge, page, send, replay = commands
    running = [started(bridge, folder), started(page, folder)]
    try:
        assert running[0].stdout is not None
        assert "54 gauges, bus.toml" in running[0].stdout.readline()
        assert "<html" in wait_for_page(http).lower()
        for _ in range(3):
            sent = started(send, folder)
            printed, _ = sent.communicate(timeout=120)
            assert sent.returncode == 0, printed
            time.sleep(0.5)
    finally:
        for one in running:
            one.send_signal(signal.SIGINT)
        ends = [one.communicate(timeout=60)[0] for one in running]
    assert [one.returncode for one in running] == [0, 0], ends
    given = started(replay, folder)
    printed, _ = given.communicate(timeout=120)
    assert given.returncode == 0, printed
    quality = read_csv(folder / "own.csv")["quality [1]"]
    answered = np.isin(quality, [Quality.VALID, Quality.DEGRADED, Quality.UNCONFIRMED, Quality.SUSPECT])
    silent = np.convolve(~answered, np.ones(20), "same") == 20  # between the flights
    flights = np.split(quality, np.flatnonzero(np.diff(silent.astype(int)) > 0))
    n_valid = [int((flight == Quality.VALID).sum()) for flight in flights]
    n_valid = [number for number in n_valid if number]
    assert len(n_valid) == 3, n_valid
    assert min(n_valid) > 150, n_valid
