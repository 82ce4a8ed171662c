"""Options of the commands of the bus: what cannot be is refused with one line, before anything is opened."""

from __future__ import annotations

import re
from collections.abc import Callable
from math import isnan
from pathlib import Path
from types import SimpleNamespace
from typing import Annotated, Any, get_args, get_origin, get_type_hints

import pytest
from typer.main import get_command

from strainfmu.can.settings import BridgeSettings
from strainfmu.cli.commands import app
from strainfmu.cli.commands.bus_options import check_bus_options, cycle_time_of, known_bus_options
from strainfmu.errors import InputError

pytestmark = pytest.mark.fast

Run = Callable[..., tuple[int, str, str]]

WRONG = {
    ("--stuck-cycles", "-5"): "--stuck-cycles: expected 0 .. 1000000, got -5",
    ("--zero-cycles", "0"): "--zero-cycles: expected 1 .. 1000000, got 0",
    ("--gauge-noise", "0"): "--gauge-noise: expected 0.0001 .. 1000 um/m, got 0",
    ("--duration", "nan"): "--duration: expected 0.001 .. 100000000 s, got nan",
    ("--duration", "-3"): "--duration: expected 0.001 .. 100000000 s, got -3",
    ("--duration", "inf"): "--duration: expected 0.001 .. 100000000 s, got inf",
    ("--max-age", "nan"): "--max-age: expected 0.01 .. 1000000 cycles, got nan",
    ("--dynamic-pressure", "nan"): "--dynamic-pressure: expected 1 .. 100000000 Pa, got nan",
    ("--cycle-time", "1e-12"): "--cycle-time: expected 0.1 .. 10000 ms, got 1e-12",
    ("--cycle-time", "10001"): "--cycle-time: expected 0.1 .. 10000 ms, got 10001",
    ("--bus-option", "foo=1"): "--bus-option: virtual knows no 'foo'; it takes can_filters, preserve_timestamps,",
}


@pytest.mark.parametrize("wrong", WRONG, ids=" ".join)
def test_wrong_options_of_the_bridge_get_one_line(run: Run, wrong: tuple[str, str]) -> None:
    code, _, errors = run("bridge", "none.fmu", "--interface", "virtual", "--channel", "x", *wrong)
    assert code == 2
    assert WRONG[wrong] in errors
    assert errors.count("\n") == 1


def test_ctrl_c_within_a_command_ends_in_one_line(
    run: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Typer turns it into an exit code, without a word."""

    def interrupted(*_: object, **__: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr("strainfmu.estimator.map.inverse_map.load_inverse_map", interrupted)
    code, out, errors = run("tare", "map.h5", "ground.csv", "--window", "0:1", "-o", tmp_path / "z.toml")
    assert (code, out) == (130, "")
    assert errors == "strainfmu: interrupted; what was finished is kept\n"


def test_the_other_commands_hold_the_same_limits(run: Run, tmp_path: Path) -> None:
    bus = ("--interface", "virtual", "--channel", "x", "--data", "none.csv")
    commands: tuple[tuple[str, ...], ...] = (
        ("dbc", "none.h5", "-o", str(tmp_path / "x.dbc")),
        ("send", "none.h5", *bus),
        ("replay", "none.blf", "none.fmu", "-o", str(tmp_path / "x.csv")),
    )
    for command in commands:
        code, _, errors = run(*command, "--cycle-time", "0.09")
        assert (code, "--cycle-time: expected 0.1 .. 10000 ms, got 0.09" in errors) == (2, True), command
    code, _, errors = run("send", "none.h5", *bus, "--bus-option", "prot=1")
    assert (code, "virtual knows no 'prot'" in errors) == (2, True)
    code, _, errors = run(*commands[2], "--dynamic-pressure", "inf")
    assert (code, "--dynamic-pressure: expected 1 .. 100000000 Pa, got inf" in errors) == (2, True)


def number_options() -> dict[str, Any]:
    """Return the callback of every option that takes a number, by command and parameter."""
    found = {}
    for command in app.registered_commands:
        assert command.callback is not None
        for name, hint in get_type_hints(command.callback, include_extras=True).items():
            kind, *info = get_args(hint) if get_origin(hint) is Annotated else (hint,)
            if {int, float} & {kind, *get_args(kind)}:
                found[f"{command.callback.__name__} {name}"] = info[0].callback
    return found


NOT_KNOWN = {"estimate dynamic_pressure"}
"""Options of which NaN says that a number is not known."""


@pytest.mark.parametrize("option", number_options())
def test_every_number_of_every_command_has_a_range(option: str) -> None:
    """Far beyond any meaning, and NaN: refused by the option itself, with its name and its range."""
    check = number_options()[option]
    assert check is not None
    for value in (1e300, -1e300, float("nan")):
        if isnan(value) and option in NOT_KNOWN:
            assert isnan(check(SimpleNamespace(opts=["-x", "--x"]), value))
            continue
        with pytest.raises(InputError, match=rf"^--x: expected .* \.\. .*, got {re.escape(f'{value:g}')}$"):
            check(SimpleNamespace(opts=["-x", "--x"]), value)


def test_a_described_run_holds_them_too() -> None:
    with pytest.raises(InputError, match=r"stuck_cycles: expected .*, got -5$"):
        BridgeSettings(stuck_cycles=-5)


def test_the_limits_of_the_cycle_time_are_allowed() -> None:
    assert cycle_time_of(0.1) == 0.1e-3
    assert cycle_time_of(10_000.0) == 10.0
    with pytest.raises(InputError, match="nan ms found"):
        cycle_time_of(float("nan"))


def test_options_that_an_interface_reads_are_allowed() -> None:
    """Named by its constructor, read from its keyword arguments by name; or of a bit timing."""
    check_bus_options("udp_multicast", ["port", "hop_limit", "fd", "receive_own_messages"])
    check_bus_options("pcan", ["bitrate", "device_id", "fd", "auto_reset", "f_clock_mhz", "nom_brp", "data_sjw"])
    check_bus_options("kvaser", ["bitrate", "data_bitrate", "single_handle"])  # all of them unnamed
    with pytest.raises(InputError, match="udp_multicast knows no 'prot'"):
        check_bus_options("udp_multicast", ["port", "prot"])
    assert known_bus_options("of_somebody_else") is None


def test_no_help_loses_what_is_in_brackets(run: Run, monkeypatch: pytest.MonkeyPatch) -> None:
    """Markup takes [um/m] for a tag. Every bracket of every help text is held against what is shown."""
    monkeypatch.setenv("COLUMNS", "400")
    seen = 0
    for name, command in get_command(app).commands.items():
        texts = [command.help or "", *(getattr(entry, "help", None) or "" for entry in command.params)]
        wanted = [found for text in texts for found in re.findall(r"\[[^\[\]\n]+\]", text)]
        seen += len(wanted)
        if wanted:
            _, out, _ = run(name, "--help")
            assert [found for found in wanted if found not in out] == [], name
    assert seen >= 2
    assert "'strain[1] [um/m]'" in run("estimate", "--help")[1]
