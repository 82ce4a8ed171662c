"""Options of the commands of the bus: what cannot be is refused with one line, before anything is opened."""

import re
from collections.abc import Callable
from math import isnan
from pathlib import Path
from types import SimpleNamespace
from typing import Annotated, Any, get_args, get_origin, get_type_hints

import pytest
from typer.main import get_command

from strainfmu.can.bus_file import TABLES, read_bus
from strainfmu.can.opening import bus_settings, known_bus_options
from strainfmu.can.options import BridgeSettings
from strainfmu.cli.commands import program
from strainfmu.cli.commands.command import OLD_OPTIONS, OLD_SOURCES
from strainfmu.errors import InputError

pytestmark = pytest.mark.fast

Run = Callable[..., tuple[int, str, str]]

WRONG = {
    ("--set", "trust.stuck_cycles=-5"): "--set trust.stuck_cycles: expected 0 to 1,000,000 cycles, got -5",
    ("--set", "trust.zero_cycles=5"): "--set: trust.zero_cycles: expected no such entry: how often gauges repeat",
    ("--set", "clock.rate_ppm=3"): "--set: clock.rate_ppm: expected ",
    (
        "--set",
        "trust.max_age_cycles=nan",
    ): "--set trust.max_age_cycles: expected 0.01 to 1,000,000 cycles, got nan",
    ("--set", "input.dynamic_pressure_pa=nan"): "input.dynamic_pressure_pa: expected 1 to 100,000,000 Pa, got nan",
    ("--set", "input.cycle_time_ms=1e-12"): "--set input.cycle_time_ms: expected 0.1 to 10,000 ms, got 1e-12",
    ("--set", "input.cycle_time_ms=true"): "--set input.cycle_time_ms: expected a number [ms], got 'True'",
    ("--set", "trust.max_age=3"): "--set: trust.max_age: unknown entry, did you mean 'max_age_cycles'",
    ("--set", "trsut.max_age=3"): "--set: trsut: unknown table, did you mean 'trust'",
    ("--set", "max_age=3"): "--set: expected TABLE.ENTRY=VALUE such as trust.max_age_cycles=10, got 'max_age=3'",
    ("--set", "faults.kinds=1"): "--set: faults: expected no such table: faults are injected",
    ("--set", "input.profile=fd65"): "--set input.profile: expected one of fd64, classic-le, fd64-sec, got 'fd65'",
    (
        "--clock-tolerance",
        "3",
    ): "--clock-tolerance: state it as entry tolerance_ppm of [clock] in the bus file, or by --set clock.",
    ("--duration", "nan"): "--duration: expected 0.001 .. 100000000 s, got nan",
    ("--duration", "-3"): "--duration: expected 0.001 .. 100000000 s, got -3",
    ("--duration", "inf"): "--duration: expected 0.001 .. 100000000 s, got inf",
    ("--bus-option", "foo=1"): "--bus-option: expected an option of virtual (can_filters, preserve_timestamps,",
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

    monkeypatch.setattr("strainfmu.tare", interrupted)
    code, out, errors = run("tare", "map.h5", "ground.csv", "--window", "0:1", "-o", tmp_path / "z.toml")
    assert (code, out) == (130, "")
    assert errors == "strainfmu: interrupted; what was finished is kept\n"


def test_the_other_commands_hold_the_same_limits(run: Run, tmp_path: Path) -> None:
    bus = ("none.csv", "--map", "none.h5", "--interface", "virtual", "--channel", "x")
    commands: tuple[tuple[str, ...], ...] = (
        ("dbc", "none.h5", "-o", str(tmp_path / "x.dbc")),
        ("send", *bus),
        ("replay", "none.blf", "none.fmu", "-o", str(tmp_path / "x.csv")),
    )
    for command in commands:
        code, _, errors = run(*command, "--set", "input.cycle_time_ms=0.09")
        assert (code, "--set input.cycle_time_ms: expected 0.1 to 10,000 ms" in errors) == (2, True), command
    code, _, errors = run("send", *bus, "--bus-option", "prot=1")
    assert (code, "expected an option of virtual" in errors) == (2, True)


@pytest.mark.parametrize("command", OLD_OPTIONS)
def test_old_options_name_the_entry_that_replaces_them(command: str, run: Run) -> None:
    """Each is an entry of the bus file, and no option of the command any more."""
    parameters = {option for one in get_command(program()).commands[command].params for option in one.opts}
    for option, entry in {**OLD_OPTIONS[command]}.items():
        table, _, name = entry.partition(".")
        assert name in TABLES[table], entry
        assert option not in parameters
        code, _, errors = run(command, option, "1")
        assert (code, errors.count("\n")) == (2, 1)
        assert f"{option}: state it as entry {name} of [{table}] in the bus file" in errors


@pytest.mark.parametrize("command", ["bridge", "send"])
def test_the_bus_file_leaves_at_most_ten_options(command: str) -> None:
    """Arguments and --help aside: everything else is an entry of the bus file."""
    options = [one for one in get_command(program()).commands[command].params if one.opts[0].startswith("--")]
    assert len([one for one in options if "--help" not in one.opts]) <= 10


@pytest.mark.parametrize("option", OLD_SOURCES)
def test_old_sources_of_send_name_what_replaces_them(option: str, run: Run) -> None:
    code, _, errors = run("send", option, "x")
    assert (code, f"{option}: is replaced by {OLD_SOURCES[option]}" in errors) == (2, True)


def number_options() -> dict[str, Any]:
    """Return the callback of every option that takes a number, by command and parameter."""
    found = {}
    for command in program().registered_commands:
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
    for milliseconds in (0.1, 10_000.0):
        described = read_bus(None, [f"input.cycle_time_ms={milliseconds}"])
        assert described.stated["cycle_time"] == pytest.approx(1e-3 * milliseconds, rel=1e-15)


def test_options_that_an_interface_reads_are_allowed() -> None:
    """Named by its constructor, read from its keyword arguments by name; or of a bit timing."""
    for interface, names in {
        "udp_multicast": ("port", "hop_limit", "fd", "receive_own_messages"),
        "pcan": ("bitrate", "device_id", "fd", "auto_reset", "f_clock_mhz", "nom_brp", "data_sjw"),
        "kvaser": ("bitrate", "data_bitrate", "single_handle"),  # all of them unnamed
    }.items():
        bus_settings(interface, "0", [f"{name}=1" for name in names])
    with pytest.raises(InputError, match=r"expected an option of udp_multicast .*, got 'prot'"):
        bus_settings("udp_multicast", "0", ["port=1", "prot=1"])
    assert known_bus_options("of_somebody_else") == (None, set())


def test_no_help_loses_what_is_in_brackets(run: Run, monkeypatch: pytest.MonkeyPatch) -> None:
    """Markup takes [um/m] for a tag. Every bracket of every help text is held against what is shown."""
    monkeypatch.setenv("COLUMNS", "400")
    seen = 0
    for name, command in get_command(program()).commands.items():
        texts = [command.help or "", *(getattr(entry, "help", None) or "" for entry in command.params)]
        wanted = [found for text in texts for found in re.findall(r"\[[^\[\]\n]+\]", text)]
        seen += len(wanted)
        if wanted:
            _, out, _ = run(name, "--help")
            assert [found for found in wanted if found not in out] == [], name
    assert seen >= 2
    assert "'strain[1] [um/m]'" in run("estimate", "--help")[1]
