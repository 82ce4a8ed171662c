"""The bus in one file: what each entry sets, what is refused, and a DBC file of one's own for both ends."""

import re
import signal
import subprocess
import sys
import tomllib
from collections.abc import Callable
from pathlib import Path

import can
import cantools
import numpy as np
import pytest
from recorded_case import read_csv
from synthetic_vehicle import N_GAUGES, SyntheticFiles

from builder.pipeline.demonstration.bus_flight import GROUP, private_port
from strainfmu.can.bus_file import TABLES, BusDescription, bus_template, read_bus
from strainfmu.can.dbc_files import MAPPING_TABLE, OTHER_ENTRIES, database_of, load_mapping
from strainfmu.can.dbc_mapping import mapped_layout
from strainfmu.can.frame_layout import FLOW_STDS, MAPPED_QUANTITIES
from strainfmu.can.options import BridgeOptions
from strainfmu.can.profiles import Identifiers
from strainfmu.errors import InputError

pytestmark = pytest.mark.fast

Run = Callable[..., tuple[int, str, str]]


def write(folder: Path, text: str) -> Path:
    """Write a bus file on a virtual channel, with ``text`` behind it."""
    path = folder / "bus.toml"
    path.write_text(f'[bus]\ninterface = "virtual"\nchannel = "x"\n{text}')
    return path


def test_entries_reach_the_options_in_si_units_and_files_from_the_folder(tmp_path: Path) -> None:
    described = read_bus(
        write(
            tmp_path,
            'options = { bitrate = 500000, fd = true }\n[input]\nprofile = "classic-le"\ncycle_time_ms = 20\n'
            "id_base = 0x100\n[results]\nid_base = 0x200\n[clock]\ntolerance_ppm = 50\n"
            '[zeros]\nfile = "zeros.toml"\n[record]\nfile = "run.blf"\n[page]\npublish = "127.0.0.1:5"\n'
            "[tare]\nat_s = 2\n",
        )
    )
    assert described.options() == BridgeOptions(
        interface="virtual",
        channel="x",
        bus_options=("bitrate=500000", "fd=true"),
        profile="classic-le",
        cycle_time=0.02,
        identifiers=Identifiers(0x100, 0x200),
        clock_tolerance=50 * 1e-6,
        zeros=tmp_path / "zeros.toml",
    )
    assert (described.record, described.publish) == (tmp_path / "run.blf", "127.0.0.1:5")
    assert described.tare_at == 2.0


def test_set_overrides_the_file_and_options_override_set(tmp_path: Path) -> None:
    path = write(tmp_path, "[clock]\ntolerance_ppm = 5\n[trust]\nstuck_cycles = 7\n")
    settings = ["clock.tolerance_ppm=6", "bus.channel = can1", "input.extended=true"]
    options = read_bus(path, settings, {"bus.channel": "can2", "bus.interface": None}).options()
    assert (options.clock_tolerance, options.channel, options.interface) == (6 * 1e-6, "can2", "virtual")
    assert options.stuck_cycles == 7
    assert options.identifiers == Identifiers(is_extended=True)


def test_a_replay_keeps_what_is_not_stated() -> None:
    before = BridgeOptions(interface="a", channel="b", max_age=3.0, identifiers=Identifiers(0x10, 0x20))
    options = read_bus(None, ["input.id_base=0x11"]).options(before)
    assert (options.interface, options.max_age) == ("a", 3.0)
    assert (options.identifiers.base, options.identifiers.result_base) == (0x11, 0x20)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("[clok]\n", "clok: unknown table, did you mean 'clock'"),
        ("[clock]\ntolerence_ppm = 1\n", "clock.tolerence_ppm: unknown entry, did you mean 'tolerance_ppm'"),
        ("[clock]\ntolerance_ppm = -1\n", "clock.tolerance_ppm: expected 0 to 10,000 ppm, got -1"),
        ("[clock]\ntolerance_ppm = '5'\n", r"clock.tolerance_ppm: expected a number \[ppm\], got '5'"),
        ("[trust]\nstuck_cycles = 1.5\n", r"trust.stuck_cycles: expected a whole number \[cycles\], got '1.5'"),
        ("[input]\nextended = 1\n", "input.extended: expected true or false, got '1'"),
        ("[input]\nprofile = 'fd65'\n", "input.profile: expected one of fd64, .*, got 'fd65'"),
        ("[input]\ndbc = 'a.dbc'\nprofile = 'fd64'\n", "input.profile: expected without input.dbc, got both"),
        ("[input]\ndbc = 'a.dbc'\n", "input.strain: expected a signal for each gauge of input.dbc, got none"),
        ("[input.strain]\ng1 = 'R.S'\n", "input.strain: unknown entry"),
        ("[input]\nmapping = 'a.toml'\n", "input.mapping: expected with input.dbc, got it alone"),
        ("[tare]\ncycles = 100\n", "tare.cycles: expected with tare.map, got it alone"),
        ("[page]\nrate_hz = 10\n", "page.rate_hz: expected with page.publish, got it alone"),
        ("[faults]\nnumber = 3\n", "faults: expected no such table"),
        ("[clock]\nhidden_ms = 5\n", "clock.hidden_ms: expected trust.max_age_cycles"),
        (
            "[input]\nslow_strains = 'hold'\n",
            "input.slow_strains: expected no such entry: slower frames of strains",
        ),
        ("[input]\nprofile = 'float2'\n", "input.profile=float2: expected fd64, .* input.dbc"),
        ("clock = 3\n", "bus.clock: unknown entry"),
        ("[clock\n", "bus.toml: "),
    ],
)
def test_wrong_files_get_one_line(tmp_path: Path, text: str, message: str) -> None:
    with pytest.raises(InputError, match=message) as caught:
        read_bus(write(tmp_path, text))
    assert "\n" not in str(caught.value)


