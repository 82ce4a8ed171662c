"""The commands bridge and dbc: wrong arguments, a signal, a file."""

import signal
import socket
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import cantools
import pytest
from synthetic_vehicle import SyntheticFiles, synthetic_inverse_map

from strainfmu.estimator.map.inverse_map import save_inverse_map


def test_the_command_ends_on_ctrl_c_with_a_summary(synthetic: SyntheticFiles) -> None:
    """As on SIGTERM, which ends the bridges of test_two_processes.py and test_bus_file.py."""
    command = [sys.executable, "-c", "from strainfmu.cli.main import main; main()", "bridge"]
    command += [str(synthetic.estimator_1), "--interface", "virtual", "--channel", "x", "--profile", "classic-le"]
    command += ["--set", "input.dynamic_pressure_pa=1e5"]
    ears = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    ears.bind(("127.0.0.1", 0))
    ears.settimeout(120.0)
    command += ["--set", "page.publish={}:{}".format(*ears.getsockname())]
    with ears, subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as bridge:
        assert bridge.stdout is not None
        assert "6 gauges, classic-le" in bridge.stdout.readline()
        ears.recv(1 << 16)  # it has answered the silence
        bridge.send_signal(signal.SIGINT)
        printed, errors = bridge.communicate(timeout=120)
    assert bridge.returncode == 0, errors
    assert errors == ""
    assert "results NO_DATA" in printed
    assert "frames: not accounted for" in printed


BUS = ["bridge", "x.fmu", "--interface", "virtual", "--channel", "x"]


@pytest.mark.parametrize(
    ("arguments", "text"),
    [
        (["bridge", "nowhere.fmu", "--interface", "virtual", "--channel", "x"], "nowhere.fmu: no such FMU"),
        ([*BUS, "--set", "input.dbc=a.dbc"], "input.strain: expected a signal for each gauge of input.dbc"),
        ([*BUS, "--set", "input.id_base=z"], "--set input.id_base: expected a whole number, got 'z'"),
        ([*BUS, "--profile", "fd64-sec"], "input.key: expected a key file for profile fd64-sec, got none"),
        (
            [*BUS, "--profile", "fd64-sec", "--set", "input.key=nowhere.key"],
            "nowhere.key: the key could not be read: No such",
        ),
        (
            [*BUS, "--profile", "fd64-sec", "--set", "input.key=/dev/null"],
            "/dev/null: expected a key of AES-128, 32 hexadec",
        ),
        (
            [*BUS, "--set", "input.key=nowhere.key"],
            "input.key: expected with profile fd64-sec alone, got it with other frames",
        ),
        ([*BUS, "--set", "input.freshness=x"], "input.freshness: expected with profile fd64-sec alone"),
        (["demo", "--can-authenticated"], "--can-authenticated: expected with --can, got it alone"),
        (["dbc", "nowhere.h5"], "nowhere.h5: no such file"),
        (
            ["dbc", "x.h5", "--set", "input.cycle_time_ms=0.09"],
            "input.cycle_time_ms: expected 0.1 to 10,000 ms, got 0.09",
        ),
    ],
)
def test_wrong_arguments_are_one_line_and_exit_code_2(
    run: Callable[..., tuple[int, str, str]], arguments: list[str], text: str
) -> None:
    code, _, errors = run(*arguments)
    assert code == 2
    assert text in errors
    assert errors.count("\n") == 1


def test_the_dbc_command_writes_a_file(run: Callable[..., tuple[int, str, str]], tmp_path: Path) -> None:
    save_inverse_map(synthetic_inverse_map(1, 54), tmp_path / "map.h5")
    code, printed, _ = run(
        *("dbc", tmp_path / "map.h5", "-o", tmp_path / "x.dbc"),
        *("--set", "input.extended=true", "--set", "input.id_base=0x18FF0000"),
    )
    assert (code, printed) == (0, f"{tmp_path / 'x.dbc'}: written, 8 frames\n")
    database = cantools.database.load_file(tmp_path / "x.dbc")
    assert database.get_message_by_name("Strain2").frame_id == 0x18FF0002
    code, _, errors = run("dbc", tmp_path / "map.h5", "--profile", "fd65")
    assert code == 2
    assert "expected one of fd64, classic-le, fd64-sec, got 'fd65'" in errors
    code, _, errors = run("dbc", tmp_path / "map.h5", "--set", "results.id_base=0x301")
    assert code == 2
    assert "got 0x301 and " in errors
