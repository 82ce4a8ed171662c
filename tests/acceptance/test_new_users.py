"""What new users do with a finished demonstration: own recorder, own importer, own bus, by the command line."""

import csv
import json
import re
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from multicast import skip_without_multicast
from recorded_case import read_csv

from builder.pipeline.demonstration.bus_flight import private_port
from strainfmu.arrays import FloatArray
from strainfmu.can.quality import Quality

Run = Callable[..., tuple[int, str, str]]
Typed = Callable[..., tuple[str, str]]
STRAINFMU = [sys.executable, "-c", "from strainfmu.cli.main import main; main()"]
COEFFICIENTS = ("C_A", "C_N", "C_Y", "M_P", "M_Y")
FLOW = ("dynamic_pressure", "mach_number", "altitude")
N_GAUGES = 54
GROUP = "239.74.163.81"
SENT = 300
"""Cycles that the sender of the bus sends."""


@pytest.fixture
def typed(run: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Typed:
    """Return a function that runs a command that must succeed, in the folder; what it printed, and its errors."""
    monkeypatch.chdir(tmp_path)

    def call(*command: object) -> tuple[str, str]:
        code, printed, errors = run(*command)
        assert code == 0, printed + errors
        return printed, errors

    return call


def flown(demo: Path) -> tuple[FloatArray, FloatArray, FloatArray, dict[str, FloatArray]]:
    """Return times (n,) [s], strains (n, n_d) [m/m], flow (n, 3) [Pa, 1, m] and truth (n,) [1] by coefficient."""
    with (demo / "flight.csv").open(encoding="utf-8") as stream:
        names, *rows = list(csv.reader(stream))
    flight = dict(zip(names, np.array(rows, dtype=float).T, strict=True))
    strain = np.column_stack([flight[f"plant.strain[{i}]"] for i in range(1, N_GAUGES + 1)])
    flow = np.column_stack([flight[f"plant.{name}"] for name in FLOW])
    return flight["time"], strain, flow, {name: flight[f"plant.{name}"] for name in COEFFICIENTS}


def own_recording(demo: Path, path: Path, headings: tuple[str, str, str], unit: str = " [um/m]") -> None:
    """Write the flight as a recorder of one's own does: own names, semicolons, um/m, kPa and km."""
    t, strain, flow, _ = flown(demo)
    names = ["Time [s]", *(f"SG{i:02d}_ax{unit}" for i in range(1, N_GAUGES + 1)), *headings]
    table = np.column_stack([t, 1e6 * strain, flow * [1e-3, 1.0, 1e-3]])
    np.savetxt(path, table, fmt="%.9g", delimiter=";", header=";".join(names), comments="")


def assert_within_three_sigma(estimate: FloatArray, sigma: FloatArray, truth: FloatArray) -> None:
    """Check estimates that are close and that claim to be: sigma is small against the range of the truth."""
    assert np.all(np.abs(estimate - truth) <= 3.0 * sigma)
    assert np.median(sigma) < 0.15 * np.ptp(truth)


def test_loads_from_a_recording_with_names_of_its_own(
    ic3x_demo: Path, tmp_path: Path, run: Run, typed: Typed
) -> None:
    """Two commands, and the first attempt, which fails, names the one of them that helps."""
    own_recording(ic3x_demo, tmp_path / "run7.csv", ("q_inf [kPa]", "Mach", "Altitude [km]"))
    map_file = ic3x_demo / "map.h5"
    code, _, errors = run("estimate", map_file, "run7.csv", "-o", "loads.csv")
    assert code == 2
    assert "which 'strainfmu channels MAP DATA' proposes" in errors
    assert "--ignore-columns" not in errors
    printed, _ = typed("channels", map_file, "run7.csv", "-o", "channels.toml")
    assert f"{N_GAUGES} of {N_GAUGES} gauges have a channel" in printed
    assert "without" not in printed
    proposed = re.search(r"then: strainfmu (.*)", printed)
    assert proposed is not None
    printed, errors = typed(*proposed[1].split())
    assert "health: OK 2001\n" in printed
    assert (errors, "not used" in printed) == ("", False)
    loads, (_, _, flow, truth) = read_csv(tmp_path / "loads.csv"), flown(ic3x_demo)
    assert len(flow) == len(loads["C_N [1]"])
    for name in ("C_N", "C_Y"):
        assert_within_three_sigma(loads[f"{name} [1]"], loads[f"sigma.{name} [1]"], truth[name])


def test_what_a_recording_lacks_is_said_before_the_estimate(ic3x_demo: Path, tmp_path: Path, typed: Typed) -> None:
    """No unit of strain, and an altitude that might be geometric, are named by the command that proposes."""
    own_recording(ic3x_demo, tmp_path / "run8.csv", ("q_inf [kPa]", "Ma", "H_geo [km]"), unit="")
    printed, _ = typed("channels", ic3x_demo / "map.h5", "run8.csv", "-o", "channels.toml")
    assert "without an entry, not read: H_geo\n" in printed
    assert "without a unit, which [defaults] of the file must state: SG01_ax, " in printed
    channels = tmp_path / "channels.toml"
    text = channels.read_text("utf-8")
    channels.write_text(text.replace("# unit = ", "unit = ", 1), encoding="utf-8")
    command = ("estimate", ic3x_demo / "map.h5", "run8.csv", "-o", "loads.csv", "--channels", "channels.toml")
    printed, _ = typed(*command)
    assert "run8.csv: 1 column not used: H_geo\n" in printed
    loads, truth = read_csv(tmp_path / "loads.csv"), flown(ic3x_demo)[3]
    assert_within_three_sigma(loads["C_N [1]"], loads["sigma.C_N [1]"], truth["C_N"])


def test_the_fmu_of_fmi_3_in_fmpy_with_air_data(ic3x_demo: Path, tmp_path: Path, typed: Typed) -> None:
    """The export names what FMPy cannot run; the form with scalars gives coefficients and health over time."""
    from fmpy import simulate_fmu

    printed, _ = typed("export", ic3x_demo / "map.h5", "--fmi", "3", "-o", "arrays_3.fmu")
    assert "fmpy.simulate_fmu does not take; --scalars has none" in printed
    printed, _ = typed("export", ic3x_demo / "map.h5", "--fmi", "3", "--scalars", "-o", "scalars_3.fmu")
    assert "simulate_fmu" not in printed
    t, strain, flow, truth = (
        {name: one[::10] for name, one in part.items()} if isinstance(part, dict) else part[::10]
        for part in flown(ic3x_demo)
    )
    inputs = {f"strain[{i + 1}]": strain[:, i] for i in range(N_GAUGES)} | dict(zip(FLOW, flow.T, strict=True))
    signals = np.zeros(len(t), dtype=[("time", float), *((name, float) for name in inputs)])
    signals["time"] = t
    for name, values in inputs.items():
        signals[name] = values
    result = simulate_fmu(tmp_path / "scalars_3.fmu", input=signals, stop_time=t[-1], output_interval=0.1)
    assert len(result["time"]) == len(t)
    assert set(result["health.state"].tolist()) == {0}
    assert result["health.usable"].all()
    for name in COEFFICIENTS:  # an importer holds inputs over a step
        error = np.abs(result[name][1:] - truth[name][:-1])
        assert np.all(error <= 3.0 * result[f"sigma.{name}"][1:]), name


def write_rack(folder: Path) -> None:
    """Write the DBC file of a rack with frames of its own: 16 bits a gauge, and air data in kPa and km."""
    lines = ['VERSION ""', "NS_ :", "BS_:", "BU_: Rack"]
    half = N_GAUGES // 2
    for frame in (0, 1):
        lines.append(f"BO_ {0x120 + frame} Rack{frame + 1}: 64 Rack")
        for k in range(half):
            name = f"SG{half * frame + k + 1:02d}_ax"
            lines.append(f' SG_ {name} : {16 * k}|16@1- (0.05,0) [-1600|1600] "um/m" Vector__XXX')
        lines.append(f' SG_ Time{frame + 1} : {16 * half}|32@1+ (1,0) [0|4294967295] "us" Vector__XXX')
    lines += [
        f"BO_ {0x130} Air: 8 Rack",
        ' SG_ q_inf : 0|24@1+ (0.001,0) [0|16000] "kPa" Vector__XXX',
        ' SG_ Mach : 24|16@1+ (0.001,0) [0|20] "" Vector__XXX',
        ' SG_ Alt : 40|16@1+ (0.001,0) [0|60] "km" Vector__XXX',
        'BA_DEF_ BO_ "GenMsgCycleTime" INT 0 10000;',
        'BA_DEF_ BO_ "VFrameFormat" ENUM "StandardCAN","ExtendedCAN",'
        + ",".join(f'"reserved{i}"' for i in range(2, 14))
        + ',"StandardCAN_FD","ExtendedCAN_FD";',
        'BA_DEF_DEF_ "GenMsgCycleTime" 10;',
        'BA_DEF_DEF_ "VFrameFormat" "StandardCAN";',
        *(f'BA_ "VFrameFormat" BO_ {0x120 + frame} 14;' for frame in (0, 1)),
    ]
    (folder / "rack.dbc").write_text("\n".join(lines) + "\n", encoding="utf-8")


def write_bus(folder: Path, demo: Path, port: int) -> None:
    strains = [f'"strain[{i + 1}]" = "Rack{1 + 2 * i // N_GAUGES}.SG{i + 1:02d}_ax"' for i in range(N_GAUGES)]
    lines = [
        *("[bus]", 'interface = "udp_multicast"', f'channel = "{GROUP}"', f"options = {{ port = {port} }}"),
        *("[input]", 'dbc = "rack.dbc"', f'gauges = "{(demo / "map.h5").as_posix()}"'),
        *("[input.strain]", *strains),
        *("[input.dynamic_pressure]", 'signal = "Air.q_inf"', "[input.mach_number]", 'signal = "Air.Mach"'),
        *("[input.altitude]", 'signal = "Air.Alt"'),
        *("[input.sample_time]", 'Rack1 = "Rack1.Time1"', 'Rack2 = "Rack2.Time2"'),
        *("[trust]", 'restart = "accept"', "[record]", 'file = "own.blf"'),
    ]
    (folder / "bus.toml").write_text("\n".join(lines) + "\n", encoding="utf-8")


@pytest.mark.slow
def test_a_bridge_on_a_bus_with_signals_of_its_own(ic3x_demo: Path, tmp_path: Path, typed: Typed) -> None:
    """Bridge, sender, recording; a replay repeats every result that was on the bus, coefficients by the truth."""
    skip_without_multicast()
    write_rack(tmp_path)
    write_bus(tmp_path, ic3x_demo, private_port())
    bridge = subprocess.Popen(
        [*STRAINFMU, "bridge", str(ic3x_demo / "estimator.fmu"), "--bus", "bus.toml"],
        cwd=tmp_path,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
    )
    try:
        assert bridge.stdout is not None
        assert f"{N_GAUGES} gauges, bus.toml" in bridge.stdout.readline()
        assert "UNPROTECTED" in bridge.stdout.readline()
        command = ("send", ic3x_demo / "flight.csv", "--bus", "bus.toml", "--duration", 0.01 * SENT)
        sent, _ = typed(*command)
        time.sleep(0.5)
    finally:
        bridge.terminate()
        ended, _ = bridge.communicate(timeout=60)
    assert bridge.returncode == 0, ended
    assert re.search(rf"results heard on the bus: \d+ of {SENT} cycles answered, \d+ with coefficients", sent)
    assert "nan" not in sent, "recorded strains have no truth on the bus"
    assert json.loads((tmp_path / "own.blf.json").read_text("utf-8"))["end"] is not None
    printed, _ = typed("replay", "own.blf", ic3x_demo / "estimator.fmu", "-o", "own.csv")
    again = re.search(r"given again\D*(\d+) of (\d+)", printed)
    assert again is not None
    assert int(again[1]) > 0, "those may differ that went out late; tests/can/test_replay.py has none"
    found, truth = read_csv(tmp_path / "own.csv"), flown(ic3x_demo)[3]
    good = np.isin(found["quality [1]"], [Quality.UNPROTECTED, Quality.DEGRADED])
    assert good.any(), "how many are in time is the host's"
    cycle = np.rint(found["sample_time [tick]"][good] / 1e4).astype(int)
    for name in COEFFICIENTS:
        error = np.abs(found[f"{name} [1]"][good] - truth[name][cycle])
        assert np.all(error <= 3.0 * found[f"sigma.{name} [1]"][good]), name