def test_every_entry_sets_a_field_that_is_there() -> None:
    fields = {*BridgeOptions.__dataclass_fields__, *BusDescription.__dataclass_fields__}
    identifiers = {f"identifiers.{name}" for name in Identifiers.__dataclass_fields__}
    entries = [entry for table in TABLES.values() for entry in table.values()]
    assert {entry.sets for entry in entries} <= fields | identifiers
    assert {*TABLES[MAPPING_TABLE]} == {*OTHER_ENTRIES, "cycle_time_ms"}


def test_the_template_is_a_bus_file_and_so_is_each_of_its_lines(tmp_path: Path) -> None:
    text = bus_template(["g1", "g2"])
    (path := tmp_path / "bus.toml").write_text(text)
    assert read_bus(path).options() == BridgeOptions(interface="socketcan", channel="can0")
    table = ""
    for line in text.splitlines():
        if line.startswith(("[", "# [input.")):
            table = line.partition("[")[2].partition("]")[0]
        if line.startswith("# ") and " = " in line and table in TABLES:
            entry = tomllib.loads(line[2:])
            assert TABLES[table].keys() >= entry.keys()


def test_signals_of_the_template_are_accepted(tmp_path: Path) -> None:
    """Every signal that it names, of a DBC file that has them all."""
    lines = bus_template(["g1", "g2"]).splitlines()
    first = lines.index(next(line for line in lines if line.startswith("# With dbc, as far")))
    signals = [line.removeprefix("# ") for line in lines[first + 1 : lines.index("[results]")]]
    names = {"g1": "Rack1.Strain_1", "g2": "Rack1.Strain_2"}
    rows = "\n".join(f'"{gauge}" = "{signal}"' for gauge, signal in names.items())
    (path := tmp_path / "bus.toml").write_text("\n".join([*signals, "[input.strain]", rows]))
    mapping = load_mapping(path)
    units = {"m": ("Nav.Altitude",)} | {
        "Pa": ("Air.q_inf", "Air.p_static", "Ports.p1"),
        "rad": ("Inertial.Alpha",),
        "m/s2": ("Inertial.Ay",),
    }
    units |= {"K": ("Air.T_t", "Warm.T_nose"), "N": ("Engine.thrust",), "us": ("Rack1.Time",)}
    of = {signal: unit for unit, several in units.items() for signal in several} | {"Rack1.Strain_1": "um/m"}
    text = 'VERSION ""\nNS_ :\nBS_:\nBU_: A B\n'
    for number, message in enumerate(["Rack1", "Air", "Nav", "Inertial", "Warm", "Ports", "Engine", "Fins"]):
        text += f"BO_ {256 + number} {message}: 8 A\n"
        inside = sorted(set(re.findall(rf'"({message}\.\w+)"', path.read_text())))
        for place, named in enumerate(inside):
            start, name = 24 + 8 * place, named.partition(".")[2]
            text += f' SG_ {name} : {start}|8@1+ (1,0) [0|0] "{of.get(named, "")}" B\n'
    text += 'BA_DEF_ SG_ "GenSigStartValue" INT 0 255;\nBA_DEF_DEF_ "GenSigStartValue" 0;\n'
    layout = mapped_layout(
        database_of(text, "rack.dbc"),
        mapping | {"cycle_time_ms": 10},
        list(names),
        "bus.toml",
        sensor_names=["nose"],
        parameter_names=["parameter.cant_deg"],
        parameter_std_names=["parameter_std.cant_deg"],
        flow_names=[*MAPPED_QUANTITIES, *FLOW_STDS.values()],
        readings={"sensor.port_0deg": "Pa", "thrust": "N"},
    )
    assert layout.n_gauges == 2
    assert layout.is_timed


def bus_of_all(folder: Path) -> Path:
    """Write a DBC file of a rack's own, and a bus file that names its signals."""
    text, rows = 'VERSION ""\nNS_ :\nBS_:\nBU_: A B\n', ""
    for i in range(N_GAUGES):
        text += f"BO_ {256 + i} R{i}: 8 A\n"
        text += ' SG_ S : 0|16@1- (0.25,0) [0|0] "um/m" B\n SG_ T : 32|32@1+ (1,0) [0|0] "us" B\n'
        rows += f'"G{i}" = "R{i}.S"\n'
    text += 'BO_ 300 Air: 8 A\n SG_ q : 0|32@1+ (0.1,0) [0|0] "Pa" B\n'
    (folder / "rack.dbc").write_text(text)
    times = "".join(f'R{i} = "R{i}.T"\n' for i in range(N_GAUGES))
    own = 'dbc = "rack.dbc"\ncycle_time_ms = 10\ngauges = "map.h5"\n'
    air = '[input.dynamic_pressure]\nsignal = "Air.q"\n'
    return write(folder, f"[input]\n{own}{air}[input.strain]\n{rows}[input.sample_time]\n{times}")


def test_a_mapping_in_the_bus_file_is_the_mapping(tmp_path: Path) -> None:
    path = bus_of_all(tmp_path)
    options = read_bus(path).options()
    assert (options.dbc, options.mapping) == (tmp_path / "rack.dbc", path)
    assert load_mapping(path).keys() == {"cycle_time_ms", "dynamic_pressure", "strain", "sample_time"}
    assert options.cycle_time == BridgeOptions(interface="", channel="").cycle_time


def test_a_dbc_file_of_ones_own_serves_sender_and_bridge(
    synthetic: SyntheticFiles, tmp_path: Path, run: Run
) -> None:
    """One file, two commands: the strains of a plant come back as results, are recorded and replayed."""
    bus = bus_of_all(tmp_path)
    text = bus.read_text().replace('"virtual"', '"udp_multicast"').replace('"x"', f'"{GROUP}"')
    bus.write_text(text.replace("[input]", f"options = {{ port = {private_port()} }}\n[input]"))
    (tmp_path / "map.h5").write_bytes(synthetic.map_1.read_bytes())
    log = tmp_path / "run.blf"
    command = [sys.executable, "-c", "from strainfmu.cli.main import main; main()", "bridge"]
    command += [str(synthetic.estimator_1), "--bus", str(bus), "--record", str(log)]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as bridge:
        assert bridge.stdout is not None
        assert "6 gauges" in bridge.stdout.readline()
        code, out, errors = run("send", "--plant", synthetic.plant, "--bus", bus, "--duration", "0.4")
        bridge.send_signal(signal.SIGTERM)
        printed, failed = bridge.communicate(timeout=60)
    assert (code, errors, bridge.returncode, failed) == (0, "", 0, "")
    assert "40 in " in out
    assert "frames: not accounted for" in printed
    code, _, errors = run("dbc", synthetic.map_1, "-o", tmp_path / "results.dbc", "--bus", bus)
    assert (code, errors) == (0, "")
    database = cantools.database.load_file(tmp_path / "results.dbc")
    assert "R0" not in {message.name for message in database.messages}, "the input's own are the user's"
    of_results = [m for m in can.LogReader(log) if m.arbitration_id == 0x380]
    answers = [database.decode_message(m.arbitration_id, bytes(m.data), decode_choices=False) for m in of_results]
    # This input is classic, and so are its results.
    assert all(abs(answer["C_N"]) < 16.4 for answer in answers if answer["C_N"] != "NotAvailable")
    assert len(answers) >= 30
    log.with_name("run.blf.json").unlink()
    out_file = tmp_path / "loads.csv"
    for arguments in (("replay", log, synthetic.map_1), ("estimate", synthetic.map_1, log)):
        code, _, errors = run(*arguments, "-o", out_file, "--bus", bus)
        assert (code, errors) == (0, "")
        assert np.isfinite(read_csv(out_file)["C_N [1]"]).any()
